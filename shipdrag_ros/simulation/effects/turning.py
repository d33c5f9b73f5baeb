# SPDX-License-Identifier: Apache-2.0
"""Turn, or rudder held, during the coast."""

from __future__ import annotations

from math import copysign

from shipdrag_ros.simulation.declared import stated
from shipdrag_ros.simulation.effect import Action, Frame
from shipdrag_ros.simulation.scenario import Turn

_RUDDER_RAD = 0.17  # 10 degrees, to the side she turns to
_HELM_EDGE, _YAW_EDGE = 0.125, 0.375  # of the duration: the rudder is quicker than the hull


def _act(
    frame: Frame, drag_area_m2: float, start_s: float, duration_s: float, rate_rad_s: float
) -> Action:
    def turn(edge: float, rate_rad_s: float, drag_area_m2: float, rudder_rad: float) -> Turn:
        edge_s = edge * duration_s
        return Turn(
            start_s + 0.5 * edge_s,
            duration_s - edge_s,
            rate_rad_s / (1.0 - edge),
            drag_area_m2=drag_area_m2,
            rudder_rad=rudder_rad,
            edge_s=edge_s,
        )

    return Action(
        turns=(
            turn(_HELM_EDGE, 0.0, drag_area_m2, copysign(_RUDDER_RAD, rate_rad_s)),
            turn(_YAW_EDGE, rate_rad_s, 0.0, 0.0),
        )
    )


EFFECT = stated('turning', _act)
