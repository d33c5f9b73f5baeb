# SPDX-License-Identifier: Apache-2.0
"""Effects that no library names: a diagnosis has to say that it does not know."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.hidden.effect import Effect, Leg, Size
from benchmarks.worlds.hidden.hull import Array
from benchmarks.worlds.hidden.sailing import LEAD_IN_S


def _ramp(time: Array, start: float, length: float) -> Array:
    """Rise from 0 to 1."""
    return np.clip((time - start) / length, 0.0, 1.0)


@dataclass(frozen=True)
class _OfResistance(Effect):
    """Sized by the resistance at the stop; times are parts of the coastdown."""

    size: float
    moment: float


@dataclass(frozen=True)
class CreepingThrust(_OfResistance):
    """The clutch drags more and more: thrust that grows."""

    name = 'creeping thrust'
    sizes = (Size('size', 0.12, 0.3), Size('moment', 0.3, 0.55))

    def force_n(self, leg: Leg, time: Array) -> Array:
        start = self.moment * leg.duration_s
        return self.size * leg.resistance_n * _ramp(time, start, leg.duration_s - start)


@dataclass(frozen=True)
class DragStep(_OfResistance):
    """Ventilation: a drag that is there only above a speed."""

    name = 'drag step at a speed'
    sizes = (Size('size', 0.4, 1.0), Size('moment', 0.55, 0.75))

    def drag_n(self, leg: Leg, speed: Array) -> Array:
        hull = leg.hull
        over = speed / hull.speed_m_s - self.moment
        return self.size * hull.still_n(speed) / (1.0 + np.exp(-over / 0.01))


@dataclass(frozen=True)
class WeedTornOff(_OfResistance):
    """Weed or a net that comes off in the middle of the run."""

    name = 'weed torn off'
    sizes = (Size('size', 0.4, 1.0), Size('moment', 0.15, 0.35))

    def drag_area_m2(self, leg: Leg, time: Array) -> Array:
        area = self.size * leg.resistance_n / leg.pressure_pa
        return area * (1.0 - _ramp(time, self.moment * leg.duration_s, 5.0))


@dataclass(frozen=True)
class IceField(_OfResistance):
    """A belt of brash ice: a force that hardly depends on the speed."""

    name = 'ice field'
    sizes = (Size('size', 0.15, 0.3), Size('moment', 0.15, 0.4))

    def force_n(self, leg: Leg, time: Array) -> Array:
        start, length = self.moment * leg.duration_s, 0.3 * leg.duration_s
        inside = _ramp(time, start, 30.0) - _ramp(time, start + length, 30.0)
        return -self.size * leg.resistance_n * inside


@dataclass(frozen=True)
class TugLine(_OfResistance):
    """A tug that heaves and slacks away."""

    name = 'tug line'
    sizes = (Size('size', 0.25, 0.6), Size('moment', 0.25, 0.4))

    def force_n(self, leg: Leg, time: Array) -> Array:
        turns = np.maximum(time, 0.0) / (self.moment * leg.duration_s)
        return self.size * leg.resistance_n * np.sin(2.0 * np.pi * turns)


@dataclass(frozen=True)
class Snaking(_OfResistance):
    """Lost course stability: growing swings of the heading, and their drag."""

    name = 'snaking'
    sizes = (Size('size', 1.0, 3.0), Size('moment', 0.08, 0.15))

    def swing_rad(self, leg: Leg, time: Array) -> Array:
        turns = np.maximum(time, 0.0) / (self.moment * leg.duration_s)
        return 0.2 * _ramp(time, 0.0, leg.duration_s) * np.sin(2.0 * np.pi * turns)

    def drag_area_m2(self, leg: Leg, time: Array) -> Array:
        growth = _ramp(time, 0.0, leg.duration_s) ** 2
        return self.size * leg.resistance_n / leg.pressure_pa * growth


@dataclass(frozen=True)
class DraggingAnchor(_OfResistance):
    """An anchor that touches the bottom and is dragged along."""

    name = 'dragging anchor'
    sizes = (Size('size', 0.1, 0.2), Size('moment', 0.2, 0.4))

    def force_n(self, leg: Leg, time: Array) -> Array:
        return -self.size * leg.resistance_n * _ramp(time, self.moment * leg.duration_s, 10.0)


@dataclass(frozen=True)
class StickingLog(_OfResistance):
    """A paddle wheel that sticks and comes free: the reading stands, then jumps."""

    name = 'sticking log'
    sizes = (Size('size', 50.0, 100.0), Size('moment', 0.5, 0.9))

    def log(self, leg: Leg, time: Array, speed: Array) -> Array:
        period = 1.5 * self.size
        phase = np.mod(time, period)
        last = np.searchsorted(time, time - np.where(phase < self.size, phase, 0.0))
        return np.where(time > 0.0, speed[np.minimum(last, len(time) - 1)], speed)


@dataclass(frozen=True)
class BentLog(_OfResistance):
    """A log whose error swings over the speeds."""

    name = 'bent log'
    sizes = (Size('size', 0.05, 0.12), Size('moment', 0.5, 0.7))

    def log(self, leg: Leg, time: Array, speed: Array) -> Array:
        part = speed / leg.hull.speed_m_s
        return speed * (1.0 + self.size * np.sin(2.0 * np.pi * part / self.moment))


@dataclass(frozen=True)
class CloggedLog(_OfResistance):
    """A jellyfish on the log: from a moment on it shows less."""

    name = 'clogged log'
    sizes = (Size('size', 0.08, 0.25), Size('moment', 0.2, 0.6))

    def log(self, leg: Leg, time: Array, speed: Array) -> Array:
        return speed * (1.0 - self.size * _ramp(time, self.moment * leg.duration_s, 5.0))


@dataclass(frozen=True)
class BentRadar(_OfResistance):
    """A radar whose range is wrong by a share that grows with the range."""

    name = 'bent radar'
    sizes = (Size('size', 0.01, 0.025), Size('moment', 0.3, 0.5))

    def radar(self, leg: Leg, time: Array, position: Array) -> Array:
        reach = self.moment * leg.speed_m_s * (LEAD_IN_S + leg.duration_s)
        distance = np.hypot(position[:, 0], position[:, 1])[:, None]
        return position * (1.0 + self.size * np.sin(np.pi * distance / reach))


@dataclass(frozen=True)
class OtherMark(_OfResistance):
    """A radar that takes another mark for the fixed one while the ship coasts."""

    name = 'other radar mark'
    sizes = (Size('size', 80.0, 400.0), Size('moment', 0.15, 0.7))

    def radar(self, leg: Leg, time: Array, position: Array) -> Array:
        jumped = time > self.moment * leg.duration_s
        away = position / np.hypot(position[:, 0], position[:, 1])[:, None]
        return position + self.size * jumped[:, None] * away


OUTSIDE = tuple(_OfResistance.__subclasses__())
