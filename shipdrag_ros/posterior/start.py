# SPDX-License-Identifier: Apache-2.0
"""
Where the search begins: the motion along the speeds that were measured is linear in r.

    u(t) = u_0 - integral of (r(v) - r(u_0) T) / (1 + n_r(v)),  v a rough speed from the readings

So no hull is too far from the prior's for the first step.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.inference.rows import LOG, POSITION
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.problem import RunModel
from shipdrag_ros.samples import Float64

_POINTS = 400  # of the time after the stop


def along_readings(problem: RunModel, seen: Float64) -> tuple[Float64, Float64]:
    """
    Return rows with their derivatives, as `motion.predict` does.

    Parameters
    ----------
    problem
    seen : (2, b)
        Times and speeds, roughly.

    Returns
    -------
    table : (1 + p, n)
        Measured less what `problem.start` says without any r, then the derivatives by what has
        to do with the motion; 0 by all others.
    speed : (n,)
        Through water, roughly.
    """
    rows, k, start = problem.rows, problem.coefficients, problem.start
    time_s = np.linspace(0.0, max(float(rows.time_s[-1]), 1e-9), _POINTS)
    speed = np.maximum(np.interp(time_s, *seen), 0.0)
    known, columns = (value[0] for value in motion.shapes_at(problem.forces, speed))
    at_first = motion.shapes_at(problem.forces, speed[:1])[1][0]
    inertia = motion.damping_of(problem.forces, start[:k], speed)[1]
    thrust = _thrust(problem, time_s, speed)
    # `known` is that of theta = 0, whose part of the thrust is small for a start
    force = np.vstack([known - known[0] * thrust, columns - at_first * thrust]) / inertia
    lost = _integral(force, time_s)
    way = _integral(lost, time_s)
    place, after = rows.of(POSITION), np.maximum(rows.time_s, 0.0)
    of_force = np.array(
        [
            np.where(place, np.interp(after, time_s, x), np.interp(after, time_s, v))
            for v, x in zip(lost, way)
        ]
    )
    table = np.zeros((1 + len(start), len(after)))
    table[1 : 1 + k] = -of_force[1:]
    of_speed = np.where(place, rows.time_s, 1.0)
    table[1 + k + motion.SPEED] = of_speed
    table[1 + k + motion.CURRENT] = np.where(place, rows.time_s, ~rows.of(LOG))
    first = start[k + motion.SPEED] * of_speed
    for code in np.unique(rows.kind[place]):
        at, own = k + motion.own(code) + motion.PLACE, rows.kind == code
        table[1 + at] = own
        first += start[at] * own
    table[0] = rows.value - first + of_force[0] + start[:k] @ of_force[1:]
    return table, np.interp(after, time_s, speed)


def _thrust(problem: RunModel, time_s: Float64, speed: Float64) -> Float64:
    """Return T under the usual law."""
    if problem.forces.tau_s == 0.0:
        return np.zeros(len(time_s))
    q = problem.start[problem.coefficients + motion.THRUST]
    nu = np.exp(-time_s / problem.forces.tau_s)
    result: Float64 = (1.0 + q) * nu**2 - q * nu * speed / max(speed[0], 1e-9)
    return result


def _integral(value: Float64, time_s: Float64) -> Float64:
    """Return integrals (c, m) from the first time on, by trapezoids."""
    parts = 0.5 * (value[:, 1:] + value[:, :-1]) * np.diff(time_s)
    return np.hstack([np.zeros((len(value), 1)), np.cumsum(parts, axis=1)])
