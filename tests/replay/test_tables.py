# SPDX-License-Identifier: Apache-2.0
"""Tables show the estimated figures, not others."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from shipdrag_ros.coastdown.events import Dismissal, EndedBy, EndedCoastdown, NotCoastdown
from shipdrag_ros.replay import tables as cells
from shipdrag_ros.replay.run_result import RunResult, rank
from shipdrag_ros.replay.tables import write_curves
from tests.runs import seen


def test_facts_leave_out_what_is_not_known(coastdown: EndedCoastdown) -> None:
    facts = dict(cells.facts(coastdown).rows)
    assert facts['argmax dr/dFr, as S1 has it'] == 'Fr 0.200'
    names = list(facts)
    assert {'confirmed after', 'estimator', 'coefficients'} <= set(names)
    given = replace(coastdown, onset_detected_ns=None, estimate=None)
    assert [row[0] for row in cells.facts(given).rows] == ['start', 'duration', 'ended because']


def test_facts_show_a_current_and_an_average(coastdown: EndedCoastdown) -> None:
    assert coastdown.estimate is not None
    other = replace(coastdown.estimate, order=None, current_m_s=0.25, current_sigma_m_s=0.02)
    facts = dict(cells.facts(replace(coastdown, estimate=other)).rows)
    assert facts['coefficients'] == 'averaged over models'
    assert facts['current along the track'] == '0.250 ± 0.040 m/s (two standard deviations)'


def test_rejections_are_shown_with_their_reason_and_zeros_are_not(run: RunResult) -> None:
    assert cells.inputs_table(run.inputs).rows == (
        ('speed_through_water', '1503', '1500', '2 nan, 1 late'),
        ('position', '1500', '1500', '-'),
    )


def test_a_ranking_starts_with_the_best(run: RunResult) -> None:
    other = replace(run, run=seen('b.mcap'))
    assert [row[0] for row in cells.ranking_table(rank([run, other])).rows] == [
        '1. test ship sea trial.mcap',
        '2. test ship b.mcap',
    ]


def test_a_coastdown_is_confirmed_after_it_seemed_to_begin_though_that_was_cut() -> None:
    second = 1_000_000_000
    cut = NotCoastdown(0, 77 * second, Dismissal.THRUST, 'the shaft drives')
    coastdown = EndedCoastdown(
        77 * second, 900 * second, 12 * second, EndedBy.SPEED, None, 'no figure', cuts=(cut,)
    )
    assert ('confirmed after', '12 s') in cells.facts(coastdown).rows


def test_coastdowns_are_a_line_each(run: RunResult) -> None:
    (coastdown,) = run.coastdowns
    failed = replace(coastdown, estimate=None, failure='too few samples')
    table = cells.coastdowns_table([replace(run, coastdowns=(coastdown, failed))])
    first, second = table.rows
    assert first[0] == '2023-11-14 22:13:20 UTC'
    assert first[2].endswith('knots')
    assert first[3].endswith('kN')
    assert first[4].endswith('kW')
    assert second[2:] == ('-', '-', '-', '-', 'too few samples')


def test_the_valid_curve_round_trips(run: RunResult, tmp_path: Path) -> None:
    failed = replace(run.coastdowns[0], estimate=None, failure='too short')
    both = replace(run, coastdowns=(failed, *run.coastdowns))
    write_curves(tmp_path / 'curves.csv', [both])
    with (tmp_path / 'curves.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert {(row['bag'], row['coastdown']) for row in rows} == {('sea trial.mcap', '2')}
    assert run.coastdowns[0].estimate is not None
    curve = run.coastdowns[0].estimate.valid_curve
    for name in ('speed_m_s', 'resistance_m_s2', 'sigma_m_s2', 'sigma_repeatable_m_s2', 'froude'):
        np.testing.assert_array_equal([float(row[name]) for row in rows], getattr(curve, name))


def test_a_name_that_is_a_formula_is_text_and_numbers_are_numbers(run, tmp_path):
    named = replace(run, run=seen('=HYPERLINK("http://x","y").mcap'))
    write_curves(tmp_path / 'curves.csv', [named])
    with (tmp_path / 'curves.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert {row['bag'] for row in rows} == {'\'=HYPERLINK("http://x","y").mcap'}
    assert all(float(row['speed_m_s']) > 0.0 for row in rows)
