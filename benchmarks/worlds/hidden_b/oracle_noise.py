# SPDX-License-Identifier: Apache-2.0
"""
How the means that the oracle compares scatter.

All that is random in the generator is a sum of sinusoids, of steps or of white noise, and a small
force moves the ship linearly: each is a column of what one standard normal number does to the
means. Its sizes are those that the generator draws from, of the instruments those of the kit.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from benchmarks.worlds.hidden_b.hulls import AIR, GRAVITY, Array
from benchmarks.worlds.hidden_b.instruments import Kit
from benchmarks.worlds.hidden_b.oracle_sail import Means, Run, Sailed
from benchmarks.worlds.hidden_b.setting import Setting
from benchmarks.worlds.hidden_b.voyage import Track, sail_at

_START_SD_M = 100.0  # of the place that is counted from
_SHAFT_SD = 0.01  # of the revs over those before the stop
_GUST_LEAST = 0.26  # [m/s], root mean square of what is drawn, gusts of light air in it
_GUST_SHARE = 0.19  # of the wind
_SIDES = 0.88  # of a gust along the wind and one across, root mean square
_MOVED = {  # what moves an input
    'speed_through_water': ('log',),
    'position': ('along', 'across'),
    'heading': ('heading',),
    'shaft': ('shaft',),
    'wind_apparent': ('ahead', 'port'),
}
OUTSIDE = ('force, quick', 'force, slow', 'force and helm', 'log', 'gyro')


class Scatter:
    """
    How a run's row scatters about what would be without chance.
    """

    def __init__(self, run: Run) -> None:
        self.run = run

    @cached_property
    def _t(self) -> Array:
        lead = np.linspace(-self.run.known.lead_s, 0.0, 161)[:-1]
        return np.concatenate([lead, np.linspace(0.0, self.run.known.coast_s, 241)])

    @cached_property
    def _waves(self) -> dict[str, tuple[Array, Array]]:
        """Sinusoids of standard size, and their rates, of each slow process."""
        long_s = float(np.clip(4.0 * self.run.hull.time_s, 300.0, 3600.0))
        period = float(np.sqrt(np.pi * self.run.hull.length_m / GRAVITY))
        bands = {
            'eddies': (long_s / 12.0, long_s, 24),
            'helm': (40.0, 300.0, 24),
            'yaw': (400.0, 3000.0, 8),
            'gain': (100.0, 2000.0, 24),
            'place': (80.0, 900.0, 32),
            'gyro': (100.0, 900.0, 24),
            'compass': (100.0, 3000.0, 12),
            'groups': (8.0 * period, 30.0 * period, 16),
        }
        return {name: _sinusoids(self._t, *each) for name, each in bands.items()}

    def _columns(self, **moves: Array) -> Array:
        """
        Return the rows that small changes (times, m) make.

        Of `log`, of velocities over ground `along` and `across`, of `heading`, `ahead` and
        `port`, the apparent wind, and of the place itself, `east` and `north`.
        """
        t, m = self._t, next(iter(moves.values())).shape[1]
        none = np.zeros((len(t), m))
        parts = []
        for name, means in self.run.means.items():
            curves = [moves.get(each, none) for each in _MOVED[name]]
            if name == 'position':
                curves = [_summed(t, moves[k]) if k in moves else none for k in _MOVED[name]]
                if 'east' in moves:
                    off = np.einsum('ij,jtm->itm', self.run.frame, [moves['east'], moves['north']])
                    curves = [curves[0] + off[0], curves[1] + off[1]]
            parts += [means.of(t, curve) for curve in curves]
        return np.concatenate(parts)

    def about(self, setting: Setting, run: Sailed) -> tuple[Array, Array, Array, dict[str, Array]]:
        """
        Return how the row scatters about the run that would be.

        Returns
        -------
        (n, n)
            Covariance of this run's own, without eddies and helm.
        (n, n)
            Of eddies of one percent of the speed.
        (n, n)
            Of a helm that wanders by a degree.
        dict of (n, m)
            Columns of smooth unknowns, by `OUTSIDE`; those of one run alone are of this one.
        """
        t, track = self._t, run.track
        water = np.interp(t, track.t, track.water_m_s)
        reply = _Reply(t, setting)
        inertia = setting.mass_kg * (1.0 + setting.n_r)
        columns = [*self._of_gusts(setting, track.wind_m_s, track.t, reply, inertia)]
        if setting.waves:
            columns.append(self._of_groups(setting, track.heading_rad[0], water, reply, inertia))
        gain = self._waves['gain'][0] * self.run.known.kit.log_gain
        columns.append(self._columns(log=gain * water[:, None]))
        columns += self._of_place(track.place_m, track.t)
        columns.append(self._of_context(track))
        every = np.concatenate(columns, axis=1)
        own = every @ every.T + self._white(water)
        eddies, helm = self._of_eddies(setting, reply), self._of_helm(water)
        found = own, eddies @ eddies.T, helm @ helm.T
        return *found, self._unknown(setting, water, reply, inertia, run)

    def _of_gusts(
        self, setting: Setting, wind: Array, t: Array, reply: _Reply, inertia: float
    ) -> list[Array]:
        hull = self.run.hull
        mean = float(np.hypot(*np.sum([(0.0, 0.0), *setting.wind], axis=0)))
        sd = self.run.gust_sd or _SIDES * float(np.hypot(_GUST_LEAST, _GUST_SHARE * mean))
        past = max(mean + 0.6 * setting.speed_m_s, 2.0)
        gust = sd * _gusts(self._t, past, 0.5 * hull.frontal_m2 / hull.breadth_m)
        air = 0.5 * AIR * hull.frontal_m2 * hull.air_drag
        ahead, port = (np.interp(self._t, t, wind[:, k]) for k in (0, 1))

        def force(a: Array, p: Array) -> Array:
            square = a * a + p * p + 1e-12
            c = a / np.sqrt(square)
            return air * square * (c - 0.12 * (4.0 * c**3 - 4.0 * c))

        found = []
        for da, dp, name in ((0.05, 0.0, 'ahead'), (0.0, 0.05, 'port')):
            slope = (force(ahead + da, port + dp) - force(ahead - da, port - dp)) / 0.1
            moves = reply(gust * slope[:, None] / inertia)
            found.append(self._columns(log=moves, along=moves, **{name: gust}))
        return found

    def _of_groups(
        self, setting: Setting, heading: float, water: Array, reply: _Reply, inertia: float
    ) -> Array:
        one = np.full(len(water), heading)
        size = np.zeros(len(water))
        for law in setting.waves:
            at_rest, slope = law(self._t, one, setting.period_s, None)
            size = size + at_rest + slope * water
        moves = reply(0.35 * self._waves['groups'][0] * size[:, None] / inertia)
        return self._columns(log=moves, along=moves)

    def _of_helm(self, water: Array) -> Array:
        """Of an autopilot that wanders by one degree, and more slowly by two in the end."""
        helm = np.radians(1.0) * self._waves['helm'][0]
        grown = np.clip(self._t / self.run.known.coast_s, 0.0, 1.0)[:, None]
        yaw = np.radians(2.2) * self._waves['yaw'][0] * grown
        columns = [self._columns(heading=a, across=water[:, None] * a) for a in (helm, yaw)]
        return np.concatenate(columns, axis=1)

    def _of_eddies(self, setting: Setting, reply: _Reply) -> Array:
        """Of eddies of one percent of the speed, along and across."""
        sd = 0.01 * self.run.speed_m_s
        value, rate = (sd * each for each in self._waves['eddies'])
        moves = reply(-rate / (1.0 + setting.n_r))
        return np.concatenate(
            [self._columns(log=moves, along=moves + value), self._columns(across=value)], axis=1
        )

    def _of_place(self, place: Array, t: Array) -> list[Array]:
        """Of what is wrong with places, slowly, and of where they are counted from."""
        kit, one = self.run.known.kit, np.ones((len(self._t), 1))
        none = 0.0 * one
        found = [
            self._columns(east=_START_SD_M * one, north=none),
            self._columns(east=none, north=_START_SD_M * one),
        ]
        if kit.fix == 'radar':
            turn, _ = _fixes(self._places(place, t), kit)
            gyro = 0.6 * kit.bearing_sd_rad * self._waves['gyro'][0]
            found.append(self._columns(east=gyro * turn[:, :1], north=gyro * turn[:, 1:]))
            return found
        wander = kit.wander_m * self._waves['place'][0]
        edges = np.linspace(self._t[0], self._t[-1], 25)[1:-1]
        steps = kit.step_m * np.sqrt(2.0 / 24.0) * (self._t[:, None] > edges)
        for each in (wander, steps):
            found.append(self._columns(east=each, north=0.0 * each))
            found.append(self._columns(east=0.0 * each, north=each))
        return found

    def _places(self, place: Array, t: Array) -> Array:
        early = place[0] + (place[1] - place[0]) / (t[1] - t[0]) * self._t[:, None]
        after = np.stack([np.interp(self._t, t, place[:, k]) for k in (0, 1)], axis=1)
        return np.where(self._t[:, None] < 0.0, early, after)

    def _of_context(self, track: Track) -> Array:
        """Of compass and anemometer."""
        one = np.ones((len(self._t), 1))
        columns = [
            self._columns(heading=0.007 * one),
            self._columns(heading=0.0052 * self._waves['compass'][0]),
        ]
        if 'wind_apparent' in self.run.means:
            ahead, port = (
                np.interp(self._t, track.t, track.wind_m_s[:, k])[:, None] for k in (0, 1)
            )
            columns.append(self._columns(ahead=0.045 * ahead, port=0.045 * port))
            columns.append(self._columns(ahead=-0.035 * port, port=0.035 * ahead))
        return np.concatenate(columns, axis=1)

    def _white(self, water: Array) -> Array:
        """Of what is independent from bin to bin."""
        kit, parts = self.run.known.kit, []
        for name, means in self.run.means.items():
            width = means.width
            if name == 'speed_through_water':
                slow = 2.0 * (0.3 * kit.log_filter_s + 1.0)
                variance = self.run.quick_sd**2 * np.minimum(slow / width, 1.0)
                fall = np.abs(np.gradient(np.interp(means.t, self._t, water)))
                step, spread = kit.log_step_m_s, self.run.quick_sd
                left = step / np.sqrt(12.0) * np.exp(-2.0 * (np.pi * spread / step) ** 2)
                variance = variance + left**2 / (1.0 + (fall / step) ** 2)
                parts.append(np.diag(variance + step**2 / 12.0 / means.n))
            elif name == 'position':
                parts.append(self._white_places(means))
            elif name == 'heading':
                parts.append(np.diag(0.0005**2 + 0.003**2 / means.n))
            elif name == 'shaft':
                falls = np.abs(np.gradient(means.value[:, 0]))
                level = float(np.mean(means.value[means.t < 0.0]))
                parts.append(np.diag(_SHAFT_SD**2 + (0.15 * falls / level) ** 2))
            else:
                parts.append(np.diag(np.tile(0.04 / means.n + 0.05**2, 2)))
        size = sum(map(len, parts))
        whole, at = np.zeros((size, size)), 0
        for part in parts:
            whole[at : at + len(part), at : at + len(part)] = part
            at += len(part)
        return whole

    def _white_places(self, means: Means) -> Array:
        kit, n = self.run.known.kit, len(means.t)
        if kit.fix != 'radar':
            width = means.width
            slow = (0.06 * kit.wander_m) ** 2 * np.minimum(30.0 / width, 1.0)
            return np.diag(np.tile(slow + (0.05**2 + 0.05**2) / means.n + 1e-4, 2))
        _, scatter = _fixes(means.value, kit)
        turned = np.einsum('ij,njk,lk->nil', self.run.frame, scatter, self.run.frame)
        turned = turned / means.n[:, None, None]
        found = np.zeros((2 * n, 2 * n))
        for i in (0, 1):
            for j in (0, 1):
                found[i * n : (i + 1) * n, j * n : (j + 1) * n] = np.diag(turned[:, i, j])
        return found

    def _unknown(
        self, setting: Setting, water: Array, reply: _Reply, inertia: float, run: Sailed
    ) -> dict[str, Array]:
        t, coast = self._t, self.run.known.coast_s
        hull = self.run.hull
        first = float(np.interp(hull.speed_m_s, hull.grid_m_s, hull.still_n))

        def force(slow: float) -> Array:
            moves = reply(0.13 * first / inertia * _smooth(t, coast, slow))
            return self._columns(log=moves, along=moves)

        helm = np.radians(4.0) * _smooth(t, coast, 0.15)
        log = self._columns(log=0.05 * water[:, None] * _smooth(t, coast, 0.08))
        found = {
            'force, quick': force(0.06),
            'force, slow': force(0.3),
            'force and helm': np.concatenate(
                [force(0.12), self._columns(heading=helm, across=water[:, None] * helm)], axis=1
            ),
            'log': log,
        }
        if self.run.known.kit.fix == 'radar':
            places = self._places(run.track.place_m, run.track.t)
            off = np.mean(self.run.known.kit.marks_m, axis=0) - places
            gyro = np.radians(2.0) * _smooth(t, coast, 0.4)
            found['gyro'] = self._columns(
                east=gyro * off[:, 1:], north=-gyro * off[:, :1], heading=gyro
            )
        return found


class _Reply:
    """How a small force moves the ship: linear, with the engine held before the stop."""

    def __init__(self, t: Array, setting: Setting) -> None:
        dt, push = setting.step_s, 2e-3 * setting.speed_m_s
        coast = np.arange(round(setting.coast_s / dt) + 1) * dt
        steady = np.arange(-round(0.5 * setting.hull.time_s / dt), 0) * dt
        logs = []
        for times in (steady, coast):
            apart = sail_at(setting, times, push).water_m_s - sail_at(setting, times).water_m_s
            logs.append(np.log(np.maximum(apart / push, 1e-6)))
        slope = logs[0][-1] / (steady[-1] - steady[0])
        held = np.where(t < 0.0, slope * t, np.interp(t, coast, logs[1]))
        self.keep, self.step = np.exp(np.diff(held)), np.diff(t)

    def __call__(self, acceleration: Array) -> Array:
        """
        Return the change of speed that accelerations (times, m) make.
        """
        found = np.zeros_like(acceleration)
        pushes = (self.step * np.sqrt(self.keep))[:, None]
        pushes = pushes * 0.5 * (acceleration[1:] + acceleration[:-1])
        now = found[0]
        for i, keep in enumerate(self.keep):
            now = keep * now + pushes[i]
            found[i + 1] = now
        return found


def _sinusoids(t: Array, short_s: float, long_s: float, n: int) -> tuple[Array, Array]:
    edge = np.geomspace(1.0 / long_s, 1.0 / short_s, n + 1)
    omega = 2 * np.pi * np.sqrt(edge[1:] * edge[:-1])
    c, s = np.cos(np.outer(t, omega)), np.sin(np.outer(t, omega))
    return np.concatenate([c, s], 1) / np.sqrt(n), np.concatenate([-omega * s, omega * c], 1) / (
        np.sqrt(n)
    )


def _gusts(t: Array, wind: float, height: float) -> Array:
    """Return sinusoids of gusts of standard size, after von Karman and Davenport half each."""
    edge = np.geomspace(1.0 / 2500.0, 0.2, 33)
    f = np.sqrt(edge[1:] * edge[:-1])
    x = f * 50.0 * max(height, 3.0) ** 0.35 / wind
    karman = (x / f) / (1.0 + 70.8 * x**2) ** (5.0 / 6.0) * np.diff(edge)
    x = 1200.0 * f / wind
    davenport = x**2 / f / (1.0 + x**2) ** (4.0 / 3.0) * np.diff(edge)
    size = np.sqrt(0.5 * karman / karman.sum() + 0.5 * davenport / davenport.sum())
    at = np.outer(t, 2 * np.pi * f)
    return np.concatenate([size * np.cos(at), size * np.sin(at)], axis=1)


def _smooth(t: Array, coast: float, slow: float) -> Array:
    """Return columns of a smooth curve of standard size from the stop on; `slow` of the coast."""
    knots = np.linspace(0.0, coast, 41)
    apart = np.abs(knots[:, None] - knots) / (slow * coast)
    root = np.linalg.cholesky((1.0 + apart) * np.exp(-apart) + 1e-6 * np.eye(41))
    place = t / (knots[1] - knots[0])
    hats = np.maximum(1.0 - np.abs(place[:, None] - np.arange(41)), 0.0)
    return np.where(t[:, None] > 0.0, hats, 0.0) @ root


def _summed(t: Array, velocity: Array) -> Array:
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(t)[:, None]
    return np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])


def _fixes(place: Array, kit: Kit) -> tuple[Array, Array]:
    """Return what a turn of the bearings does to radar fixes, and the scatter of one fix."""
    normal, right = np.zeros((len(place), 2, 2)), np.zeros((len(place), 2))
    for mark in kit.marks_m:
        to = np.array(mark) - place
        away = np.hypot(to[:, 0], to[:, 1])
        ahead = to / away[:, None]
        side = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        radial = 1.0 / (kit.range_sd_m**2 + 1.852**2 / 12.0)
        across = (kit.bearing_sd_rad * np.maximum(away, 50.0)) ** -2
        normal += radial * ahead[:, :, None] * ahead[:, None, :]
        normal += across[:, None, None] * side[:, :, None] * side[:, None, :]
        right += -(across * away)[:, None] * side
    scatter = np.linalg.inv(normal)
    return np.einsum('nij,nj->ni', scatter, right), scatter
