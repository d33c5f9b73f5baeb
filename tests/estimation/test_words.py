# SPDX-License-Identifier: Apache-2.0
"""Sentences say what the figures say, in the engineer's units first."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from shipdrag_ros.estimation import words
from shipdrag_ros.estimation.force import Force
from shipdrag_ros.estimation.result import Estimate, FroudeMax, ResistanceCurve
from shipdrag_ros.posterior.weather import Knowledge, Reference
from shipdrag_ros.replay.run_result import TrueCurve
from shipdrag_ros.ship import Ship, TableBaseline


def test_every_rule_has_words() -> None:
    assert set(words.FROUDE_MAX_BY) == set(FroudeMax)


def test_the_summary_gives_knots_and_kilowatts_first(estimate: Estimate, ship: Ship) -> None:
    first, missing, last = words.summary(estimate, ship)
    # 0.75 of 8.2 m/s: r = 6.15^2 / 3000 over 20705 t, sigma = 0.02 r + 1e-4
    speed = float(estimate.valid_curve.speed_m_s[84])
    force = 20705.0 * speed**2 / 3000.0
    assert abs(speed - 6.15) < 0.03
    assert first == (
        f'At {speed / 0.5144444:.1f} knots: resistance {force:.0f} ± '
        f'{2.0 * (0.02 * force + 2.0705):.0f} kN, effective power {force * speed:.0f} ± '
        f'{2.0 * (0.02 * force + 2.0705) * speed:.0f} kW. Known from 3.8 to 13.4 knots, of '
        'the ship in the wind and depth of the run, which are not known; ± is two standard '
        'deviations.'
    )
    assert 'states no baseline' in missing
    assert '1.95 to 6.90 m/s' in last
    # sigma / r = 0.02 + 1e-4 / r falls with r: best at the top
    assert 'best at 6.90 m/s: there the specific resistance is 0.01587 ± 0.00083' in last
    assert words.summary(estimate) == (last,)


def test_the_summary_says_what_is_over_the_clean_hull(estimate: Estimate, ship: Ship) -> None:
    speed = np.linspace(1.0, 9.0, 30)
    clean = ship.mass_kg * speed**2 / 3600.0  # the ship needs a fifth more
    baseline = TableBaseline(tuple(speed), tuple(clean), 0.03)
    first, last = words.summary(estimate, replace(ship, baseline=baseline))
    assert '20.0 ± 9.8 % over the clean hull. Known' in first
    assert 'specific resistance' in last
    high = TableBaseline((8.5, 9.0), (1e5, 2e5), 0.03)
    _, why, _ = words.summary(estimate, replace(ship, baseline=high))
    assert 'from 16.5 knots to 17.5 knots and this curve is outside' in why


def test_wind_that_was_read_and_left_in_is_named_and_taken_out(estimate, ship) -> None:
    speed = np.linspace(1.0, 9.0, 30)
    baseline = TableBaseline(tuple(speed), tuple(ship.mass_kg * speed**2 / 3600.0), 0.03)
    calm = replace(estimate.calm, resistance_m_s2=estimate.calm.speed_m_s**2 / 3600.0)
    read = Reference(Knowledge.MEASURED, Knowledge.UNKNOWN)
    parts = {'wind': np.zeros(len(calm.speed_m_s))}
    windy = replace(estimate, calm=calm, reference=read, sigma_parts=parts)
    first, _ = words.summary(windy, replace(ship, baseline=baseline))
    of_run, in_calm = first.split(' In calm deep water, with the wind taken out: ')
    assert '20.0 ± 9.8 % over the clean hull' in of_run
    assert (
        'the wind, which was measured, left in as well as the depth, which is not known' in of_run
    )
    assert '(no difference that shows)' in in_calm
    windy = replace(windy, reference=Reference())
    unread, _ = words.summary(windy, replace(ship, baseline=baseline))
    assert unread.endswith(f' In calm deep water, whatever the weather was: {in_calm}')


def test_a_model_ship_is_told_in_newtons_and_millimetres(estimate: Estimate, ship: Ship) -> None:
    curve = estimate.curve
    slow = replace(estimate, conditions=replace(curve, speed_m_s=0.1 * curve.speed_m_s))
    model = replace(ship, displaced_volume_m3=14.0 / 1025.0)
    first, _, last = words.summary(slow, model)
    assert first.startswith('At 0.615 m/s: resistance 0.1765 ± 0.0099 N, effective power 0.1086 ')
    assert 'from 0.195 to 0.690 m/s' in last


def test_several_coastdowns_are_told_by_their_dates(estimate: Estimate, ship: Ship) -> None:
    later = replace(estimate, start_ns=estimate.start_ns + 86400 * 10**9)
    first, second, missing = words.in_service([estimate, later], ship)
    assert first.startswith('2023-11-14 22:13:20 UTC: At 1')
    assert second.startswith('2023-11-15 22:13:20 UTC: At 1')
    assert 'states no baseline' in missing
    assert words.in_service([replace(estimate, froude_valid=(0.3, 0.3))], ship) == ()


def test_the_top_of_the_fit_is_not_told_for_the_largest_reading(estimate: Estimate) -> None:
    name = 'speed_through_water'
    track = estimate.tracks[name]
    read = np.minimum(track.fitted, 6.5)  # the fit overshoots what was read
    read[100] = 30.0  # one bad reading
    tracks = {name: replace(track, measured=read)}
    notes = ' '.join(words.notes(replace(estimate, tracks=tracks)))
    assert 'the fit ends at 8.20 m/s, speed_through_water (medians of 5 readings) at 6.50 m/s' in (
        notes
    )
    bare = ' '.join(words.notes(replace(estimate, tracks={})))
    assert 'the fit ends at 8.20 m/s.' in bare
    assert 'record itself reaches' not in notes + bare


def test_an_empty_range_promises_nothing(estimate: Estimate, ship: Ship) -> None:
    nothing = replace(estimate, froude_valid=(0.3, 0.3))
    assert words.summary(nothing, ship) == (words.NOTHING_VALID,)


def test_notes_say_what_the_record_cannot_show(estimate: Estimate) -> None:
    notes = ' '.join(words.notes(estimate))
    assert 'A note of the estimator' in notes
    assert 'Nothing is said outside 1.95 to 6.90 m/s' in notes
    assert 'not the error of the polynomial' in notes
    assert 'a current, or a log that reads wrong' in notes

    ground = replace(
        estimate,
        estimator='s1_position',
        samples={'position': 1500},
        froude_max_by=FroudeMax.BRANCH_TOP,
    )
    notes = ' '.join(words.notes(ground))
    assert 'a run on the opposite heading would show' in notes
    assert 'only a lower bound' in notes


def test_residuals_that_do_not_scatter_are_told(estimate: Estimate) -> None:
    # white residuals, N = 1500, seed 5: a correlation above 0.1 has a chance of 1e-4
    assert not any('does not scatter' in note for note in words.notes(estimate))
    assert not any('on average' in note for note in words.notes(estimate))

    speed = estimate.tracks['speed_through_water']
    slow = 0.05 * np.sin(np.arange(len(speed.fitted)) / 50.0)

    def notes_with(measured: np.ndarray) -> str:
        tracks = {**estimate.tracks, 'speed_through_water': replace(speed, measured=measured)}
        other = replace(estimate, tracks=tracks)
        return ' '.join(words.notes(other))

    assert 'leaves of speed_through_water does not scatter' in notes_with(speed.measured + slow)
    assert 'The log reads 0.2 m/s more' in notes_with(speed.fitted + 0.2)
    assert 'm/s more on average' in notes_with(speed.measured + 0.1)
    assert 'm/s less on average' in notes_with(speed.measured - 0.1)
    assert 'scatter' not in notes_with(speed.fitted)


def test_a_ship_that_drifts_astern_is_told(estimate: Estimate) -> None:
    assert not any('through zero' in note for note in words.notes(estimate))
    speed = estimate.tracks['speed_through_water']
    noise = estimate.noise_sd['speed_through_water']
    for lowest, told in ((-1.9 * noise, False), (-2.1 * noise, True)):
        lower = lowest - float(speed.fitted.min())
        moved = replace(speed, measured=speed.measured + lower, fitted=speed.fitted + lower)
        tracks = {**estimate.tracks, 'speed_through_water': moved}
        notes = words.notes(replace(estimate, tracks=tracks))
        assert any('through zero' in note for note in notes) is told


@pytest.mark.parametrize(
    ('estimator', 'order', 'told'),
    [
        ('s1_speed', 2, True),
        ('s1_speed', 3, False),
        ('s1_position', 3, True),
        ('s1_joint', 3, True),
        ('s1_joint', 4, False),
        ('one', None, False),
    ],
)
def test_a_constant_r_is_told_to_be_a_mean(estimate, estimator, order, told):
    other = replace(estimate, estimator=estimator, order=order)
    notes = words.notes(other)
    assert any('its mean, not its shape' in note for note in notes) is told


def test_a_curve_over_ground_is_named_so(estimate: Estimate) -> None:
    assert words.speed_name(estimate) == 'speed through water'
    ground = replace(estimate, samples={'position': 3})
    assert words.speed_name(ground) == 'speed over ground'


def test_an_estimator_is_named_and_explained() -> None:
    assert words.estimator('s1_speed') == 's1_speed: orthogonal polynomial, speed alone'
    assert words.estimator('warped').endswith(words.estimator('one').partition(': ')[2])


def test_notes_know_the_second_of_a_kind(estimate: Estimate) -> None:
    name = 'speed_through_water'
    track = estimate.tracks[name]
    astern = replace(track, fitted=track.fitted - track.fitted.max())
    known = replace(estimate, tracks={name: astern, 'position': estimate.tracks['position']})
    second = replace(
        known,
        tracks={f'{each}_2': track for each, track in known.tracks.items()},
        samples={f'{each}_2': count for each, count in known.samples.items()},
        noise_sd={f'{each}_2': sd for each, sd in known.noise_sd.items()},
    )
    said = [' '.join(words.notes(each)).replace('_2', '') for each in (known, second)]
    for part in ('the fit ends at', 'medians of', 'through zero', 'm/s more on', 'reads wrong by'):
        assert part in said[0]
    assert said[1] == said[0]


def test_a_curve_is_shown_at_its_own_points_from_end_to_end(estimate: Estimate) -> None:
    table = words.curve_table(estimate.valid_curve)
    speeds = [row[0] for row in table.rows]
    assert len(speeds) == 10
    assert speeds[0] == f'{estimate.valid_curve.speed_m_s[0]:.2f}'
    assert speeds[-1] == f'{estimate.valid_curve.speed_m_s[-1]:.2f}'
    assert set(speeds) <= {f'{speed:.2f}' for speed in estimate.valid_curve.speed_m_s}


def test_a_short_curve_repeats_no_point(estimate: Estimate) -> None:
    low = float(estimate.curve.froude[40])
    assert len(words.curve_table(estimate.curve.between(low, low)).rows) == 1
    assert words.curve_table(estimate.curve.between(0.5, 0.6)).rows == ()


def test_every_row_has_as_many_decimals(estimate: Estimate) -> None:
    table = words.curve_table(estimate.valid_curve)
    # the smallest sigma is 0.02 * 1.95^2 / 3000 + 1e-4 = 0.00013
    assert {len(row[2].partition('.')[2]) for row in table.rows} == {5}
    assert table.rows[0][2:] == ('0.00127', '0.00013')
    exact = replace(estimate.valid_curve, sigma_m_s2=0.0 * estimate.valid_curve.sigma_m_s2)
    assert words.curve_table(exact).rows[0][2:] == ('0.001267', '0.000000')


def test_the_truth_is_not_known_above_its_curve(estimate: Estimate, truth: TrueCurve) -> None:
    short = TrueCurve(truth.speed_m_s[:50], truth.resistance_m_s2[:50], {})
    assert words.curve_table(estimate.valid_curve, truth=short.at).rows[-1][-2:] == ('-', '-')


def test_the_truth_adds_its_error(estimate: Estimate, truth: TrueCurve) -> None:
    table = words.curve_table(estimate.valid_curve, truth=truth.at)
    assert table.columns[-1] == 'error [%]'
    # r = v^2 / 3000 against v^2 / 3100
    np.testing.assert_allclose([float(row[-1]) for row in table.rows], 3.3, atol=0.11)


def test_an_engineer_reads_knots_kilonewtons_and_kilowatts(estimate: Estimate, ship: Ship) -> None:
    table = words.force_table(estimate.valid_curve, ship)
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
    table = words.force_table(estimate.valid_curve, replace(ship, baseline=clean))
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
    rows = {row[0]: row[1:] for row in words.force_table(curve, ship).rows}
    headlines = [force.cells(force.near(speed)) for speed in curve.speed_m_s.tolist()]
    assert len(rows) == 10
    beside = [each for each in headlines if each[0].removesuffix(' knots') in rows]
    assert len(beside) > 20
    for speed, resistance, *_ in beside:
        assert resistance == '{} ± {} kN'.format(*rows[speed.removesuffix(' knots')][:2])
