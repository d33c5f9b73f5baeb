# SPDX-License-Identifier: Apache-2.0
"""Engines, clutches and shafts: what turns the propellers, and what brakes them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from benchmarks.worlds.propulsion.hull import Hull
from benchmarks.worlds.propulsion.propeller import thrust_and_torque


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
    low, high = advance / diameter, 60.0 * advance / diameter
    for _ in range(80):
        omega = 0.5 * (low + high)
        if thrust_and_torque(advance, omega, hull.pitch_ratio, diameter)[0] < needed:
            low = omega
        else:
            high = omega
    thrust, torque = thrust_and_torque(advance, omega, hull.pitch_ratio, diameter)
    return Steady(speed_m_s, shafts, diameter, omega, torque, thrust)
