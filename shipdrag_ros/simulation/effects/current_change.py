# SPDX-License-Identifier: Apache-2.0
"""Current that changes while the ship coasts."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import Effect, Frame, Measure, Scope


def _act(frame: Frame, change_m_s: float) -> Action:
    return Action(current_change_m_s=frame.earth(change_m_s, 0.0))


EFFECT = Effect(
    name='current_change',
    scope=Scope.EARTH,
    parameters=(
        Parameter(
            name='change_m_s',
            unit='m/s',
            meaning='what the velocity of the water along the heading of the first run gains, '
            'evenly, from the stop to the end of the record',
            prior=normal(0.25),
            low=-5.0,
            high=5.0,
        ),
    ),
    formula='c(t) = c + change t / T from the stop on; the ship lags behind by her inertia: '
    '(1 + n_r) du/dt = ... - dc/dt',
    source='kinematics; Newton',
    formula_sd=0.3,
    odds=0.02,
    act=_act,
    confounders={
        'log_scale': (Measure.RECIPROCAL_RUN,),
        'radar_scale': (Measure.RECIPROCAL_RUN,),
    },
)
