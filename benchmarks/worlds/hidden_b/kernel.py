# SPDX-License-Identifier: Apache-2.0
"""
What is compiled: loads of a propeller, the shafts and the ship, step by step.

All that it needs of other modules is handed over: it may outlive them.
"""

from __future__ import annotations

from math import ceil, exp, pi

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
DRIVES = ('declutched', 'direct', 'electric', 'cpp', 'locked', 'folding')
HOLDS = ('torque', 'power', 'revs')
LIFT, DRAG, SKIN = 3.2, 1.15, 0.013
BRAKE = 0.8  # largest drag on the disc, by momentum theory


@njit(cache=True, error_model='numpy')
def air(ahead: float, port: float, still: float) -> float:
    """
    Return the force of the relative wind along the ship, ahead positive.

    Longitudinal coefficient of a boxy ship: cos(a) with a third harmonic, as in Isherwood's data.

    Parameters
    ----------
    ahead, port
    still
        Drag of still air over the speed squared.
    """
    square = ahead * ahead + port * port
    if square < 1e-12:
        return 0.0
    c = ahead / square**0.5
    return still * square * (c - 0.12 * (4.0 * c**3 - 3.0 * c - c))


@njit(cache=True, error_model='numpy')
def loads(screw: Array, revs: float, speed: float, pitch: float) -> tuple[float, float]:
    """
    Return thrust and torque of one propeller; see `Screw.numbers`.
    """
    diameter, _, blades, wake, half_density = screw[:5]
    advance = (1.0 - wake) * speed
    turn = 0.7 * pi * revs * diameter
    flow = np.hypot(advance, turn)
    if flow < 1e-9:
        return 0.0, 0.0
    angle = np.arctan2(advance, turn)
    attack = np.arctan2(pitch, 0.7 * pi) - angle
    lift = LIFT * np.sin(attack) * np.cos(attack)
    drag = SKIN + DRAG * np.sin(attack) ** 2
    disc = 0.25 * pi * diameter**2
    dynamic = half_density * blades * disc * flow**2
    thrust = dynamic * (lift * np.cos(angle) - drag * np.sin(angle))
    torque = dynamic * 0.35 * diameter * (lift * np.sin(angle) + drag * np.cos(angle))
    if thrust < 0.0:
        largest = BRAKE * (0.3 if screw[7] == 3.0 else 1.0) * half_density * disc
        largest *= advance**2 + 1e-9
        thrust = -largest * np.tanh(-thrust / largest)
    return thrust, torque


@njit(cache=True, error_model='numpy')
def _turned(screw: Array, revs: float, since: float, u: float, dt: float, steady: Array) -> float:
    """Return the revs a step later; `since` the stop of this shaft."""
    drive, hold, inertia_s, coulomb, viscous, ramp_s, stopped, _, left, left_s = screw[7:]
    if drive == 3.0:
        return steady[0] * (1.0 - min(max(since / ramp_s, 0.0), 1.0) * (1.0 - stopped))
    if drive >= 4.0 and since >= 0.0:
        return max(0.0, steady[0] * (1.0 - since / ramp_s))
    if since < 0.0 and hold == 2.0:
        return steady[0]
    inertia = inertia_s * steady[1] / max(steady[0], 1e-9)
    parts = ceil(12.0 * dt / inertia_s)
    for _ in range(parts):
        load = loads(screw, revs, u, screw[1])[1]
        engine = steady[1]
        if since >= 0.0:
            engine *= max(left * exp(-since / left_s), 1.0 - since / ramp_s)
            load += steady[1] * (coulomb + viscous * revs / steady[0])
        elif hold == 1.0:
            engine *= steady[0] / max(revs, 0.3 * steady[0])
        revs += (engine - load) / inertia * dt / parts
        if revs <= 0.0:
            return 0.0
    return revs


@njit(cache=True, error_model='numpy')
def _still(table: Array, spacing: float, u: float) -> float:
    place = min(abs(u) / spacing, len(table) - 1.001)
    i = int(place)
    found = table[i] + (place - i) * (table[i + 1] - table[i])
    return found if u >= 0.0 else -found


@njit(cache=True, error_model='numpy')
def go(
    first: int, last: int, u: float, other: float, t: Array, acts: Array, table: Array,
    body: Array, screw: Array, steady: Array, revs: Array, rows: Array, turns: Array,
) -> float:  # fmt: skip
    """
    Go on from a step to another; return the speed then.

    Parameters
    ----------
    first, last, u
    other
        Resistance beside all else.
    t
    acts : (6, n)
        Wind through the water ahead and to port; force of waves at rest and by speed; resistance
        by the square of the speed; acceleration of the water.
    table
        Resistance at speeds.
    body
        Between two of these; mass and added mass; 1 + n_r; drag of still air by the square.
    screw, steady
        See `Screw.numbers`; revs and torque before the stop.
    revs : (shafts,)
        Of now; changed.
    rows : (3, n), turns : (n, shafts)
        Speed, pitch and force, and revs: written.
    """
    spacing, inertia, share, still_air = body
    dt, ramp_s, stagger_s = t[1] - t[0], screw[12], screw[14]
    for i in range(first, last):
        pitch = screw[1]
        if screw[7] == 3.0:
            pitch *= 1.0 - min(max(t[i] / ramp_s, 0.0), 1.0)
        total = 0.0
        for k in range(len(revs)):
            since = t[i] - stagger_s * k
            thrust = loads(screw, revs[k], u, pitch)[0]
            if screw[7] == 5.0 and since >= 0.0:
                thrust *= max(0.0, 1.0 - since / ramp_s)
            total += thrust * (1.0 - screw[5]) if thrust > 0.0 else thrust
            revs[k] = _turned(screw, revs[k], since, u, dt, steady)
            turns[i, k] = revs[k]
        total += air(acts[0, i] - u, acts[1, i], still_air) + still_air * u * abs(u)
        total -= _still(table, spacing, u) + acts[2, i] + (acts[3, i] + acts[4, i] * abs(u)) * u
        total -= other
        rows[0, i], rows[1, i], rows[2, i] = u, pitch, total
        after = u + (total / inertia - acts[5, i] / share) * dt
        change = _still(table, spacing, after) - _still(table, spacing, u)
        u = after - 0.5 * dt * change / inertia
    return u
