# SPDX-License-Identifier: Apache-2.0
"""
Which cases there are, and what a crew would write into the log book: mostly all, mostly true.

What is so is written with the probability `KNOWN`, what is not so with `LIE`; the state of the
shaft is wrong as often.
"""

from __future__ import annotations

from collections.abc import Mapping
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


LIE = 0.02
KNOWN = 0.8
Facts = Mapping[str, str | None]


def draw_facts(
    rng: np.random.Generator, names: tuple[str, ...], drive: str, wind_m_s: float
) -> tuple[Facts, tuple[str, ...]]:
    """
    Return the facts by name (the value None where there is none), and which of them are false.

    Parameters
    ----------
    rng
    names
        Of what is hidden.
    drive
        Of the propeller, as it was after the stop.
    wind_m_s
        Mean wind over ground.
    """
    shaft = {'locked': 'locked', 'folding': 'locked', 'cpp': 'driven'}.get(drive, 'free')
    if 'residual_thrust' in names:
        shaft = 'driven'
    others = [value for value in ('locked', 'free', 'driven') if value != shaft]
    true: dict[str, bool] = {
        'no_towed_cable': not {'towed_cable', 'dragging_anchor', 'caught_net'} & set(names),
        'deep_water': not {'shallow_water', 'bank'} & set(names),
        'helm_amidships': not {'turning', 'bank'} & set(names),
        'draughts_read': not {'displacement', 'list_change'} & set(names),
        'no_waves': 'waves' not in names,
        'calm': not {'wind', 'waves'} & set(names) and wind_m_s < 3.0,
        'shaft': True,
        'hull_cleaned': 'fouling' not in names,
    }
    facts: dict[str, str | None] = {}
    false = []
    for name, so in true.items():
        known, wrong = rng.random() < KNOWN, rng.random() < LIE
        date = f'2026-{rng.integers(3, 6):02d}-{rng.integers(1, 28):02d}'
        other = str(rng.choice(others))
        lie = wrong and (name == 'shaft' or not so)
        if not (lie or (so and known)):
            continue
        if lie:
            false.append(name)
        facts[name] = None
        if name == 'shaft':
            facts[name] = other if lie else shaft
        elif name == 'hull_cleaned':
            facts[name] = date
    return facts, tuple(false)


def arguments(facts: Facts) -> list[str]:
    """
    Return them as `diagnose` takes them.
    """
    found = []
    for name, value in facts.items():
        found += ['--fact', name if value is None else f'{name}={value}']
    return found
