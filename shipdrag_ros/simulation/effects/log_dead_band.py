# SPDX-License-Identifier: Apache-2.0
"""Log that reads too little when the ship is slow."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, log_normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Measure, Scope, WithoutBaseline


def _act(frame: Frame, speed_m_s: float) -> Action:
    return Action(log_dead_band_m_s=speed_m_s)


EFFECT = Effect(
    name='log_dead_band',
    scope=Scope.SENSOR,
    parameters=(
        Parameter(
            name='speed_m_s',
            unit='m/s',
            meaning='speed below which it under-reads',
            prior=log_normal(1.5, 0.7),
            low=0.0,
            high=20.0,
        ),
    ),
    formula='u^2 / speed below it, u above: continuous, and nothing at rest',
    source='definition',
    formula_sd=0.4,
    odds=0.02,
    act=_act,
    confounders={
        'windmilling_propeller': (Measure.RADAR, Measure.SHAFT),
    },
    errs_in=('speed_through_water',),
    without_baseline={WithoutBaseline.ZEROS: 'a wheel stands still below some speed'},
    lasts_s=365.0 * DAY_S,
)
