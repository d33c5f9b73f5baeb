# SPDX-License-Identifier: Apache-2.0
"""
Propellers and engines.

A propeller is one blade section at 0.7 of the radius, in all quadrants: flat-plate lift and
drag on the resultant flow. Engines hold torque, power or revs until the stop.

Drives after the stop, while the bridge control takes the torque off: `declutched` turns freely;
`direct` is braked by the engine's friction and stands below a speed; `electric` turns freely, with
more friction; `cpp` keeps most of its revs and sets the pitch to zero; `locked` is braked to a
stand; `folding` folds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from benchmarks.worlds.hidden_b.hulls import SEA, Array
from benchmarks.worlds.hidden_b.kernel import DRIVES, HOLDS, loads


@dataclass(frozen=True)
class Screw:
    """
    A propeller with its engine; of several shafts each the same.

    Attributes
    ----------
    pitch
        Ratio.
    blades
        Expanded area over that of the disc.
    wake, deduction
        Fractions.
    hold
        `torque`, `power` or `revs`.
    stopped
        Fraction of the revs that a controllable propeller keeps.
    inertia_s
        Time in which the steady torque would spin it up.
    coulomb, viscous
        Friction of the shaft, fractions of the steady torque.
    ramp_s
        Of the torque, the pitch or the brake after the stop.
    stagger_s
        By which the second shaft stops later.
    left, left_s
        Torque that stays after the stop, and its decay.
    """

    diameter_m: float
    pitch: float
    blades: float
    wake: float
    deduction: float
    shafts: int
    drive: str
    hold: str
    inertia_s: float
    coulomb: float
    viscous: float
    ramp_s: float
    stopped: float = 0.6
    stagger_s: float = 0.0
    left: float = 0.0
    left_s: float = 1.0

    @cached_property
    def numbers(self) -> Array:
        """What `kernel` needs."""
        return np.array([
            self.diameter_m, self.pitch, self.blades, self.wake, 0.5 * SEA[0], self.deduction,
            self.shafts, DRIVES.index(self.drive), HOLDS.index(self.hold), self.inertia_s,
            self.coulomb, self.viscous, self.ramp_s, self.stopped, self.stagger_s, self.left,
            self.left_s,
        ])  # fmt: skip

    def loads(self, revs: float, speed: float, pitch: float | None = None) -> tuple[float, float]:
        """
        Return thrust and torque of one propeller at revs [1/s] and ship speed.
        """
        return loads(self.numbers, revs, speed, self.pitch if pitch is None else pitch)

    def revs_for(self, thrust: float, speed: float) -> float:
        """
        Return the revs at which one propeller thrusts so.
        """
        low, high = 0.0, 60.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.loads(middle, speed)[0] < thrust else (low, middle)
        return 0.5 * (low + high)

    def settled(self, speed: float, steady: tuple[float, float]) -> tuple[float, float]:
        """
        Return revs and thrust (a drag) of one propeller long after the stop, slowing down.

        Parameters
        ----------
        speed
        steady
            Revs and torque before the stop.
        """
        revs, _ = steady
        if self.drive == 'folding':
            return 0.0, 0.0
        if self.drive == 'locked' or speed <= 0.0:
            return 0.0, self.loads(0.0, speed)[0]
        if self.drive == 'cpp':
            return self.stopped * revs, self.loads(self.stopped * revs, speed, 0.0)[0]
        tried = np.linspace(0.0, revs, 80)[::-1]
        last = None
        for n in tried:
            net = -self.loads(float(n), speed)[1] - self.friction(float(n), steady)
            if net >= 0.0:
                if last is not None:
                    n += (last[0] - n) * net / (net - last[1])
                return float(n), self.loads(float(n), speed)[0]
            last = (n, net)
        return 0.0, self.loads(0.0, speed)[0]

    def friction(self, revs: float, steady: tuple[float, float]) -> float:
        """
        Return the torque that friction takes.
        """
        return steady[1] * (self.coulomb + self.viscous * revs / steady[0])

    def drag_n(self, speeds: Array, steady: tuple[float, float]) -> Array:
        """
        Return the drag of all propellers long after the stop.
        """
        return np.array([-self.shafts * self.settled(float(v), steady)[1] for v in speeds])


def draw_screw(
    rng: np.random.Generator, drive: str, diameter_m: float, shafts: int, time_s: float
) -> Screw:
    """
    Draw a propeller and its engine for a ship that slows in `time_s`.
    """
    quick = float(np.clip(time_s / 300.0, 0.15, 1.0))
    braked, more = drive == 'direct', 2.5 if drive == 'electric' else 1.0
    return Screw(
        diameter_m=diameter_m,
        pitch=rng.uniform(0.75, 1.1),
        blades=rng.uniform(0.45, 0.75),
        wake=rng.uniform(0.02, 0.12) if shafts > 1 else rng.uniform(0.15, 0.32),
        deduction=rng.uniform(0.12, 0.2),
        shafts=shafts,
        drive=drive,
        hold='revs' if drive == 'cpp' else str(rng.choice(['torque', 'power', 'revs'])),
        inertia_s=rng.uniform(1.2, 4.0) * quick,
        coulomb=rng.uniform(0.06, 0.14) if braked else rng.uniform(0.003, 0.008) * more,
        viscous=rng.uniform(0.03, 0.08) if braked else rng.uniform(0.005, 0.02),
        ramp_s=rng.uniform(5.0, 30.0) * quick,
        stopped=rng.uniform(0.5, 0.75),
        stagger_s=rng.uniform(0.0, 12.0) * quick if shafts > 1 else 0.0,
    )
