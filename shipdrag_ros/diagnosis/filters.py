# SPDX-License-Identifier: Apache-2.0
"""Filters that every log and every speed over ground has, as a part of hypotheses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

from shipdrag_ros.parameter import Parameter, free, half_normal
from shipdrag_ros.simulation import Action
from shipdrag_ros.simulation.effect import Frame

_SD_S = 8.0  # half-normal: 2 to 15 s, as manuals state, are usual
_SD = 0.015  # at most, over the time in which the craft slows down: small ones are read quickly
_START = 0.3  # z from which a fit begins: inside, as 0 is the bound


@dataclass(frozen=True)
class FilterNuisance:
    """
    The filters of log and speed over ground, which every instrument has.

    Manuals state 2 to 15 s; on a craft that slows down quickly they are shorter.

    Attributes
    ----------
    slow_down_s
        Speed over deceleration, roughly, at the stop.
    has_log, has_ground
        Whether there are such rows.
    """

    slow_down_s: float
    has_log: bool
    has_ground: bool
    one_size: ClassVar[Sequence[int]] = ()

    @cached_property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Time constants [s]."""
        sd = min(_SD_S, _SD * self.slow_down_s)
        places = {'log filter': self.has_log, 'ground filter': self.has_ground}
        return tuple(
            replace(free(name, half_normal(sd)), start=_START)
            for name, there in places.items()
            if there
        )

    def acts_in(self, run: int) -> bool:
        """Say that the instruments are the same in all runs."""
        return True

    def action(self, frame: Frame, run: int, values: Sequence[float]) -> Action:
        """Return the filters."""
        given = iter(values)
        log, ground = (next(given) if there else 0.0 for there in (self.has_log, self.has_ground))
        return Action(log_lag_s=log, ground_lag_s=ground)
