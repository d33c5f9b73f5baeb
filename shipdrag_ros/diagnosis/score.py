# SPDX-License-Identifier: Apache-2.0
"""
How often the diagnosis was right on data in which the effect was hidden.

The figures are the summary that `benchmarks/accuracy/diagnosis_score.py` writes, kept
beside this module as `score.json`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from shipdrag_ros.display import Table

FILE = 'score.json'
_ROWS = {
    'precision of a name': 'right, where one of the known effects is hidden and a name is given',
    'named, first shelf': 'named, where one of the common effects is hidden',
    'name or set of <= 3 with the truth, first shelf': 'the same: named, or a set of at most '
    'three that holds the truth',
    'parameters within 2 sd': 'size within two standard deviations of the truth',
    'alarm, nothing hidden': 'anything said to be missing, where nothing is',
    'false name, nothing hidden': 'anything named, where nothing is missing',
    'unknown, outside the library': '"unknown", where it is none of the known effects',
    'falsely named, outside the library': 'falsely named, where it is none of them',
}
_CALIBRATION = 'expected calibration error'


@dataclass(frozen=True)
class Score:
    """
    Figures of the method, not of the run at hand.

    Attributes
    ----------
    cases
        How many were tried.
    seed
        That they were drawn with.
    shares
        By name of the figure: how often, of how many.
    calibration_error
        By how much stated probabilities are wrong on average; None: unknown.
    """

    cases: int
    seed: int
    shares: Mapping[str, tuple[int, int]]
    calibration_error: float | None

    @classmethod
    def from_json(cls, text: str) -> Score | None:
        """
        Read the summary of the benchmark; None where it is empty.
        """
        summary: dict[str, Any] = json.loads(text) if text.strip() else {}
        if not summary.get('cases'):
            return None
        figures = summary['figures']
        error = figures.get(_CALIBRATION)
        return cls(
            summary['cases'],
            summary['seed'],
            {
                name: (share['count'], share['of'])
                for name, share in figures.items()
                if isinstance(share, dict) and share['of']
            },
            error if error is not None and math.isfinite(error) else None,
        )

    @classmethod
    def published(cls) -> Score | None:
        """
        Return the score that comes with this version; None: it has none.
        """
        file = files('shipdrag_ros.diagnosis') / FILE
        return cls.from_json(file.read_text(encoding='utf-8')) if file.is_file() else None

    def table(self) -> Table:
        """
        Show the main figures.
        """
        rows = [
            (words, f'{100.0 * self.shares[name][0] / self.shares[name][1]:.1f} %', f'{of}')
            for name, words in _ROWS.items()
            if name in self.shares
            for of in (self.shares[name][1],)
        ]
        if self.calibration_error is not None:
            error = f'{self.calibration_error:.3f}'
            rows.append(('stated probabilities are wrong, on average, by', error, ''))
        return Table(('', 'how often', 'of'), tuple(rows))
