# SPDX-License-Identifier: Apache-2.0
"""
What an effect does to a simulated run, in the few terms that the kernel knows.

Actions add, so that any set of effects is one action; the empty one changes
nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import inf
from operator import add
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.scenario import Turn

ResistanceLaw = Callable[[Float64], Float64]
ReadingError = Callable[[Float64, Float64], Float64]
Vector = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Action:
    """
    Contributions of effects; vectors point to the east and to the north.

    Attributes
    ----------
    resistance
        Functions of |speed through water| >= 0 [m/s] that return an extra
        resistance [N], retarding positive, odd in the speed.
    wind_m_s
        Velocity of the air over ground.
    wave_force_n
        Mean force of the waves on the ship at rest.
    wave_encounter_s_m
        The force is (1 + wave_encounter_s_m c)^2 times that, c the speed
        through water against the force.
    current_m_s
        Velocity of the water over ground.
    current_change_m_s
        What the current gains, evenly, from the end of the lead-in to the
        end of the record.
    residual_fraction, residual_decay_s
        Share of the thrust that does not end with the ship's run-down but
        as exp(-t / residual_decay_s).
    run_down_change_s
        The run-down is longer by this.
    n_r_change
        n_r is larger by this.
    mass_fraction
        The ship's mass is larger by this fraction, its resistance is not.
    turns
        On top of the scenario's.
    stall_m_s
        Above this speed through water the flow turns the propeller, below it
        stands; 0: as the baseline has it.
    free_shaft
        Shaft speed of the baseline's free propeller, over that under power at
        the same speed of the ship, where it is seen to turn.
    friction_m_s
        Speed through water below which friction stops that propeller.
    depth_m
        Depth of the water, where it is less than the scenario's.
    log_factor, log_offset_m_s
        The log reads (1 + log_factor) times the truth and its errors, plus log_offset_m_s.
    log_lag_s
        Time constant of a first-order filter of the log.
    log_late_s
        A reading of the log is of this time before its stamp.
    log_error
        Functions of speed through water [m/s] and time since the end of the lead-in [s] that
        return what the flow at the log is too fast [m/s].
    radar_factor
        Positions and speeds over ground read (1 + radar_factor) times truth.
    ground_lag_s
        Time constant of a first-order filter of the speed over ground.
    """

    resistance: tuple[ResistanceLaw, ...] = ()
    wind_m_s: Vector = (0.0, 0.0)
    wave_force_n: Vector = (0.0, 0.0)
    wave_encounter_s_m: float = 0.0
    current_m_s: Vector = (0.0, 0.0)
    current_change_m_s: Vector = (0.0, 0.0)
    residual_fraction: float = 0.0
    residual_decay_s: float = 0.0
    run_down_change_s: float = 0.0
    n_r_change: float = 0.0
    mass_fraction: float = 0.0
    turns: tuple[Turn, ...] = ()
    stall_m_s: float = 0.0
    free_shaft: float = 0.0
    friction_m_s: float = 0.0
    depth_m: float = inf
    log_factor: float = 0.0
    log_offset_m_s: float = 0.0
    log_lag_s: float = 0.0
    log_late_s: float = 0.0
    log_error: tuple[ReadingError, ...] = ()
    radar_factor: float = 0.0
    ground_lag_s: float = 0.0

    def __add__(self, other: Action) -> Action:
        return Action.total(self, other)

    @classmethod
    def total(cls, *actions: Action) -> Action:
        """
        Return what several do together.
        """
        parts: dict[str, Any] = {}
        for action in actions:
            for name, value in action._parts.items():
                parts[name] = _ADD.get(name, add)(parts[name], value) if name in parts else value
        return cls(**parts)

    @cached_property
    def _parts(self) -> dict[str, Any]:
        """What it contributes: most actions have a part or two."""
        return {name: value for name, value in vars(self).items() if value != _NOTHING[name]}

    def resistance_n(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return the extra resistance [N], odd in the speed.
        """
        speed = np.asarray(speed_m_s, np.float64)
        magnitude = np.abs(speed)
        total = np.zeros_like(speed)
        for function in self.resistance:
            total += function(magnitude)
        return np.sign(speed) * total


def _sum_of_vectors(one: Vector, other: Vector) -> Vector:
    return one[0] + other[0], one[1] + other[1]


_ADD: dict[str, Callable[[Any, Any], Any]] = {
    'wind_m_s': _sum_of_vectors,
    'wave_force_n': _sum_of_vectors,
    'current_m_s': _sum_of_vectors,
    'current_change_m_s': _sum_of_vectors,
    'stall_m_s': max,
    'depth_m': min,
}
_NOTHING = vars(Action())
