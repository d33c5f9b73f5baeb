# SPDX-License-Identifier: Apache-2.0
"""Log whose clock, or transmission, is late."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Scope


def _act(frame: Frame, offset_s: float) -> Action:
    return Action(log_late_s=offset_s)


EFFECT = Effect(
    name='time_offset',
    scope=Scope.SENSOR,
    parameters=(
        Parameter(
            name='offset_s',
            unit='s',
            meaning='log later than radar: what is stamped t was true at t - offset',
            prior=normal(10.0),
            low=-600.0,
            high=600.0,
        ),
    ),
    formula='reading(t) = u(t - offset)',
    source='definition',
    odds=0.02,
    act=_act,
    errs_in=('speed_through_water',),
    lasts_s=30.0 * DAY_S,
)
