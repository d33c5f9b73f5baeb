# SPDX-License-Identifier: Apache-2.0
"""
Which wrong value of a ship file looks like which effect.

What a diagnosis is to name may as well be a value that was stated wrong: it is
measured by how much of an effect such an error leaves unexplained.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.parameter import Prior, Shape
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action, Effect, Frame
from shipdrag_ros.simulation.effects import effects_of
from shipdrag_ros.studies.sensitivity.coast import Coast, Particular

WORST = 0.5  # relative error beyond which no value is thought to be wrong
_SPEED_STEP = 1e-3


@dataclass(frozen=True)
class Mimic:
    """
    The wrong value that looks most like an effect.

    Attributes
    ----------
    effect
    size
        Value of its first parameter.
    distance
        How far it moves the record, root mean square in standard deviations,
        beyond what an unknown speed and place at the start do.
    particular
    error
        Relative error of the value, within `WORST`, that comes nearest to it.
    left
        Part of the distance that this leaves: 0, no record separates the two.
    """

    effect: Effect
    size: float
    distance: float
    particular: Particular
    error: float
    left: float


def mimics(
    ship: Ship, coast: Coast, listed: Sequence[Particular], slopes: Float64
) -> tuple[Mimic, ...]:
    """
    Find the value that looks most like each effect that can act on a ship.

    Parameters
    ----------
    ship, coast
    listed
        The p values.
    slopes : (p, m)
        Change of the whole reading by each, per relative error.

    Returns
    -------
    tuple of Mimic
        The most alike first; without effects that the ship file states, or
        that move nothing in this coastdown.
    """
    stated = {effect.name for effect in ship.effects}
    effects = [
        e for e in effects_of(ship).values() if not e.missing(ship) and e.name not in stated
    ]
    frame = Frame(ship, coast.scenario, coast.scenario.heading_rad)
    sizes = [_usual_values(effect, ship) for effect in effects]
    actions = [effect.action(frame, *size) for effect, size in zip(effects, sizes)]
    moved = coast.read(ship, [Action(), *actions])
    free = _Free.of(ship, coast, moved[0])
    values = free.without(slopes)
    found = []
    for effect, size, trace in zip(effects, sizes, free.without(_flat(moved[1:] - moved[0]))):
        distance = float(np.linalg.norm(trace))
        if not (math.isfinite(distance) and distance > 1e-6 * math.sqrt(len(trace))):
            continue
        best = _nearest(trace, listed, values)
        if best is not None:
            one, error, left = best
            rms = distance / math.sqrt(len(coast.time_s))
            found.append(Mimic(effect, size[0], rms, one, error, left))
    return tuple(sorted(found, key=lambda mimic: mimic.left))


def _nearest(
    trace: Float64, listed: Sequence[Particular], values: Float64
) -> tuple[Particular, float, float] | None:
    """Return a value, its error, and the part of the trace that this leaves."""
    best = None
    for one, value in zip(listed, values):
        square = float(value @ value)
        if not (math.isfinite(square) and square > 0.0):
            continue
        error = min(max(float(trace @ value) / square, -WORST), WORST)
        left = float(np.linalg.norm(trace - error * value) / np.linalg.norm(trace))
        if best is None or left < best[2]:
            best = one, error, left
    return best


@dataclass(frozen=True)
class _Free:
    """What is never known beforehand: speed and place at the start."""

    axes: Float64

    @classmethod
    def of(cls, ship: Ship, coast: Coast, reading: Float64) -> _Free:
        speed = coast.scenario.speed_m_s * (1.0 - _SPEED_STEP)
        slower = coast.read(ship, [Action()], speed_m_s=speed)[0]
        rows = np.zeros((3, *reading.shape))
        rows[0] = slower - reading
        rows[1, :, 1] = rows[2, :, 2] = 1.0
        return cls(np.asarray(np.linalg.qr(_flat(rows).T)[0], np.float64))

    def without(self, traces: Float64) -> Float64:
        """Return what of traces (k, m) is not of this kind."""
        return traces - (traces @ self.axes) @ self.axes.T


def _flat(readings: Float64) -> Float64:
    return readings.reshape(len(readings), -1)


def _usual_values(effect: Effect, ship: Ship) -> tuple[float, ...]:
    """Return a usual size of an effect."""
    quantities = effect.parameters_of(ship)
    usual = [_usual(quantity.prior) for quantity in quantities]
    return (
        usual[0],
        *(q.value if q.is_given else one for q, one in zip(quantities[1:], usual[1:])),
    )


def _usual(prior: Prior) -> float:
    match prior.shape:
        case Shape.NORMAL:
            return prior.first or prior.second
        case Shape.HALF_NORMAL:
            return prior.second
        case Shape.UNIFORM:
            return 0.5 * (prior.first + prior.second)
        case _:
            return prior.first
