# SPDX-License-Identifier: Apache-2.0
"""True wind."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DENIES, Effect, Frame, Measure, Scope


def _act(frame: Frame, head_m_s: float, cross_m_s: float) -> Action:
    return Action(wind_m_s=frame.earth(-head_m_s, -cross_m_s))


EFFECT = Effect(
    name='wind',
    scope=Scope.EARTH,
    parameters=(
        Parameter(
            name='head_m_s',
            unit='m/s',
            meaning='true wind over ground from ahead of the first run',
            prior=normal(6.0),
            low=-60.0,
            high=60.0,
        ),
        Parameter(
            name='cross_m_s',
            unit='m/s',
            meaning='and from her port side',
            prior=normal(5.0),
            low=-60.0,
            high=60.0,
            value=0.0,
        ),
    ),
    formula='air drag 0.5 rho_air A C_X |W| W_x, W the wind relative to the ship, W_x its '
    'component from ahead, less the still-air drag of the baseline',
    source='C_X(angle) = C_X(0) cos(angle), the simplest of the forms that Blendermann fits',
    formula_sd=0.15,
    act=_act,
    struck_out_by=('wind_apparent',),
    confounders={
        'waves': (Measure.WIND, Measure.OTHER_SPEED),
        'windmilling_propeller': (Measure.RECIPROCAL_RUN, Measure.WIND, Measure.SHAFT),
        'fouling': (Measure.RECIPROCAL_RUN, Measure.WIND),
        'residual_thrust': (Measure.RECIPROCAL_RUN, Measure.WIND, Measure.SHAFT),
    },
    needs=('air',),
    facts={'calm': DENIES},
)
