# SPDX-License-Identifier: Apache-2.0
"""
Every prior of the forecast, as data; docs/results/priors.md prints it (`python docs/tables.py`).

Chosen on world A, cases 0 to 59, and on the measured records, as docs/forecast.md says
(`benchmarks/accuracy/forecast_*.py`).
"""

from __future__ import annotations

from typing import NamedTuple

from shipdrag_ros.parameter import Declared, normal

_WORLD = 'world A, records'

LEVEL = Declared('d', 'level of d: the size of r is what was measured', normal(1.0), '', _WORLD)
EXPONENT = Declared('d', 'exponent of r over u, beside that of the form', normal(0.15), '', _WORLD)
SMOOTH = Declared('d', 'a smooth rest of d', normal(0.06), '', _WORLD)
ALIKE = Declared('d', 'over how much of ln u that rest is alike', 0.4, '', _WORLD)
GUST = Declared('-', 'gust, of the deceleration at the stop', normal(0.04), '', _WORLD)
ANOTHER_RUN = Declared(
    '-',
    'r of the next run over that last known, less one: `--if-stopped-now`',
    normal(0.05),
    '',
    'runs of one hull on one day',
)
FORM_OFF = Declared('-', 'form of r of a baseline, relative', normal(0.01), '', 'judgement')


class WeighedFamilies(NamedTuple):
    """Values with their probabilities, and what is printed of them."""

    of: tuple[tuple[float, float], ...]
    declared: Declared


def _families(letter: str, meaning: str, *of: tuple[float, float]) -> WeighedFamilies:
    said = ', '.join(f'{value:g} ({chance:g})' for value, chance in of)
    expected = sum(value * chance for value, chance in of)
    text = f'{meaning}, mean of families (with their probabilities): {said}'
    return WeighedFamilies(of, Declared(letter, text, round(expected, 3), '', _WORLD))


FORMS = _families(
    'f',
    'share of a constant force in the deceleration at the stop',
    *((0.0, 0.7), (0.03, 0.1), (0.1, 0.08), (0.3, 0.05), (0.6, 0.04), (0.9, 0.03)),
)
WIDTHS = _families('-', 'exponent and rest are wider by', (1.0, 0.85), (3.0, 0.12), (10.0, 0.03))
ROUGHER = _families(
    '-', 'errors of the estimate and gusts are larger by', (1.0, 0.6), (2.0, 0.25), (4.0, 0.15)
)
TABLE = (
    *(each.declared for each in (FORMS, WIDTHS, ROUGHER)),
    *(each for each in vars().copy().values() if isinstance(each, Declared)),
)
"""What docs/results/priors.md prints; times of gusts, slow water and log: those of noise."""
