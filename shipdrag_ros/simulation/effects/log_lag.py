# SPDX-License-Identifier: Apache-2.0
"""Log that is smoothed."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, log_normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Measure, Scope


def _act(frame: Frame, lag_s: float) -> Action:
    return Action(log_lag_s=lag_s)


EFFECT = Effect(
    name='log_lag',
    scope=Scope.SENSOR,
    parameters=(
        Parameter(
            name='lag_s',
            unit='s',
            meaning='time constant of a first-order filter',
            prior=log_normal(15.0, 0.6),
            low=0.0,
            high=1e4,
        ),
    ),
    formula='lag dy/dt = u - y',
    source='definition',
    formula_sd=0.1,
    odds=0.02,
    act=_act,
    confounders={'time_offset': (Measure.FAST_CHANGE,)},
    errs_in=('speed_through_water',),
    lasts_s=365.0 * DAY_S,
)
