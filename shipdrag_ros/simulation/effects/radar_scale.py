# SPDX-License-Identifier: Apache-2.0
"""Radar whose distances are a fixed share too long."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Scope, WithoutBaseline


def _act(frame: Frame, factor: float) -> Action:
    return Action(radar_factor=factor)


EFFECT = Effect(
    name='radar_scale',
    scope=Scope.SENSOR,
    parameters=(
        Parameter(
            name='factor',
            unit='',
            meaning='reading = (1 + factor) times position and speed over ground',
            prior=normal(0.03),
            low=-0.9,
            high=9.0,
        ),
    ),
    formula='(1 + factor) (x, y)',
    source='definition',
    act=_act,
    errs_in=('position', 'speed_over_ground'),
    without_baseline={
        WithoutBaseline.LOG_TRACK: 'a scale grows with the speed, on every course',
    },
    # the scale of latitude and longitude is that of the Earth
    in_geodetic=False,
    lasts_s=365.0 * DAY_S,
)
