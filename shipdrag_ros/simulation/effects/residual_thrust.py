# SPDX-License-Identifier: Apache-2.0
"""Thrust that goes on after the stop for longer than the ship's run-down."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, log_normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import Effect, Frame, Measure, Said, Scope


def _act(frame: Frame, decay_s: float, fraction: float) -> Action:
    return Action(residual_fraction=fraction, residual_decay_s=decay_s)


EFFECT = Effect(
    name='residual_thrust',
    scope=Scope.RUN,
    parameters=(
        Parameter(
            name='decay_s',
            unit='s',
            meaning='time constant of what remains',
            prior=log_normal(150.0, 0.7),
            low=1e-3,
            high=1e6,
        ),
        Parameter(
            name='fraction',
            unit='',
            meaning='of the steady thrust; the rest ends as the ship file says',
            prior=log_normal(0.2, 0.6),
            low=0.0,
            high=1.0,
            value=0.2,
        ),
    ),
    formula='T = T0 [(1 - fraction) exp(-t/run_down) + fraction exp(-t/decay)], shaft speed alike',
    source='definition',
    # a propeller does one thing at a time
    not_with=('locked_propeller', 'windmilling_propeller'),
    formula_sd=0.2,
    act=_act,
    struck_out_by=('shaft',),
    confounders={
        'log_lag': (Measure.SHAFT, Measure.RADAR),
        'time_offset': (Measure.SHAFT,),
        'added_mass': (Measure.SHAFT, Measure.ANOTHER_RUN),
    },
    facts={'shaft': Said(('driven',))},
)
