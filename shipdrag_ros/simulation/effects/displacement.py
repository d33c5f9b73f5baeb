# SPDX-License-Identifier: Apache-2.0
"""Ship that is heavier or lighter than her file says."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, DENIES, Effect, Frame, Scope


def _act(frame: Frame, fraction: float) -> Action:
    return Action(mass_fraction=fraction)


EFFECT = Effect(
    name='displacement',
    scope=Scope.HULL,
    parameters=(
        Parameter(
            name='fraction',
            unit='',
            meaning="by which the mass is larger; the resistance [N] stays the baseline's",
            prior=normal(0.12),
            low=-0.5,
            high=1.0,
        ),
    ),
    formula='(1 + fraction) m (1 + n_r) du/dt = -R',
    source='Newton',
    formula_sd=0.05,
    odds=0.01,
    act=_act,
    facts={'draughts_read': DENIES},
    lasts_s=90.0 * DAY_S,
)
