# SPDX-License-Identifier: Apache-2.0
"""Ships that are steered: surge, sway and yaw after Abkowitz."""

from shipdrag_ros.simulation.manoeuvring.manoeuvre import (
    Manoeuvre,
    Side,
    advance_m,
    overshoots_rad,
    parse,
    tactical_diameter_m,
    turn,
    zigzag,
)
from shipdrag_ros.simulation.manoeuvring.motion import Motion, Motions
from shipdrag_ros.simulation.manoeuvring.ship import FORM, SteeredShip, mariner
from shipdrag_ros.simulation.manoeuvring.simulate import steer

__all__ = [
    'FORM',
    'Manoeuvre',
    'Motion',
    'Motions',
    'Side',
    'SteeredShip',
    'advance_m',
    'mariner',
    'overshoots_rad',
    'parse',
    'steer',
    'tactical_diameter_m',
    'turn',
    'zigzag',
]
