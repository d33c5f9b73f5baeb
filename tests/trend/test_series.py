# SPDX-License-Identifier: Apache-2.0
"""Rows of the store at one speed."""

import numpy as np
import pytest

from shipdrag_ros.trend.series import series_of
from tests.trend.conftest import row


def test_value_over_the_clean_hull_at_three_quarters_of_the_stop():
    series = series_of('Test', [row(0.0, 0.1), row(30.0, 0.2)])
    assert series.reference_speed_m_s == pytest.approx(6.0)
    assert [point.value for point in series.points] == pytest.approx([0.1, 0.2], abs=1e-3)
    assert series.points[0].sd == pytest.approx(0.03, rel=0.01)
    assert series.points[0].sd_repeatable == pytest.approx(0.01, rel=0.01)
    assert series.clean_force_n == pytest.approx(1e-3 * 36.0 * 1.025e6, rel=1e-3)


def test_service_speed_is_taken_and_one_out_of_range_is_told():
    assert series_of('Test', [row()], service_speed_m_s=5.0).reference_speed_m_s == 5.0
    series = series_of('Test', [row()], service_speed_m_s=9.5)
    assert series.reference_speed_m_s == pytest.approx(6.0)
    assert 'service speed of 9.50 m/s lies outside' in series.notes[0]


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'error': 'withdrawn: brake'}, 'withdrawn: brake'),
        ({'time_ns': 12_000_000_000}, 'its clock was not set: the date is before 1990'),
        ({'resistance_m_s2': [None] * 46}, 'no estimate of r(v)'),
        ({'clean_m_s2': None}, 'its ship file has no baseline at the reference speed'),
    ],
)
def test_what_is_not_used_says_why(changes, reason):
    series = series_of('Test', [row(0.0), row(1.0), row(2.0, **changes)])
    [left] = [point for point in series.points if not point.used]
    assert left.reason == reason


def test_one_time_of_one_ship_is_one_run_of_which_the_longest_is_used():
    hour = 3600 * 10**9
    whole, half, late = row(0.0), row(0.0, 0.2), row(0.0, 0.3)
    whole |= {'end_ns': whole['time_ns'] + hour, 'bag': 'whole'}
    half |= {'end_ns': whole['time_ns'] + hour // 2, 'bag': 'half'}
    late |= {'time_ns': whole['time_ns'] + hour // 2, 'end_ns': whole['time_ns'] + hour}
    copy = whole | {'bag': 'a copy', 'water_temperature_c': 9.0}  # says more: it is used
    after = row(1.0) | {'time_ns': whole['end_ns'], 'end_ns': whole['end_ns'] + hour}
    series = series_of('Test', [half, whole, late, after, copy])
    assert [point.bag for point in series.used] == ['a copy', '1.0.mcap']
    assert {point.reason for point in series.points if not point.used} == {
        'recorded at the same time as a copy: one run, counted once'
    }


def test_a_run_years_from_all_others_has_a_wrong_clock():
    rows = [row(15.0 * number) for number in range(6)]
    assert all(point.used for point in series_of('Test', rows).points)
    first, *others = series_of('Test', [row(-4000.0), *rows]).points
    assert 'years from every other run: a wrong clock' in first.reason
    assert all(point.used for point in others)
    # a second season is no wrong clock
    later = [row(900.0 + 15.0 * number) for number in range(3)]
    assert all(point.used for point in series_of('Test', rows + later).points)
    # nor is a coastdown every other year
    rare = [row(700.0 * number) for number in range(6)]
    assert all(point.used for point in series_of('Test', rare).points)


def test_two_runs_of_one_wrong_clock_are_no_step():
    rows = [row(15.0 * number) for number in range(20)]
    first, second, *others = series_of('Test', [row(-4000.0), row(-3990.0), *rows]).points
    assert 'is 10.9 years from all but 2 runs: a wrong clock' in second.reason
    assert first.reason
    assert all(point.used for point in others)
    # two runs in another season are none
    late = [row(900.0), row(910.0)]
    assert all(point.used for point in series_of('Test', rows + late).points)


def test_without_a_baseline_the_first_months_are_the_clean_hull():
    rows = [row(day, added, clean_m_s2=None) for day, added in ((0, 0.1), (10, 0.1), (300, 0.32))]
    rows.append(rows[0] | {'bag': 'copy'})
    series = series_of('Test', rows)
    assert series.clean == 'first months'
    assert series.points[-1].value == pytest.approx(1.32 / 1.1 - 1.0, abs=1e-3)
    [left] = [point for point in series.points if not point.used]  # r itself is no value of it
    assert abs(left.value) < 0.01
    assert 'mean of the first 2 run(s)' in series.notes[0]


def test_displacement_and_temperature_count_against_their_mean():
    rows = [
        row(0, displaced_volume_m3=900.0, water_temperature_c=5.0),
        row(1, displaced_volume_m3=1100.0, water_temperature_c=25.0),
    ]
    first, second = series_of('Test', rows).points
    assert first.covariates[0] == pytest.approx(-second.covariates[0])
    assert second.covariates[0] == pytest.approx(0.5 * np.log(1100.0 / 900.0))
    assert second.covariates[1] == pytest.approx(0.02)


def test_no_rows_at_all():
    series = series_of('Test', [row(error='no estimate was possible', resistance_m_s2=None)])
    assert np.isnan(series.reference_speed_m_s)
    assert series.used == ()


def test_runs_of_another_ship_of_the_same_name_are_not_used():
    rows = [row(30.0 * number) for number in range(5)] + [row(200.0, length_m=120.0)]
    series = series_of('Test', rows)
    assert len(series.used) == 5
    assert 'length of 120 m, most runs of this name have 80 m' in series.points[-1].reason
