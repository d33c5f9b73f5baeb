# SPDX-License-Identifier: Apache-2.0
"""What can be hidden: the ways in which an effect acts on ship and sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass
from typing import ClassVar

import numpy as np

from benchmarks.worlds.hidden.hull import Array, Hull


@dataclass(frozen=True)
class Leg:
    """
    One run as an effect sees it.

    Attributes
    ----------
    hull
    sign
        +1 on the heading of the first run, -1 on the reciprocal.
    duration_s
        From the stop to the end of the record.
    speed_m_s
        Through the water, at the stop.
    """

    hull: Hull
    sign: float
    duration_s: float
    speed_m_s: float

    @property
    def resistance_n(self) -> float:
        """At the stop, as stated."""
        return float(self.hull.still_n(np.array([self.speed_m_s]))[0])

    @property
    def pressure_pa(self) -> float:
        """Dynamic, at the stop."""
        return 0.5 * self.hull.density_kg_m3 * self.speed_m_s**2

    @property
    def drag_area_m2(self) -> float:
        """Of the hull at the stop."""
        return self.resistance_n / self.pressure_pa


@dataclass(frozen=True)
class Size:
    """
    From which a parameter is drawn: evenly in its logarithm.

    Attributes
    ----------
    name
        Of the parameter.
    low, high
    signed
        Either sign is as likely.
    unit
        What they are in parts of, on the first run.
    """

    name: str
    low: float
    high: float
    signed: bool = False
    unit: Callable[[Leg], float] = lambda _: 1.0

    def draw(self, rng: np.random.Generator) -> float:
        """
        Draw a value.
        """
        value = float(np.exp(rng.uniform(np.log(self.low), np.log(self.high))))
        return value if not self.signed or rng.random() < 0.5 else -value


@dataclass(frozen=True)
class Effect:
    """
    Nothing; an effect overrides the ways in which it acts.

    Attributes
    ----------
    name
        As a diagnosis has to name it; of one outside its library, for the table.
    sizes
        In the order of the arguments.
    single_run
        It is there in the first run only.
    """

    name: ClassVar[str]
    sizes: ClassVar[tuple[Size, ...]]
    single_run: ClassVar[bool] = False

    @classmethod
    def draw(cls, leg: Leg, rng: np.random.Generator) -> Effect:
        """
        Draw an effect for a ship.
        """
        return cls.of(leg, [size.draw(rng) for size in cls.sizes])

    @classmethod
    def of(cls, leg: Leg, sizes: Sequence[float]) -> Effect:
        """
        Build the effect from sizes in their units.
        """
        return cls(*(size * each.unit(leg) for size, each in zip(sizes, cls.sizes)))

    def parameters(self) -> dict[str, float]:
        """
        Return what a diagnosis should find.
        """
        return {size.name: float(value) for size, value in zip(self.sizes, astuple(self))}

    def drag_n(self, leg: Leg, speed: Array) -> Array | float:
        """
        Return resistance [N] at speeds through the water, sailing and coasting.
        """
        return 0.0

    def coasting_drag_n(self, leg: Leg, speed: Array) -> Array | float:
        """
        Return resistance [N] that is there from the stop on.
        """
        return 0.0

    def force_n(self, leg: Leg, time: Array) -> Array | float:
        """
        Return a driving force [N] at times after the stop.
        """
        return 0.0

    def thrust(self, leg: Leg, time: Array) -> Array | float:
        """
        Return thrust after the stop that should not be there, over the steady one.
        """
        return 0.0

    def drag_area_m2(self, leg: Leg, time: Array) -> Array | float:
        """
        Return A of a further drag 0.5 rho A u^2.
        """
        return 0.0

    def swing_rad(self, leg: Leg, time: Array) -> Array | float:
        """
        Return the change of heading.
        """
        return 0.0

    def water_m_s(self, leg: Leg, time: Array) -> tuple[Array | float, Array | float]:
        """
        Return the water's velocity along the first heading and to port of it.
        """
        return 0.0, 0.0

    def wind_m_s(self) -> tuple[float, float]:
        """
        Return the true wind, from ahead of the first run and from port.
        """
        return 0.0, 0.0

    def depth_m(self) -> float | None:
        """
        Return the depth of the water; None: deep.
        """
        return None

    def shaft(self, leg: Leg, time: Array, speed: Array, free: Array) -> Array:
        """
        Return the shaft speed that a free-wheeling or driven propeller has now.

        Parameters
        ----------
        free : (n,)
            What it would be without the effect [rad/s].
        """
        return free

    def inertia(self, hull: Hull) -> tuple[float, float]:
        """
        Return what is added to n_r, and the mass over the stated one.
        """
        return 0.0, 1.0

    def log(self, leg: Leg, time: Array, speed: Array) -> Array:
        """
        Return what the log shows of speeds at ascending times.
        """
        return speed

    def radar(self, leg: Leg, time: Array, position: Array) -> Array:
        """
        Return what the radar shows of positions (n, 2) from the fixed mark.
        """
        return position

    def log_delay_s(self) -> float:
        """
        Return how much too late the log's stamps are.
        """
        return 0.0


class FirstShelf(Effect):
    """One that a diagnosis is expected to know."""


class SecondShelf(Effect):
    """A rarer one of these."""
