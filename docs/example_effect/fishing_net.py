# SPDX-License-Identifier: Apache-2.0
"""An effect in a package of its own: `pip install docs/example_effect`, and every verb has it."""

from __future__ import annotations

from functools import partial

from shipdrag_ros.parameter import Parameter, half_normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effect import Action, Effect, Frame, Scope


def act(frame: Frame, drag_n_s_m: float) -> Action:
    """Return what a net does: its meshes close with the speed, so that its drag is linear."""
    return Action(resistance=(partial(drag, drag_n_s_m),))  # no lambda: it goes between processes


def drag(drag_n_s_m: float, speed_m_s: Float64) -> Float64:
    """Return the force [N] at some speeds."""
    return drag_n_s_m * speed_m_s


NET = Effect(
    name='fishing_net',
    scope=Scope.HULL,
    parameters=(
        Parameter(
            name='drag_n_s_m',
            low=0.0,
            high=1e6,
            unit='N s/m',
            prior=half_normal(4e4),
            meaning='drag of the net over the speed',
        ),
    ),
    formula='drag u',
    source='an example',
    act=act,
    odds=0.04,
)
