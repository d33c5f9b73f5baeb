# SPDX-License-Identifier: Apache-2.0
"""The curves of a result as CSV, for a spreadsheet."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from shipdrag_ros.display import spreadsheet_text
from shipdrag_ros.replay.run_result import RunResult

COLUMNS = (
    'speed_m_s',
    'resistance_m_s2',
    'sigma_m_s2',
    'sigma_repeatable_m_s2',
    'froude',
)


def write_curves(path: Path, runs: Sequence[RunResult]) -> None:
    """
    Write every r(v) inside its valid range, one row a speed.

    The first columns show the bag and the number of the coastdown in it.
    """
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(('bag', 'coastdown', *COLUMNS))
        for run in runs:
            for number, coastdown in enumerate(run.coastdowns, start=1):
                if coastdown.estimate is None:
                    continue
                curve = coastdown.estimate.valid_curve
                for values in zip(*(getattr(curve, name).tolist() for name in COLUMNS)):
                    writer.writerow((spreadsheet_text(run.bag), number, *values))
