# SPDX-License-Identifier: Apache-2.0
"""Sentences say what the figures say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown.events import Coastdown, EndedBy
from shipdrag_ros.estimation.result import FroudeMax
from shipdrag_ros.replay import Recorded, words
from shipdrag_ros.ship import Ship


def test_every_end_and_every_rule_has_words() -> None:
    assert set(words.ENDED_BY) == set(EndedBy)
    assert set(words.FROUDE_MAX_BY) == set(FroudeMax)


def test_the_sentence_gives_range_figure_and_force(coastdown: Coastdown, ship: Ship) -> None:
    sentence = words.result_sentence(coastdown, mass_kg=ship.mass_kg)
    assert '1.95 to 6.90 m/s (3.8 to 13.4 knots)' in sentence
    # sigma / r = 0.02 + 1e-4 / r falls with r: best at the top
    assert 'best at 6.90 m/s: there the specific resistance is 0.01587 ± 0.00083' in sentence
    assert '329 ± 17 kN' in sentence
    assert 'kN' not in words.result_sentence(coastdown)


def test_the_top_of_the_fit_is_not_told_for_the_largest_reading(coastdown: Coastdown) -> None:
    estimate = coastdown.estimate
    assert estimate is not None
    name = 'speed_through_water'
    track = estimate.tracks[name]
    read = np.minimum(track.fitted, 6.5)  # the fit overshoots what was read
    read[100] = 30.0  # one bad reading
    tracks = {name: replace(track, measured=read)}
    notes = ' '.join(words.notes(replace(coastdown, estimate=replace(estimate, tracks=tracks))))
    assert 'the fit ends at 8.20 m/s, speed_through_water (medians of 5 readings) at 6.50 m/s' in (
        notes
    )
    bare = ' '.join(words.notes(replace(coastdown, estimate=replace(estimate, tracks={}))))
    assert 'the fit ends at 8.20 m/s.' in bare
    assert 'record itself reaches' not in notes + bare


def test_a_model_ship_is_told_in_newtons_and_millimetres(coastdown: Coastdown) -> None:
    assert coastdown.estimate is not None
    curve = coastdown.estimate.curve
    slow = replace(coastdown.estimate, curve=replace(curve, speed_m_s=0.1 * curve.speed_m_s))
    sentence = words.result_sentence(replace(coastdown, estimate=slow), mass_kg=14.0)
    assert 'from 0.195 to 0.690 m/s' in sentence
    assert '0.222 ± 0.012 N.' in sentence


def test_the_sentence_of_a_failure_gives_its_reason(coastdown: Coastdown) -> None:
    failed = replace(coastdown, estimate=None, failure='too few samples')
    assert 'too few samples' in words.result_sentence(failed)
    assert words.notes(failed) == ()


def test_the_sentence_of_an_empty_range_promises_nothing(coastdown: Coastdown) -> None:
    assert coastdown.estimate is not None
    empty = replace(coastdown, estimate=replace(coastdown.estimate, froude_valid=(0.3, 0.3)))
    assert 'No speed' in words.result_sentence(empty)


def test_notes_say_what_the_record_cannot_show(coastdown: Coastdown) -> None:
    assert coastdown.estimate is not None
    notes = ' '.join(words.notes(coastdown))
    assert 'A note of the estimator' in notes
    assert 'Nothing is said outside 1.95 to 6.90 m/s' in notes
    assert 'not the error of the polynomial' in notes
    assert 'a current, or a log that reads wrong' in notes

    ground = replace(
        coastdown,
        estimate=replace(
            coastdown.estimate,
            estimator='s1_position',
            samples={'position': 1500},
            froude_max_by=FroudeMax.BRANCH_TOP,
        ),
    )
    notes = ' '.join(words.notes(ground))
    assert 'a run on the opposite heading would tell' in notes
    assert 'only a lower bound' in notes


def test_residuals_that_do_not_scatter_are_told(coastdown: Coastdown) -> None:
    estimate = coastdown.estimate
    assert estimate is not None
    # white residuals, N = 1500, seed 5: a correlation above 0.1 has a chance of 1e-4
    assert not any('does not scatter' in note for note in words.notes(coastdown))
    assert not any('on average' in note for note in words.notes(coastdown))

    speed = estimate.tracks['speed_through_water']
    slow = 0.05 * np.sin(np.arange(len(speed.fitted)) / 50.0)

    def notes_with(measured: np.ndarray) -> str:
        tracks = {**estimate.tracks, 'speed_through_water': replace(speed, measured=measured)}
        other = replace(coastdown, estimate=replace(estimate, tracks=tracks))
        return ' '.join(words.notes(other))

    assert 'leaves of speed_through_water does not scatter' in notes_with(speed.measured + slow)
    assert 'The log reads 0.2 m/s more' in notes_with(speed.fitted + 0.2)
    assert 'm/s more on average' in notes_with(speed.measured + 0.1)
    assert 'm/s less on average' in notes_with(speed.measured - 0.1)
    assert 'scatter' not in notes_with(speed.fitted)


def test_a_ship_that_drifts_astern_is_told(coastdown: Coastdown) -> None:
    estimate = coastdown.estimate
    assert estimate is not None
    assert not any('through zero' in note for note in words.notes(coastdown))
    speed = estimate.tracks['speed_through_water']
    noise = estimate.noise_sd['speed_through_water']
    for lowest, told in ((-1.9 * noise, False), (-2.1 * noise, True)):
        lower = lowest - float(speed.fitted.min())
        moved = replace(speed, measured=speed.measured + lower, fitted=speed.fitted + lower)
        tracks = {**estimate.tracks, 'speed_through_water': moved}
        notes = words.notes(replace(coastdown, estimate=replace(estimate, tracks=tracks)))
        assert any('through zero' in note for note in notes) is told


@pytest.mark.parametrize(
    ('estimator', 'order', 'told'),
    [
        ('s1_speed', 2, True),
        ('s1_speed', 3, False),
        ('s1_position', 3, True),
        ('s1_joint', 3, True),
        ('s1_joint', 4, False),
        ('log_time', 3, False),
        ('ode_fit', None, False),
    ],
)
def test_a_constant_r_is_told_to_be_a_mean(
    coastdown: Coastdown, estimator: str, order: int | None, told: bool
) -> None:
    assert coastdown.estimate is not None
    other = replace(coastdown.estimate, estimator=estimator, order=order)
    notes = words.notes(replace(coastdown, estimate=other))
    assert any('its mean, not its shape' in note for note in notes) is told


def test_a_curve_over_ground_is_named_so(coastdown: Coastdown) -> None:
    assert coastdown.estimate is not None
    assert words.speed_name(coastdown.estimate) == 'speed through water'
    ground = replace(coastdown.estimate, samples={'position': 3})
    assert words.speed_name(ground) == 'speed over ground'


def test_a_ship_is_one_line(ship: Ship) -> None:
    assert words.ship_line(ship) == (
        'Vitus Bering: length 150 m, displacement 20200 m³ (20,705 t)'
    )
    model = replace(ship, name='', length_m=1.1, displaced_volume_m3=0.0142)
    assert words.ship_line(model).endswith('displacement 0.0142 m³ (14.56 kg)')


def test_the_comparison_with_the_bag_is_said() -> None:
    assert 'no outputs' in words.recorded_sentence(Recorded(0, 0, None))
    assert 'All 7 outputs' in words.recorded_sentence(Recorded(7, 7, None))
    differs = words.recorded_sentence(Recorded(7, 6, '/coastdown_node/speed at 12 ns', 0.1))
    assert '6 of 7' in differs
    assert 'first difference: /coastdown_node/speed at 12 ns' in differs
    rounding = words.recorded_sentence(Recorded(7, 6, 'x', 3e-14))
    assert 'more than 3e-14 of its value' in rounding


def test_an_estimator_is_named_and_explained() -> None:
    assert words.estimator('s1_speed') == 's1_speed: orthogonal polynomial, speed alone'
    assert words.estimator('warped').endswith(words.estimator('log_time').partition(': ')[2])
