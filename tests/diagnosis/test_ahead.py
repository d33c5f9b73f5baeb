# SPDX-License-Identifier: Apache-2.0
"""What a coastdown would show is said before it, by the instruments as they are."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis import diagnose
from shipdrag_ros.diagnosis.ahead import CoastAhead, look_ahead
from shipdrag_ros.display import M_S_PER_KNOT, utc
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from tests.runs import CARGO as SHIP
from tests.runs import coasted


def lead_of(**options: object) -> Window:
    before = coasted(speed_m_s=8.0, lead_in_s=1800.0, **options).window.before  # type: ignore[arg-type]
    assert before is not None
    return before


def least(found: CoastAhead, name: str) -> float:
    size = found.found.limits[name].would_be_named
    assert size is not None
    return size


def test_sizes_said_before_are_those_found_after() -> None:
    """
    Of two runs (seeds 1 and 2) of the same ship; they have no slow disturbances, which are usual.
    """
    ahead = look_ahead(lead_of(), SHIP, Parameters())
    assert ahead.speed_m_s == pytest.approx(8.0, rel=0.01)
    for seed in (1, 2):
        run = coasted(speed_m_s=8.0, lead_in_s=1800.0, coast_s=ahead.duration_s, seed=seed)
        after = diagnose([run], SHIP, Parameters(), advise=False)
        for name in ('current', 'log_scale', 'log_offset', 'log_lag', 'locked_propeller'):
            found = after.limits[name].would_be_named
            assert found is not None, name
            assert 0.7 < least(ahead, name) / found < 1.8, name
    knots = f'{ahead.speed_m_s / M_S_PER_KNOT:.1f} knots'
    assert ahead.sentence.startswith(f'A coastdown from {knots}, ')
    assert 'would name, nine times in ten' in ahead.sentence
    assert 'if the hull is clean, rule out fouling above' in ahead.sentence
    assert ahead.sentence.endswith(f'(as of {utc(lead_of().end_ns)}).')


def test_worse_and_fewer_instruments_show_less() -> None:
    good, noisy = (look_ahead(lead_of(noise=noise), SHIP, Parameters()) for noise in (1.0, 6.0))
    assert least(noisy, 'log_lag') > 1.3 * least(good, 'log_lag')
    log = look_ahead(lead_of(inputs=('speed_through_water',)), SHIP, Parameters())
    assert 'radar_scale' in good.found.limits
    assert 'radar_scale' not in log.found.limits
    assert log.found.limits['current'].value > 3.0 * good.found.limits['current'].value


def test_an_instrument_that_has_ceased_shows_nothing() -> None:
    lead = lead_of()
    ceased = replace(lead, speed_through_water=lead.speed_through_water[:900])
    assert 'log_scale' not in look_ahead(ceased, SHIP, Parameters()).found.limits


def test_in_shallow_water_that_is_sounded_nothing_else_is_missing() -> None:
    lead = lead_of(inputs=('speed_through_water', 'position', 'heading', 'shaft', 'depth'))
    low = replace(lead.depth, value=lead.depth.value - np.median(lead.depth.value) + 12.0)
    found = look_ahead(replace(lead, depth=low), SHIP, Parameters()).found
    assert found.candidates[0].names == ('shallow_water',)
    under_keel = replace(low, value=low.value - 10.0)
    assert look_ahead(replace(lead, depth=under_keel), SHIP, Parameters()).sentence


def test_a_coarse_display_shows_no_more_than_the_log_behind_it() -> None:
    lead = lead_of(noise=0.4)
    log = lead.speed_through_water
    shown = replace(log, value=np.round(log.value / 0.1) * 0.1)
    fine, coarse = (
        look_ahead(replace(lead, speed_through_water=each), SHIP, Parameters())
        for each in (log, shown)
    )
    assert least(coarse, 'log_lag') > 0.9 * least(fine, 'log_lag')


def test_positions_alone_tell_the_speed() -> None:
    ahead = look_ahead(lead_of(inputs=('position',)), SHIP, Parameters())
    assert ahead.speed_m_s == pytest.approx(8.0, rel=0.02)


def test_without_a_speed_nothing_is_foretold() -> None:
    lead = lead_of()
    lead = replace(
        lead, speed_through_water=lead.speed_through_water[:5], position=lead.position[:5]
    )
    with pytest.raises(DiagnosisError, match='no input has told the speed 12 times in the last 2'):
        look_ahead(lead, SHIP, Parameters())


@pytest.mark.parametrize('convention', ['rep103', 'compass'])
def test_no_heading_and_no_convention_of_it_shows_less(convention: str) -> None:
    """To the west the yaw jumps by a turn, from reading to reading."""
    east, west = (
        look_ahead(lead_of(heading_rad=heading), SHIP, parameters)
        for heading, parameters in (
            (0.0, Parameters()),
            (math.pi, Parameters(heading_convention=convention)),
        )
    )
    for name, limit in east.found.limits.items():
        assert west.found.limits[name].value == pytest.approx(limit.value, rel=0.2), name


def test_too_slow_for_any_reading_is_said() -> None:
    with pytest.raises(DiagnosisError, match='which is that of froude_min'):
        look_ahead(coasted(speed_m_s=0.5).window.before, SHIP, Parameters())  # type: ignore[arg-type]
