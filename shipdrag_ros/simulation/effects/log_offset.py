# SPDX-License-Identifier: Apache-2.0
"""Log that reads a fixed amount too much."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Measure, Scope, WithoutBaseline


def _act(frame: Frame, offset_m_s: float) -> Action:
    return Action(log_offset_m_s=offset_m_s)


EFFECT = Effect(
    name='log_offset',
    scope=Scope.SENSOR,
    parameters=(
        Parameter(
            name='offset_m_s',
            unit='m/s',
            meaning='reading = speed through water + offset',
            prior=normal(0.2),
            low=-5.0,
            high=5.0,
        ),
    ),
    formula='u + offset',
    source='definition',
    act=_act,
    confounders={
        'wind': (Measure.RADAR, Measure.WIND),
        'log_dead_band': (Measure.OTHER_SPEED,),
    },
    errs_in=('speed_through_water',),
    without_baseline={
        WithoutBaseline.LOG_TRACK: 'an offset is the same at all speeds',
    },
    lasts_s=365.0 * DAY_S,
)
