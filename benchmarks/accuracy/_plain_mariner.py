# SPDX-License-Identifier: Apache-2.0
"""
A Mariner-class ship in zigzags as one would write it with scipy, one run at a time.

Values are those of the package; equations and integration are written anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import copysign, sqrt

import numpy as np
from scipy.integrate import solve_ivp

from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.manoeuvring.ship import SteeredShip

Rates = Callable[[float, list[float]], tuple[float, ...]]


def rates_of(ship: SteeredShip, c: Mapping[str, float], ordered_rad: float) -> Rates:
    """
    Return the right-hand side for u, v, r, heading and rudder.
    """
    length, steady, machine = ship.length_m, ship.speed_m_s, ship.rudder
    added, lever = ship.inertial, ship.mass * ship.gravity_centre
    m11 = ship.mass - added.Xudot
    m22, m23 = ship.mass - added.Yvdot, lever - added.Yrdot
    m32, m33 = lever - added.Nvdot, ship.yaw_inertia - added.Nrdot
    det = m22 * m33 - m23 * m32

    def rates(time_s: float, state: list[float]) -> tuple[float, ...]:
        du, v, r, _, d = state
        speed = sqrt((steady + du) ** 2 + v**2)
        yaw_rate = r
        u, v, r = du / speed, v / speed, r * length / speed
        x = (
            c['Xu'] * u
            + c['Xuu'] * u**2
            + c['Xuuu'] * u**3
            + c['Xvv'] * v**2
            + c['Xrr'] * r**2
            + c['Xdd'] * d**2
            + c['Xudd'] * u * d**2
            + c['Xrv'] * r * v
            + c['Xvd'] * v * d
            + c['Xuvd'] * u * v * d
        )
        y, n = (
            c[axis + 'v'] * v
            + c[axis + 'r'] * r
            + c[axis + 'vvv'] * v**3
            + c[axis + 'vvr'] * v**2 * r
            + c[axis + 'vu'] * v * u
            + c[axis + 'ru'] * r * u
            + c[axis + 'd'] * d
            + c[axis + 'ddd'] * d**3
            + c[axis + 'ud'] * u * d
            + c[axis + 'uud'] * u**2 * d
            + c[axis + 'vdd'] * v * d**2
            + c[axis + 'vvd'] * v**2 * d
            + c[axis + '0']
            + c[axis + '0u'] * u
            + c[axis + '0uu'] * u**2
            for axis in 'YN'
        )
        rudder = (ordered_rad - d) / machine.lag_s
        if abs(rudder) > machine.rate_rad_s:
            rudder = copysign(machine.rate_rad_s, rudder)
        return (
            x * speed**2 / length / m11,
            (m33 * y - m23 * n) / det * speed**2 / length,
            (m22 * n - m32 * y) / det * speed**2 / length**2,
            yaw_rate,
            rudder,
        )

    return rates


def zigzag(
    ship: SteeredShip,
    derivatives: Mapping[str, float],
    angle_rad: float,
    time_s: Float64,
    *,
    rtol: float,
) -> Float64:
    """
    Return the change of speed, sway and yaw rate (n, 3), first to starboard.
    """
    found = np.empty((len(time_s), 3))
    state, start, side = np.zeros(5), 0.0, 1.0
    while start < time_s[-1]:

        def reached(time: float, now: Float64, side: float = side) -> float:
            return float(side * now[3] - angle_rad)

        reached.terminal, reached.direction = True, 1.0  # type: ignore[attr-defined]
        leg = solve_ivp(
            rates_of(ship, derivatives, -side * angle_rad),
            (start, time_s[-1]),
            state,
            events=reached,
            t_eval=time_s[time_s >= start],
            rtol=rtol,
            atol=1e-2 * rtol,
        )
        first = int(np.searchsorted(time_s, start))
        found[first : first + len(leg.t)] = leg.y[:3].T
        if not len(leg.t_events[0]):
            break
        state, start, side = leg.y_events[0][0], float(leg.t_events[0][0]), -side
    return found
