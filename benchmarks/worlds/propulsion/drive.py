# SPDX-License-Identifier: Apache-2.0
"""
Propellers, and the engines, clutches and shafts that turn and brake them.

A propeller in four quadrants and at any pitch is one blade element at 0.7 R.
The blade is a thin plate of low aspect ratio in the flow of advance and
rotation (Polhamus: potential lift and the suction of the edges), which holds for
driving, windmilling, locked, reversed and at zero pitch alike. Its constants are
set for K_T and K_Q of a four-bladed B-series screw of medium area ratio. Against the
measured four quadrants of a B4-70 of pitch ratio 1.4 its C_T is off by 0.17 rms, of 0.51:
deep in the stall it pulls a quarter to a third less.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit

from benchmarks.worlds.propulsion.hull import WATER_KG_M3, Hull

POTENTIAL = 0.85
SUCTION = 0.70
FRICTION = 0.009
AREA_RATIO = 0.55
CAMBER_RAD = 0.026  # angle of zero lift
LEVER = 0.35  # of the diameter


@njit
def thrust_and_torque(advance, omega, pitch_ratio, diameter):  # type: ignore[no-untyped-def]
    """
    Thrust [N] and torque taken from the shaft [N m].

    At a speed of advance [m/s], a rate of turn [rad/s], a pitch ratio, a diameter [m].
    """
    blade = LEVER * diameter * omega  # speed at 0.7 R
    squared = advance**2 + blade**2
    if squared < 1e-8:
        return 0.0, 0.0
    angle = np.arctan(pitch_ratio / (0.7 * np.pi))
    flow = np.arctan2(advance, blade)
    attack = angle + CAMBER_RAD - flow
    s = np.sin(attack)
    c = np.cos(attack)
    normal = np.sign(s) * (POTENTIAL * abs(s * c) + SUCTION * s * s)
    skin = FRICTION * c  # along the chord, against the flow
    scale = 0.5 * WATER_KG_M3 * squared * AREA_RATIO * np.pi / 4.0 * diameter**2
    thrust = scale * (normal * np.cos(angle) - skin * np.sin(angle))
    torque = scale * LEVER * diameter * (normal * np.sin(angle) + skin * np.cos(angle))
    return thrust, torque


def open_water(advance_ratio: float, pitch_ratio: float) -> tuple[float, float]:
    """
    Return K_T and K_Q.
    """
    thrust, torque = thrust_and_torque(advance_ratio, 2.0 * np.pi, pitch_ratio, 1.0)
    return thrust / WATER_KG_M3, torque / WATER_KG_M3


def windmilling(advance_m_s: float, pitch_ratio: float, diameter_m: float) -> float:
    """
    Return the rate of turn at which a shaft without friction turns [rad/s].
    """

    def turned(omega: float) -> bool:
        return bool(thrust_and_torque(advance_m_s, omega, pitch_ratio, diameter_m)[1] < 0.0)

    return _rate(0.05 * advance_m_s / diameter_m, 40.0 * advance_m_s / diameter_m, turned)


def _rate(low: float, high: float, too_slow: Callable[[float], bool]) -> float:
    """Return where between two rates of turn it is no more too slow."""
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if too_slow(middle) else (low, middle)
    return middle


class Mode(IntEnum):
    """What a shaft is ordered to do."""

    OFF = 0  # fuel cut, and declutched where there is a clutch
    AHEAD = 1  # the engine drives, at a level of the steady revs
    BRAKE = 2  # fuel cut, shaft braked
    ASTERN = 3  # the engine drives astern, until the ship stops
    REGENERATE = 4  # an electric motor is driven by the propeller
    KEPT = 5  # revs kept by a governor, pitch at zero


class Hold(IntEnum):
    """What the engine keeps in steady sailing."""

    TORQUE = 0
    POWER = 1
    REVS = 2


@dataclass(frozen=True)
class Drive:
    """
    One kind of drive train; each shaft of a ship has the same.

    Attributes
    ----------
    clutch
        Whether OFF takes the engine off the shaft.
    run_up_s
        Inertia times rate of turn over torque at service speed, engine on.
    friction_on, friction_off
        Friction torque with and without the engine on the shaft, over that torque.
    brake
        Torque of the brake, likewise.
    regenerate
        Torque of regeneration at the rate of service speed, likewise.
    """

    name: str
    clutch: bool
    run_up_s: float
    friction_on: float
    friction_off: float
    brake: float = 0.6
    regenerate: float = 0.15


DIRECT = Drive('direct two-stroke', False, 2.5, 0.09, 0.09)
CLUTCHED = Drive('four-stroke, clutch', True, 1.5, 0.10, 0.012)
GEARBOX = Drive('outboard or gearbox', True, 0.6, 0.08, 0.010)
ELECTRIC = Drive('electric', False, 1.0, 0.012, 0.012)


@dataclass(frozen=True)
class Steady:
    """
    The calm-water point at which a ship sails.

    Attributes
    ----------
    omega, torque, thrust
        Of each of `shafts` propellers [rad/s, N m, N].
    """

    speed_m_s: float
    shafts: int
    diameter_m: float
    omega: float
    torque: float
    thrust: float


def steady(hull: Hull, speed_m_s: float, shafts: int, extra_n: float = 0.0) -> Steady:
    """
    Find the rate of turn that keeps a speed against `extra_n` of wind and sea.
    """
    diameter = float(np.sqrt(hull.disc_m2 / shafts / (np.pi / 4.0)))
    advance = speed_m_s * (1.0 - hull.wake)
    needed = (hull.drag_n(speed_m_s) + extra_n) / (1.0 - hull.thrust_deduction) / shafts

    def given(omega: float) -> tuple[float, float]:
        found: tuple[float, float] = thrust_and_torque(advance, omega, hull.pitch_ratio, diameter)
        return found

    omega = _rate(advance / diameter, 60.0 * advance / diameter, lambda o: given(o)[0] < needed)
    thrust, torque = given(omega)
    return Steady(speed_m_s, shafts, diameter, omega, torque, thrust)
