# SPDX-License-Identifier: Apache-2.0
"""
What the library of the diagnosis names, each by a formula of its own.

`size` is 1 where an effect is of usual size; a case makes it larger or smaller until it matters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import numpy as np

from benchmarks.worlds.hidden_b.hulls import GRAVITY, SEA, Array, Hull
from benchmarks.worlds.hidden_b.screws import Screw
from benchmarks.worlds.hidden_b.setting import Setting
from benchmarks.worlds.hidden_b.weather import band


@dataclass(frozen=True)
class Hidden:
    """
    One hidden effect.

    Attributes
    ----------
    name
        As the diagnosis would say.
    scope
        `hull`, `earth`, `sensor` or `run`: the last acts in one run alone.
    parameters
        As the contract defines them, as near as the formula allows.
    apply
        Change a setting.
    """

    name: str
    scope: str
    parameters: dict[str, float]
    apply: Callable[[Setting], None]


def hidden(name: str, scope: str, parameters: dict[str, float], **laws: Any) -> Hidden:
    """
    Return an effect that adds a law to each of some lists of a setting.
    """

    def apply(setting: Setting) -> None:
        for field, law in laws.items():
            getattr(setting, field).append(law)

    return Hidden(name, scope, parameters, apply)


def changed(
    name: str, scope: str, parameters: dict[str, float], part: str = 'faults', **to: Any
) -> Hidden:
    """
    Return an effect that changes attributes of a part of a setting.
    """

    def apply(setting: Setting) -> None:
        setattr(setting, part, replace(getattr(setting, part), **to))

    return Hidden(name, scope, parameters, apply)


@dataclass(frozen=True)
class Draw:
    """
    What an effect is drawn for: random numbers, ship, size and length of the coast.
    """

    rng: np.random.Generator
    hull: Hull
    screw: Screw
    size: float
    coast_s: float
    steady: tuple[float, float]

    @property
    def sign(self) -> float:
        """One or the other way."""
        return float(self.rng.choice((-1.0, 1.0)))

    @property
    def first_n(self) -> float:
        """Resistance at the first speed."""
        return float(np.interp(self.hull.speed_m_s, self.hull.grid_m_s, self.hull.still_n))

    def area(self, share: float) -> float:
        """
        Return the drag area that makes a share of the resistance at the first speed.
        """
        return share * self.first_n / (0.5 * SEA[0] * self.hull.speed_m_s**2)


def fouling(d: Draw) -> Hidden:
    """Roughness after Townsin: k_s of slime and shell; less at low Reynolds numbers."""
    wanted = d.rng.uniform(0.1, 0.5) * d.size
    hull = d.hull
    speed = 0.7 * hull.speed_m_s

    def added(height: float, v: Array) -> Array:
        reynolds = np.maximum(v * hull.length_m / SEA[1], 1e5)
        rough = 0.044 * ((height / hull.length_m) ** (1 / 3) - 10.0 * reynolds ** (-1 / 3))
        rough = np.maximum(rough + 0.000125, 0.1 * height ** (1 / 3) * 0.01)
        return 0.5 * SEA[0] * hull.wetted_m2 * v**2 * rough

    clean = float(np.interp(speed, hull.grid_m_s, hull.friction_n))
    heights = np.geomspace(1e-6, 0.1, 200)
    factors = np.array([added(h, np.array([speed]))[0] for h in heights]) / clean
    height = float(heights[min(np.searchsorted(factors, wanted), 199)])
    factor = float(added(height, np.array([speed]))[0] / clean)

    return hidden(
        'fouling', 'hull', {'friction_factor': factor}, still=lambda _, v, r: r + added(height, v)
    )


def shallow_water(d: Draw) -> Hidden:
    """Loss of speed after Lackenby (1963); more water is to be pushed past."""
    hull = d.hull
    depth = hull.draught_m / float(np.clip(d.rng.uniform(0.3, 0.5) * d.size, 0.12, 0.68))
    depth = max(depth, 1.6 * hull.speed_m_s**2 / GRAVITY)
    middle = 0.97 * hull.breadth_m * hull.draught_m

    def still(_: Hull, v: Array, r: Array) -> Array:
        loss = 0.1242 * max(middle / depth**2 - 0.05, 0.0) + 1.0
        loss = loss - np.sqrt(np.tanh(GRAVITY * depth / np.maximum(v, 0.05) ** 2))
        return np.interp(v / (1.0 - np.clip(loss, 0.0, 0.35)), v, r)

    def apply(setting: Setting) -> None:
        setting.of_depth.append(still)
        setting.depth_m = depth
        setting.added *= 1.0 + 0.8 * (hull.draught_m / depth) ** 2

    return Hidden('shallow_water', 'earth', {'depth_m': depth}, apply)


def towed_cable(d: Draw) -> Hidden:
    """Skin drag along its length, that straightens with speed."""
    area = d.area(d.rng.uniform(0.06, 0.3) * d.size)
    first = d.hull.speed_m_s

    def still(_: Hull, v: Array, r: Array) -> Array:
        return r + 0.5 * SEA[0] * area * v**2 * (np.maximum(v, 0.05 * first) / first) ** -0.12

    return hidden('towed_cable', 'hull', {'drag_area_m2': area}, still=still)


def _stopped(d: Draw, name: str, screw: Screw, speed: float, **parameters: float) -> Hidden:
    """Return another state of the stopped propeller, with its drag on the disc at a speed."""
    disc = 0.25 * pi * d.screw.diameter_m**2 * d.screw.shafts * 0.5 * SEA[0] * speed**2
    one = np.array([speed])
    more = float((screw.drag_n(one, d.steady) - d.screw.drag_n(one, d.steady))[0])

    def apply(setting: Setting) -> None:
        setting.screw = screw

    return Hidden(name, 'hull', {'drag_coefficient': more / disc, **parameters}, apply)


def locked_propeller(d: Draw) -> Hidden:
    """The shaft is braked where it usually turns."""
    locked = replace(d.screw, drive='locked')
    return _stopped(d, 'locked_propeller', locked, 0.7 * d.hull.speed_m_s)


def windmilling_propeller(d: Draw) -> Hidden:
    """The engine stays clutched in; its friction stops the shaft below a speed."""
    stall = d.rng.uniform(0.3, 0.6) * d.hull.speed_m_s
    turns = np.linspace(0.05, 0.9, 40) * d.steady[0]
    viscous = d.rng.uniform(0.02, 0.06)
    spare = [-d.screw.loads(float(n), stall)[1] / d.steady[1] for n in turns]
    coulomb = max(s - viscous * n / d.steady[0] for s, n in zip(spare, turns, strict=True))
    braked = replace(d.screw, drive='direct', coulomb=max(coulomb, 0.01), viscous=viscous)
    speed = 0.5 * (stall + d.hull.speed_m_s)
    return _stopped(d, 'windmilling_propeller', braked, speed, stall_speed_m_s=stall)


def residual_thrust(d: Draw) -> Hidden:
    """The engine is not stopped but runs out."""
    left = float(np.clip(d.rng.uniform(0.12, 0.35) * d.size, 0.03, 0.7))
    left_s = d.hull.time_s * d.rng.uniform(0.2, 0.8)
    found = {'decay_s': left_s, 'fraction': left}
    return changed('residual_thrust', 'run', found, 'screw', left=left, left_s=left_s)


def _moving(
    name: str, field: str, velocity: tuple[float, float], parameters: dict[str, float]
) -> Hidden:
    """Return air or water that moves along the first run and to port of it."""

    def apply(setting: Setting) -> None:
        getattr(setting, field).append(setting.along_first(*velocity))

    return Hidden(name, 'earth', parameters, apply)


def wind(d: Draw) -> Hidden:
    """A breeze, more or less along the ship, with its gusts."""
    strength, angle = d.rng.uniform(3.0, 9.0) * d.size, d.rng.normal(0.0, 0.6)
    head, cross = d.sign * strength * np.cos(angle), strength * np.sin(angle)
    found = {'head_m_s': float(head), 'cross_m_s': float(cross)}
    return _moving('wind', 'wind', (-head, -cross), found)


def waves(d: Draw) -> Hidden:
    """Drift force of short waves, growing with the encounter, in groups."""
    force, side = d.first_n * d.rng.uniform(0.06, 0.25) * d.size, d.sign
    toward = 0.0 if side > 0.0 else pi

    def law(
        t: Array, heading: Array, period_s: float, rng: np.random.Generator | None
    ) -> tuple[Array, Array]:
        cosine = np.cos(heading - law.first - toward)  # type: ignore[attr-defined]
        slope = np.where(cosine > 0.0, 2.0, 0.8) * 2 * pi / period_s / GRAVITY
        group = np.ones(len(t))
        if rng is not None:
            group += band(rng, 0.35, 8 * period_s, 30 * period_s, 12).at(t)
        group = np.maximum(group, 0.0)
        return force * group * cosine, force * group * slope * cosine**2

    def apply(setting: Setting) -> None:
        law.first = setting.first_rad  # type: ignore[attr-defined]
        setting.waves.append(law)
        day = setting.weather
        setting.weather = replace(day, swell_m=2.0 * day.swell_m, swell_s=setting.period_s)

    return Hidden('waves', 'earth', {'force_n': force}, apply)


def current(d: Draw) -> Hidden:
    """A stream."""
    along = d.sign * d.rng.uniform(0.03, 0.1) * d.size * d.hull.speed_m_s
    port = d.rng.normal(0.0, 0.04) * d.hull.speed_m_s
    found = {'along_track_m_s': along, 'cross_track_m_s': port}
    return _moving('current', 'flow', (along, port), found)


def current_change(d: Draw) -> Hidden:
    """The stream changes along the way, as across the mouth of a river."""
    change = d.sign * d.rng.uniform(0.03, 0.08) * d.size * d.hull.speed_m_s

    def law(t: Array) -> Array:
        part = np.clip(t / d.coast_s, 0.0, 1.0)
        return change * (0.85 * part + 0.15 * part**2 * (3.0 - 2.0 * part))

    return hidden('current_change', 'earth', {'change_m_s': change}, shear=law)


def turning(d: Draw) -> Hidden:
    """Helm over and helm back: yaw and drift take way off."""
    start = d.rng.uniform(0.02, 0.25) * d.coast_s
    lasts = d.rng.uniform(0.15, 0.45) * d.coast_s
    area = d.area(d.rng.uniform(0.3, 1.0) * d.size)
    turned = np.radians(d.rng.uniform(1.0, 14.0)) * d.sign

    def grown(t: Array) -> Array:
        ramp = 0.15 * lasts
        up, down = (t - start) / ramp, (start + lasts - t) / ramp
        return np.clip(np.minimum(up, down), 0.0, 1.0)

    def drags(t: Array, u: Array) -> Array:
        return 0.5 * SEA[0] * area * u * np.abs(u) * grown(t)

    found = {'drag_area_m2': area, 'start_s': start, 'duration_s': lasts}
    helm = turned / (0.85 * lasts)
    return hidden('turning', 'run', found, timed=drags, helm=lambda t: helm * grown(t))


def added_mass(d: Draw) -> Hidden:
    """More water is carried along than the ship file says."""
    change = d.rng.uniform(0.06, 0.16) * d.size

    def apply(setting: Setting) -> None:
        setting.added *= 1.0 + change / d.hull.n_r

    return Hidden('added_mass', 'hull', {'n_r_change': change}, apply)


def displacement(d: Draw) -> Hidden:
    """Deeper or lighter than the ship file says; the wetted surface goes with it."""
    share = float(np.clip(d.sign * d.rng.uniform(0.06, 0.15) * d.size, -0.4, 0.6))

    def apply(setting: Setting) -> None:
        setting.mass *= 1.0 + share
        setting.still.append(lambda _, v, r: r * (1.0 + 0.35 * share))

    return Hidden('displacement', 'hull', {'fraction': share}, apply)


def log_scale(d: Draw) -> Hidden:
    """A paddle wheel or a Doppler log out of adjustment."""
    value = float(np.clip(d.sign * d.rng.uniform(0.03, 0.2) * d.size, -0.4, 0.6))
    return changed('log_scale', 'sensor', {'factor': value}, scale=value)


def log_offset(d: Draw) -> Hidden:
    """Zero of an electromagnetic log."""
    value = d.sign * d.rng.uniform(0.02, 0.06) * d.size * d.hull.speed_m_s
    return changed('log_offset', 'sensor', {'offset_m_s': value}, offset_m_s=value)


def log_lag(d: Draw) -> Hidden:
    """Damping set to many seconds."""
    value = d.rng.uniform(0.05, 0.15) * d.size * d.hull.time_s
    return changed('log_lag', 'sensor', {'lag_s': value}, lag_s=value)


def log_dead_band(d: Draw) -> Hidden:
    """A wheel that does not turn below a speed."""
    value = float(np.clip(d.rng.uniform(0.3, 0.5) * d.size, 0.2, 0.7)) * d.hull.speed_m_s
    return changed('log_dead_band', 'sensor', {'speed_m_s': value}, dead_m_s=value)


def radar_scale(d: Draw) -> Hidden:
    """Ranges too long or too short."""
    value = d.sign * d.rng.uniform(0.03, 0.08) * d.size
    return changed('radar_scale', 'sensor', {'factor': value}, radar_scale=value)


def time_offset(d: Draw) -> Hidden:
    """Clocks of log and radar apart."""
    value = d.sign * d.rng.uniform(0.03, 0.09) * d.size * d.hull.time_s
    return changed('time_offset', 'sensor', {'offset_s': value}, late_s=value)


FREE = ('declutched', 'electric')
_NEEDS = {
    locked_propeller: FREE,
    windmilling_propeller: ('declutched',),
    residual_thrust: FREE,
}
_MAKERS = (
    fouling, shallow_water, towed_cable, locked_propeller, windmilling_propeller,
    residual_thrust, wind, waves, current, log_scale, log_offset, radar_scale, turning, log_lag,
    log_dead_band, time_offset, current_change, added_mass, displacement,
)  # fmt: skip
LIBRARY: dict[str, tuple[Callable[[Draw], Hidden], tuple[str, ...]]] = {
    make.__name__: (make, _NEEDS.get(make, ())) for make in _MAKERS
}
"""Its maker by name, and the drives that it needs."""
SECOND = ('log_lag', 'log_dead_band', 'time_offset', 'current_change', 'added_mass',
          'displacement')  # fmt: skip
"""The rarer ones."""
