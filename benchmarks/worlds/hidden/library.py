# SPDX-License-Identifier: Apache-2.0
"""The effects that a diagnosis is expected to know, by formulas of our own."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from benchmarks.worlds.hidden.effect import FirstShelf, Leg, SecondShelf, Size
from benchmarks.worlds.hidden.hull import GRAVITY, Array, Hull

# four-quadrant propeller: axial drag on the disc at the speed of the ship, wake included
_LOCKED = 0.40
# zero thrust before zero torque: a free-wheeling propeller drags a little
_ADVANCE_RATIO = 0.65
_PITCH_LEFT = 0.3  # shaft speed, over that under power, that full thrust would add
_SMOOTH = 0.15  # of a turn, in which its drag grows and falls
_WAVE_LENGTH = 0.6  # over that of the ship
# what sizes are in parts of
_RESISTANCE, _AREA = attrgetter('resistance_n'), attrgetter('drag_area_m2')
_SPEED, _DURATION = attrgetter('speed_m_s'), attrgetter('duration_s')


@dataclass(frozen=True)
class Current(FirstShelf):
    """Water that moves as a whole."""

    along_track_m_s: float
    cross_track_m_s: float
    name = 'current'
    sizes = (
        Size('along_track_m_s', 0.15, 0.8, signed=True),
        Size('cross_track_m_s', 0.02, 0.4, signed=True),
    )

    def water_m_s(self, leg: Leg, time: Array) -> tuple[Array | float, Array | float]:
        return self.along_track_m_s, self.cross_track_m_s


@dataclass(frozen=True)
class Wind(FirstShelf):
    """Moving air; the ship file's drag is of still air."""

    head_m_s: float
    cross_m_s: float
    name = 'wind'
    sizes = (Size('head_m_s', 4.0, 13.0, signed=True), Size('cross_m_s', 0.5, 6.0, signed=True))

    def wind_m_s(self) -> tuple[float, float]:
        return self.head_m_s, self.cross_m_s

    def drag_n(self, leg: Leg, speed: Array) -> Array:
        hull = leg.hull
        ahead = speed + leg.sign * self.head_m_s
        strength = np.hypot(ahead, self.cross_m_s)
        # a cosine with a third harmonic, as in wind tunnels
        cosine = ahead / np.maximum(strength, 1e-9)
        curve = cosine + 0.05 * (4.0 * cosine**3 - 4.0 * cosine)
        area = hull.frontal_m2 * hull.air_coefficient
        return 0.5 * 1.225 * area * curve * strength**2 - hull.air_n(speed)


@dataclass(frozen=True)
class Waves(FirstShelf):
    """
    Short waves that the hull throws back.

    Notes
    -----
    Faltinsen et al. (1980): F ~ a^2 (1 + 2 w U / g) from ahead. From astern the
    sign of U turns; a ship that outruns them feels nothing.
    """

    force: float
    name = 'waves'
    sizes = (Size('force_n', 0.05, 0.25, signed=True, unit=_RESISTANCE),)  # + from ahead

    def parameters(self) -> dict[str, float]:
        return {'force_n': abs(self.force)}

    def drag_n(self, leg: Leg, speed: Array) -> Array:
        meets = leg.sign * np.sign(self.force)
        omega = np.sqrt(2.0 * np.pi * GRAVITY / (_WAVE_LENGTH * leg.hull.length_m))
        growth = 1.0 + meets * 2.0 * omega * speed / GRAVITY
        return meets * abs(self.force) * np.maximum(growth, 0.0)


@dataclass(frozen=True)
class ShallowWater(FirstShelf):
    """
    Bottom near the keel.

    Notes
    -----
    Form factor after Millward (1989), k + 0.644 (T/h)^1.72; waves as at
    Schlichting's intermediate speed; added mass grows.
    """

    depth: float
    name = 'shallow_water'
    sizes = (Size('depth_m', 1.3, 2.6, unit=attrgetter('hull.draught_m')),)

    def depth_m(self) -> float:
        return self.depth

    def drag_n(self, leg: Leg, speed: Array) -> Array:
        hull = leg.hull
        line = 0.075 / (np.log10(hull.reynolds(speed)) - 2.0) ** 2
        viscous = 0.644 * (hull.draught_m / self.depth) ** 1.72 * line * hull.pressure(speed)
        moving = np.maximum(speed, 0.01)
        shoal = np.sqrt(np.tanh(GRAVITY * self.depth / moving**2))
        wave = hull.wave_n(moving / shoal) * shoal**2 - hull.wave_n(moving)
        return viscous + wave

    def inertia(self, hull: Hull) -> tuple[float, float]:
        return 0.02 * (hull.draught_m / self.depth) ** 2, 1.0


