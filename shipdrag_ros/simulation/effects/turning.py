# SPDX-License-Identifier: Apache-2.0
"""Turn, or rudder held, during the coast."""

from __future__ import annotations

from math import copysign

from shipdrag_ros.parameter import Parameter, either_sign, log_normal, uniform
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import AREAS, DENIES, Effect, Frame, Measure, Scope
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


EFFECT = Effect(
    name='turning',
    scope=Scope.RUN,
    parameters=(
        Parameter(
            name='drag_area_m2',
            unit='m^2',
            meaning='of the resistance that drift, yaw and rudder add',
            prior=log_normal(0.02, 0.7),
            low=0.0,
            high=1.0,
            measured_in=AREAS,
        ),
        Parameter(
            name='start_s',
            unit='s',
            meaning='after the stop, where the drag begins to grow',
            prior=uniform(0.0, 1500.0),
            low=0.0,
            high=1e5,
            value=200.0,
        ),
        Parameter(
            name='duration_s',
            unit='s',
            meaning='until the drag has gone',
            prior=log_normal(200.0, 0.8),
            low=0.0,
            high=1e5,
            value=150.0,
        ),
        Parameter(
            name='rate_rad_s',
            unit='rad/s',
            meaning='yaw rate meanwhile, anticlockwise positive; 0 where helm and counter-helm '
            'keep the course',
            # one that does not change the course leaves the trace of any force for a while
            prior=either_sign(0.0015, 1.1),
            low=-0.2,
            high=0.2,
            value=0.003,
        ),
    ),
    formula='0.5 rho drag_area v^2 from start to start + duration, growing and falling in an '
    'eighth of that; the yaw rate does so more slowly, in three eighths',
    source='definition',
    formula_sd=0.3,
    act=_act,
    struck_out_by=('heading', 'rudder'),
    confounders={
        'windmilling_propeller': (Measure.HEADING, Measure.RUDDER, Measure.ANOTHER_RUN),
        'current_change': (Measure.HEADING, Measure.RUDDER, Measure.ANOTHER_RUN),
    },
    facts={'helm_amidships': DENIES},
    # a net, a bank, ice: any drag that comes and goes
    nameless_at={'rate_rad_s': 0.0},
)
