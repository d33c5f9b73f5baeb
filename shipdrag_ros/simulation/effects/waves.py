# SPDX-License-Identifier: Apache-2.0
"""Mean force of a sea from ahead or from astern."""

from __future__ import annotations

from math import pi, sqrt

from shipdrag_ros.ship import GRAVITY_M_S2
from shipdrag_ros.simulation.declared import stated
from shipdrag_ros.simulation.effect import Action, Frame


def _act(frame: Frame, force_n: float, side: float, wave_length_m: float) -> Action:
    frequency = sqrt(2.0 * pi * GRAVITY_M_S2 / wave_length_m)
    return Action(
        wave_force_n=frame.earth(-side * force_n, 0.0), wave_encounter_s_m=frequency / GRAVITY_M_S2
    )


EFFECT = stated('waves', _act)
