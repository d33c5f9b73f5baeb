# SPDX-License-Identifier: Apache-2.0
"""The CSV holds the curve to the last digit."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.spreadsheet import write_curves


def test_the_valid_curve_round_trips(run: RunResult, tmp_path: Path) -> None:
    failed = replace(run.coastdowns[0], estimate=None, failure='too short')
    both = replace(run, coastdowns=(failed, *run.coastdowns))
    write_curves(tmp_path / 'curves.csv', [both])
    with (tmp_path / 'curves.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert {(row['bag'], row['coastdown']) for row in rows} == {('sea trial.mcap', '2')}
    assert run.coastdowns[0].estimate is not None
    curve = run.coastdowns[0].estimate.valid_curve
    for name in (
        'speed_m_s',
        'resistance_m_s2',
        'sigma_m_s2',
        'sigma_repeatable_m_s2',
        'froude',
    ):
        np.testing.assert_array_equal([float(row[name]) for row in rows], getattr(curve, name))


def test_a_name_that_is_a_formula_is_text_and_numbers_are_numbers(
    run: RunResult, tmp_path: Path
) -> None:
    named = replace(run, bag='=HYPERLINK("http://x","y").mcap')
    write_curves(tmp_path / 'curves.csv', [named])
    with (tmp_path / 'curves.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert {row['bag'] for row in rows} == {'\'=HYPERLINK("http://x","y").mcap'}
    assert all(float(row['speed_m_s']) > 0.0 for row in rows)