@dataclass(frozen=True)
class Fouling(FirstShelf):
    """A rough hull: friction grows in proportion to Schoenherr's line."""

    friction_factor: float
    name = 'fouling'
    sizes = (Size('friction_factor', 0.12, 0.7),)

    def drag_n(self, leg: Leg, speed: Array) -> Array:
        hull = leg.hull
        reynolds = hull.reynolds(speed)
        line = np.full_like(speed, 2e-3)
        for _ in range(8):
            line = (0.242 / np.log10(reynolds * line)) ** 2
        return self.friction_factor * (1.0 + hull.form_factor) * line * hull.pressure(speed)


def _on_disc(leg: Leg, speed: Array) -> Array:
    hull = leg.hull
    return 0.5 * hull.density_kg_m3 * hull.disc_m2 * speed**2


@dataclass(frozen=True)
class LockedPropeller(FirstShelf):
    """A propeller that does not turn after the stop."""

    drag_coefficient: float
    name = 'locked_propeller'
    sizes = (Size('drag_coefficient', 0.2, 0.8),)

    def coasting_drag_n(self, leg: Leg, speed: Array) -> Array:
        return self.drag_coefficient * _on_disc(leg, speed)

    def shaft(self, leg: Leg, time: Array, speed: Array, free: Array) -> Array:
        return free * np.exp(-np.maximum(time, 0.0) / 4.0)


@dataclass(frozen=True)
class WindmillingPropeller(FirstShelf):
    """
    A propeller that the water turns against the friction of its shaft.

    Notes
    -----
    Linear K_T and K_Q: the rate of turn solves a quadratic, which has no root
    below the stall speed; there the propeller stands.
    """

    drag_coefficient: float
    stall_speed_m_s: float
    name = 'windmilling_propeller'
    sizes = (
        Size('drag_coefficient', 0.1, 0.25),
        Size('stall_speed_m_s', 0.4, 0.65, unit=_SPEED),
    )

    def _rate(self, speed: Array) -> Array:
        """Rate of turn over that without friction; 0 where it stands."""
        ratio = np.minimum(self.stall_speed_m_s / np.maximum(speed, 1e-6), 1.0)
        turning = 0.5 * (1.0 + np.sqrt(1.0 - ratio**2))
        return np.where(speed > self.stall_speed_m_s, turning, 0.0)

    def coasting_drag_n(self, leg: Leg, speed: Array) -> Array:
        rate = self._rate(speed)
        free = (rate - _ADVANCE_RATIO * rate**2) / (1.0 - _ADVANCE_RATIO)
        at_stall = (0.5 - 0.25 * _ADVANCE_RATIO) / (1.0 - _ADVANCE_RATIO)
        standing = max(_LOCKED, at_stall * self.drag_coefficient)
        coefficient = np.where(rate > 0.0, self.drag_coefficient * free, standing)
        return coefficient * _on_disc(leg, speed)

    def shaft(self, leg: Leg, time: Array, speed: Array, free: Array) -> Array:
        held = 1.0 - np.exp(-np.maximum(time, 0.0) / 8.0)
        return free * (1.0 - held * (1.0 - self._rate(speed)))


@dataclass(frozen=True)
class TowedCable(FirstShelf):
    """A cable or line along the flow, from the lead-in on."""

    area: float
    name = 'towed_cable'
    sizes = (Size('drag_area_m2', 0.12, 0.6, unit=_AREA),)

    def drag_n(self, leg: Leg, speed: Array) -> Array:
        return 0.5 * leg.hull.density_kg_m3 * self.area * speed**2


@dataclass(frozen=True)
class Turning(FirstShelf):
    """The hull turns on to another course, with rudder; it drags more meanwhile."""

    drag_area: float
    start_s: float
    duration_s: float
    turn: float
    name = 'turning'
    single_run = True
    sizes = (
        Size('drag_area_m2', 0.4, 1.5, unit=_AREA),
        Size('start_s', 0.06, 0.5, unit=_DURATION),
        Size('duration_s', 0.08, 0.25, unit=_DURATION),
        Size('turn_rad', 0.05, 0.2, signed=True),
    )

    def parameters(self) -> dict[str, float]:
        return {
            'drag_area_m2': self.drag_area,
            'start_s': self.start_s,
            'duration_s': self.duration_s,
        }

    def _part(self, time: Array) -> Array:
        return (time - self.start_s) / self.duration_s

    def drag_area_m2(self, leg: Leg, time: Array) -> Array:
        part = self._part(time) / _SMOOTH
        grown = np.clip(part + 0.5, 0.0, 1.0) * np.clip(1.0 / _SMOOTH - part + 0.5, 0.0, 1.0)
        return self.drag_area * grown

    def swing_rad(self, leg: Leg, time: Array) -> Array:
        part = np.clip(self._part(time), 0.0, 1.0)
        return self.turn * (part - np.sin(2.0 * np.pi * part) / (2.0 * np.pi))


