# SPDX-License-Identifier: Apache-2.0
"""Steady current."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import Effect, Frame, Measure, Scope, WithoutBaseline


def _act(frame: Frame, along_track_m_s: float, cross_track_m_s: float) -> Action:
    return Action(current_m_s=frame.earth(along_track_m_s, cross_track_m_s))


EFFECT = Effect(
    name='current',
    scope=Scope.EARTH,
    parameters=(
        Parameter(
            name='along_track_m_s',
            unit='m/s',
            meaning='velocity of the water along the heading of the first run',
            prior=normal(0.4),
            low=-5.0,
            high=5.0,
        ),
        Parameter(
            name='cross_track_m_s',
            unit='m/s',
            meaning='and to port of it',
            prior=normal(0.3),
            low=-5.0,
            high=5.0,
            value=0.0,
        ),
    ),
    formula='velocity over ground = velocity through water + current; the air drag feels it too',
    source='kinematics',
    act=_act,
    confounders={
        'log_offset': (Measure.RECIPROCAL_RUN, Measure.ANOTHER_COURSE),
        'radar_scale': (
            Measure.RECIPROCAL_RUN,
            Measure.ANOTHER_COURSE,
            Measure.OTHER_SPEED,
        ),
        'log_scale': (
            Measure.RECIPROCAL_RUN,
            Measure.ANOTHER_COURSE,
            Measure.OTHER_SPEED,
        ),
        'current_change': (Measure.ANOTHER_RUN,),
    },
    without_baseline={
        WithoutBaseline.LOG_TRACK: 'a current turns with the course',
    },
)
