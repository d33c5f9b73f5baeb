# SPDX-License-Identifier: Apache-2.0
"""Thrust that goes on after the stop for longer than the ship's run-down."""

from __future__ import annotations

from shipdrag_ros.simulation.declared import stated
from shipdrag_ros.simulation.effect import Action, Frame


def _act(frame: Frame, decay_s: float, fraction: float) -> Action:
    return Action(residual_fraction=fraction, residual_decay_s=decay_s)


EFFECT = stated('residual_thrust', _act)
