# SPDX-License-Identifier: Apache-2.0
"""Added mass other than the ship file's."""

from __future__ import annotations

from shipdrag_ros.parameter import Parameter, half_normal
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Scope


def _act(frame: Frame, n_r_change: float) -> Action:
    return Action(n_r_change=n_r_change)


EFFECT = Effect(
    name='added_mass',
    scope=Scope.HULL,
    parameters=(
        Parameter(
            name='n_r_change',
            unit='',
            meaning='added to n_r at every speed',
            # n_r is small, and cannot be negative: it can hardly be less than stated
            prior=half_normal(0.15),
            low=-0.5,
            high=2.0,
        ),
    ),
    formula='(1 + n_r + n_r_change) du/dt = -r',
    source='S1 (1)',
    formula_sd=0.05,
    odds=0.01,
    act=_act,
    confounders={'displacement': ()},
    lasts_s=90.0 * DAY_S,
)