@dataclass(frozen=True)
class ResidualThrust(FirstShelf):
    """
    The propeller still pushes, less and less: a pitch that was not taken back.

    The shaft is free, and turns a little faster than without thrust.
    """

    decay_s: float
    fraction: float
    name = 'residual_thrust'
    single_run = True
    sizes = (Size('decay_s', 60.0, 400.0), Size('fraction', 0.15, 0.45))

    def thrust(self, leg: Leg, time: Array) -> Array:
        after = np.maximum(time, 0.0)
        nominal = np.exp(-after / leg.hull.run_down_s)
        return self.fraction * (np.exp(-after / self.decay_s) - nominal)

    def shaft(self, leg: Leg, time: Array, speed: Array, free: Array) -> Array:
        pushed = np.maximum(self.thrust(leg, time), 0.0) * leg.hull.shaft_rad_s
        return free + np.where(time > 0.0, _PITCH_LEFT * pushed, 0.0)


@dataclass(frozen=True)
class LogScale(FirstShelf):
    """A log that shows a fraction more."""

    factor: float
    name = 'log_scale'
    sizes = (Size('factor', 0.02, 0.12, signed=True),)

    def log(self, leg: Leg, time: Array, speed: Array) -> Array:
        return (1.0 + self.factor) * speed


@dataclass(frozen=True)
class RadarScale(FirstShelf):
    """A radar that shows distances a fraction larger."""

    factor: float
    name = 'radar_scale'
    sizes = (Size('factor', 0.02, 0.10, signed=True),)

    def radar(self, leg: Leg, time: Array, position: Array) -> Array:
        return (1.0 + self.factor) * position


@dataclass(frozen=True)
class LogOffset(FirstShelf):
    """A log that shows a speed more."""

    offset_m_s: float
    name = 'log_offset'
    sizes = (Size('offset_m_s', 0.1, 0.5, signed=True),)

    def log(self, leg: Leg, time: Array, speed: Array) -> Array:
        return speed + self.offset_m_s


@dataclass(frozen=True)
class LogLag(SecondShelf):
    """A log that is smoothed by its own filter."""

    lag_s: float
    name = 'log_lag'
    sizes = (Size('lag_s', 12.0, 60.0),)

    def log(self, leg: Leg, time: Array, speed: Array) -> Array:
        shown = speed.copy()
        keep = np.exp(-np.diff(time) / self.lag_s)
        for i in range(1, len(speed)):
            shown[i] = speed[i] + keep[i - 1] * (shown[i - 1] - speed[i])
        return shown


@dataclass(frozen=True)
class LogDeadBand(SecondShelf):
    """A paddle wheel that slows down early and stands at a third of the threshold."""

    speed_m_s: float
    name = 'log_dead_band'
    sizes = (Size('speed_m_s', 0.35, 0.6, unit=_SPEED),)

    def log(self, leg: Leg, time: Array, speed: Array) -> Array:
        slowed = np.maximum(1.5 * speed - 0.5 * self.speed_m_s, 0.0)
        return np.where(speed < self.speed_m_s, slowed, speed)


@dataclass(frozen=True)
class TimeOffset(SecondShelf):
    """The clocks of log and radar differ."""

    offset_s: float
    name = 'time_offset'
    sizes = (Size('offset_s', 8.0, 60.0, signed=True),)

    def log_delay_s(self) -> float:
        return self.offset_s


@dataclass(frozen=True)
class CurrentChange(SecondShelf):
    """A tide that turns while the ship coasts."""

    change_m_s: float
    name = 'current_change'
    sizes = (Size('change_m_s', 0.2, 0.8, signed=True),)

    def water_m_s(self, leg: Leg, time: Array) -> tuple[Array | float, Array | float]:
        part = np.clip(time / leg.duration_s, 0.0, 1.0)
        return self.change_m_s * part, 0.0


@dataclass(frozen=True)
class AddedMass(SecondShelf):
    """More water is moved along than stated."""

    n_r_change: float
    name = 'added_mass'
    sizes = (Size('n_r_change', 0.08, 0.25),)

    def inertia(self, hull: Hull) -> tuple[float, float]:
        return self.n_r_change, 1.0


@dataclass(frozen=True)
class Displacement(SecondShelf):
    """A ship that is heavier than stated, at nearly the same wetted surface."""

    fraction: float
    name = 'displacement'
    sizes = (Size('fraction', 0.08, 0.25),)

    def inertia(self, hull: Hull) -> tuple[float, float]:
        return 0.0, 1.0 + self.fraction


FIRST_SHELF, SECOND_SHELF = (tuple(each.__subclasses__()) for each in (FirstShelf, SecondShelf))
