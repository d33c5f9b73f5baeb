# SPDX-License-Identifier: Apache-2.0
"""Tables show the estimated figures, not others."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from shipdrag_ros.estimation import tables
from shipdrag_ros.estimation.force import Force
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.replay.run_result import TrueCurve
from shipdrag_ros.ship import Ship, TableBaseline


def test_a_curve_is_shown_at_its_own_points_from_end_to_end(estimate: Estimate) -> None:
    table = tables.curve_table(estimate.valid_curve)
    speeds = [row[0] for row in table.rows]
    assert len(speeds) == 10
    assert speeds[0] == f'{estimate.valid_curve.speed_m_s[0]:.2f}'
    assert speeds[-1] == f'{estimate.valid_curve.speed_m_s[-1]:.2f}'
    assert set(speeds) <= {f'{speed:.2f}' for speed in estimate.valid_curve.speed_m_s}


def test_a_short_curve_repeats_no_point(estimate: Estimate) -> None:
    low = float(estimate.curve.froude[40])
    assert len(tables.curve_table(estimate.curve.between(low, low)).rows) == 1
    assert tables.curve_table(estimate.curve.between(0.5, 0.6)).rows == ()


def test_every_row_has_as_many_decimals(estimate: Estimate) -> None:
    table = tables.curve_table(estimate.valid_curve)
    # the smallest sigma is 0.02 * 1.95^2 / 3000 + 1e-4 = 0.00013
    assert {len(row[2].partition('.')[2]) for row in table.rows} == {5}
    assert table.rows[0][2:] == ('0.00127', '0.00013')
    exact = replace(estimate.valid_curve, sigma_m_s2=0.0 * estimate.valid_curve.sigma_m_s2)
    assert tables.curve_table(exact).rows[0][2:] == ('0.001267', '0.000000')


def test_the_truth_is_not_known_above_its_curve(estimate: Estimate, truth: TrueCurve) -> None:
    short = TrueCurve(truth.speed_m_s[:50], truth.resistance_m_s2[:50], {})
    assert tables.curve_table(estimate.valid_curve, truth=short.at).rows[-1][-2:] == ('-', '-')


def test_the_truth_adds_its_error(estimate: Estimate, truth: TrueCurve) -> None:
    table = tables.curve_table(estimate.valid_curve, truth=truth.at)
    assert table.columns[-1] == 'error [%]'
    # r = v^2 / 3000 against v^2 / 3100
    np.testing.assert_allclose([float(row[-1]) for row in table.rows], 3.3, atol=0.11)


def test_an_engineer_reads_knots_kilonewtons_and_kilowatts(estimate: Estimate, ship: Ship) -> None:
    table = estimate.table(ship)
    assert table.columns == (
        'speed [knots]', 'resistance [kN]', '±', 'effective power [kW]', '±'
    )  # fmt: skip
    for row in (table.rows[0], table.rows[-1]):
        knots, force, _, power, _ = map(float, row)
        assert abs(force - 20705.0 * (knots * 0.51444) ** 2 / 3000.0) < 0.03 * force
        assert abs(power - force * knots * 0.51444) < 0.03 * power


def test_the_clean_hull_is_beside_it_where_it_is_stated(estimate: Estimate, ship: Ship) -> None:
    # twice the resistance below, half of it above; stated from 3 m/s
    clean = TableBaseline((3.0, 9.0), (6.2e4, 1.1e6), 0.02)
    table = estimate.table(replace(ship, baseline=clean))
    assert table.columns[-3:] == ('clean hull [kN]', 'over the clean hull [%]', '±')
    assert table.rows[0][-3:] == ('-', '-', '-')
    known = [row for row in table.rows if row[-1] != '-']
    assert all(0 < float(row[-1]) < 20 for row in known)
    first = float(known[0][1]) / float(known[0][-3]) - 1.0
    assert abs(100.0 * first - float(known[0][-2])) < 1.0
    assert {row[-2][0] for row in known} <= {'+', '-'}


def test_one_speed_in_text_has_one_figure(estimate: Estimate, ship: Ship) -> None:
    one = estimate.valid_curve
    at = np.linspace(0.0, len(one) - 1.0, 5 * len(one))  # nearer to each other than the text tells
    curve = ResistanceCurve(
        *(np.interp(at, np.arange(len(one)), getattr(one, each.name)) for each in fields(one))
    )
    force = Force.of(curve, ship)
    rows = {row[0]: row[1:] for row in tables.force_table(curve, ship).rows}
    headlines = [force.cells(force.near(speed)) for speed in curve.speed_m_s.tolist()]
    assert len(rows) == 10
    beside = [each for each in headlines if each[0].removesuffix(' knots') in rows]
    assert len(beside) > 20
    for speed, resistance, *_ in beside:
        assert resistance == '{} ± {} kN'.format(*rows[speed.removesuffix(' knots')][:2])


def test_without_a_ship_a_curve_is_in_si(estimate: Estimate) -> None:
    assert estimate.table() == tables.curve_table(estimate.valid_curve)
