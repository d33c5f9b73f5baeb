# SPDX-License-Identifier: Apache-2.0
"""Log that reads a fixed share too much."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Measure, Scope, WithoutBaseline


def _act(frame: Frame, factor: float) -> Action:
    return Action(log_factor=factor)


EFFECT = Effect(
    name='log_scale',
    scope=Scope.SENSOR,
    parameters=(
        Parameter(
            name='factor',
            unit='',
            meaning='reading = (1 + factor) times the speed through water',
            prior=normal(0.08),
            low=-0.9,
            high=9.0,
        ),
    ),
    formula='(1 + factor) u',
    source='definition',
    act=_act,
    confounders={
        'radar_scale': (Measure.THIRD_SPEED,),
        'log_offset': (Measure.OTHER_SPEED, Measure.THIRD_SPEED),
    },
    errs_in=('speed_through_water',),
    without_baseline={
        WithoutBaseline.LOG_TRACK: 'a scale grows with the speed, on every course',
    },
    lasts_s=365.0 * DAY_S,
)
