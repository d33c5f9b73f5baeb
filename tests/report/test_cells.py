# SPDX-License-Identifier: Apache-2.0
"""Tables show the estimated figures, not others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.coastdown.events import Coastdown, Dismissal, EndedBy, NotCoastdown
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.replay import tables as cells
from shipdrag_ros.replay.hulls import rank
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.truth import TrueCurve


def test_a_curve_is_shown_at_its_own_points_from_end_to_end(estimate: Estimate) -> None:
    table = cells.curve_table(estimate.valid_curve)
    speeds = [row[0] for row in table.rows]
    assert len(speeds) == 10
    assert speeds[0] == f'{estimate.valid_curve.speed_m_s[0]:.2f}'
    assert speeds[-1] == f'{estimate.valid_curve.speed_m_s[-1]:.2f}'
    assert set(speeds) <= {f'{speed:.2f}' for speed in estimate.valid_curve.speed_m_s}
    assert len(cells.curve_table(estimate.valid_curve, count=4).rows) == 4


def test_a_short_curve_repeats_no_point(estimate: Estimate) -> None:
    low = float(estimate.curve.froude[40])
    assert len(cells.curve_table(estimate.curve.between(low, low)).rows) == 1
    assert cells.curve_table(estimate.curve.between(0.5, 0.6)).rows == ()


def test_every_row_has_as_many_decimals(estimate: Estimate) -> None:
    table = cells.curve_table(estimate.valid_curve)
    # the smallest sigma is 0.02 * 1.95^2 / 3000 + 1e-4 = 0.00013
    assert {len(row[3].partition('.')[2]) for row in table.rows} == {5}
    assert table.rows[0][3:] == ('0.00127', '0.00013')
    exact = replace(estimate.valid_curve, sigma_m_s2=0.0 * estimate.valid_curve.sigma_m_s2)
    assert cells.curve_table(exact).rows[0][3:] == ('0.001267', '0.000000')


def test_the_truth_is_not_known_above_its_curve(estimate: Estimate, truth: TrueCurve) -> None:
    short = TrueCurve(truth.speed_m_s[:50], truth.resistance_m_s2[:50], {})
    assert cells.curve_table(estimate.valid_curve, truth=short).rows[-1][-2:] == ('-', '-')


def test_the_truth_adds_its_error(estimate: Estimate, truth: TrueCurve) -> None:
    table = cells.curve_table(estimate.valid_curve, truth=truth)
    assert table.columns[-1] == 'error [%]'
    # r = v^2 / 3000 against v^2 / 3100
    np.testing.assert_allclose([float(row[-1]) for row in table.rows], 3.3, atol=0.11)


def test_facts_leave_out_what_is_not_known(coastdown: Coastdown) -> None:
    facts = dict(cells.facts(coastdown).rows)
    assert facts['argmax dr/dFr, as S1 has it'] == 'Fr 0.200'
    names = list(facts)
    assert {'confirmed after', 'estimator', 'coefficients'} <= set(names)
    given = replace(coastdown, onset_detected_ns=None, estimate=None)
    assert [row[0] for row in cells.facts(given).rows] == ['start', 'duration', 'ended because']


def test_facts_show_a_current_and_an_average(coastdown: Coastdown) -> None:
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
    other = replace(run, bag='b.mcap')
    assert [row[0] for row in cells.ranking_table(rank([run, other])).rows] == [
        '1. Vitus Bering sea trial.mcap',
        '2. Vitus Bering b.mcap',
    ]


def test_a_coastdown_is_confirmed_after_it_seemed_to_begin_though_that_was_cut() -> None:
    second = 1_000_000_000
    cut = NotCoastdown(0, 77 * second, Dismissal.THRUST, 'the shaft drives')
    coastdown = Coastdown(
        77 * second, 900 * second, 12 * second, EndedBy.SPEED, None, 'no figure', cuts=(cut,)
    )
    assert ('confirmed after', '12 s') in cells.facts(coastdown).rows
