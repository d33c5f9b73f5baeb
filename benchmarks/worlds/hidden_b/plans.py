# SPDX-License-Identifier: Apache-2.0
"""Which cases there are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from benchmarks.worlds.hidden_b.effects import LIBRARY, SECOND
from benchmarks.worlds.hidden_b.strangers import OUTSIDE

PAIRS = (
    ('fouling', 'wind'),
    ('current', 'fouling'),
    ('current', 'log_scale'),
    ('fouling', 'log_scale'),
    ('residual_thrust', 'wind'),
    ('shallow_water', 'current'),
    ('locked_propeller', 'fouling'),
    ('towed_cable', 'log_offset'),
)
ALWAYS = (
    'current',
    'current_change',
    'log_lag',
    'log_offset',
    'log_scale',
    'time_offset',
    'wind',
)
"""What is in every case, too small to be an effect: a name of these is an alarm, not a lie."""
_ONE, _SECOND, _OUTSIDE, _NONE = 3, 1, 2, 22  # of a kind, in one half and one condition


@dataclass(frozen=True)
class Condition:
    """
    What a diagnosis is given: runs, and whether wind, depth, heading and shaft are measured.
    """

    runs: int
    context: bool
    misstated: bool = False

    def __str__(self) -> str:
        return f'{self.runs} run' + 's' * (self.runs > 1) + ' + context' * self.context


CONDITIONS = tuple(Condition(runs, context) for context in (False, True) for runs in (1, 2, 3))


@cache
def plans_of(seed: int) -> tuple[tuple[tuple[str, ...], Condition], ...]:
    """
    Return what is hidden in each case, and its condition; even and odd numbers alike.
    """
    halves = []
    for half in (0, 1):
        plans: list[tuple[tuple[str, ...], Condition]] = []
        for condition in CONDITIONS:
            names: list[tuple[str, ...]] = []
            for name in LIBRARY:
                names += [(name,)] * (_SECOND if name in SECOND else _ONE)
            names += [*PAIRS, *((name,) for name in OUTSIDE for _ in range(_OUTSIDE))]
            plans += [(each, condition) for each in names + [()] * _NONE]
        order = np.random.default_rng([seed, half]).permutation(len(plans))
        halves.append([plans[i] for i in order])
    return tuple(plan for both in zip(*halves, strict=True) for plan in both)
