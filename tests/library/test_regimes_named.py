# SPDX-License-Identifier: Apache-2.0
"""A turn that ended a run, a slow thrust, a unit taken for another: all are said."""

from __future__ import annotations

from dataclasses import replace

import pytest

import shipdrag_ros as sd
from shipdrag_ros.diagnosis import words
from shipdrag_ros.ship.sections import NO_CLEAN_HULL

SHIP = sd.Ship.example()


def test_a_turn_that_ended_the_run_is_named_with_its_size() -> None:
    turn = {'drag_area_m2': 0.03, 'start_s': 340.0, 'duration_s': 200.0, 'rate_rad_s': 0.006}
    record = sd.simulate(SHIP, {'turning': turn}, seed=3)
    coastdown, *_ = record.coastdowns()
    assert coastdown.ended_by == 'turn'
    found = sd.diagnose(record)
    (effect,) = found.found.effects
    assert effect.name == 'turning'
    start, rate = effect.parameters['start_s'], effect.parameters['rate_rad_s']
    assert abs(start.value - 340.0) < 3.0 * start.sd + 5.0
    assert rate.value == pytest.approx(0.006, rel=0.1)
    assert any('the ship turned in a part of it' in note for note in found.found.notes)


def test_a_thrust_that_ran_down_slowly_is_named_with_its_size() -> None:
    record = sd.simulate(SHIP, {'residual_thrust': {'decay_s': 50.0, 'fraction': 0.9}}, seed=3)
    found = sd.diagnose(record)
    (effect,) = found.found.effects
    assert effect.name == 'residual_thrust'
    # the impulse of the thrust is what the motion shows
    size = effect.parameters
    assert size['decay_s'].value * size['fraction'].value == pytest.approx(45.0, rel=0.15)
    (said,) = (note for note in found.found.notes if 'the shaft ran down in' in note)
    assert float(said.split('ran down in ')[1].split(' s')[0]) == pytest.approx(50.0, rel=0.1)


def test_without_a_clean_hull_that_is_said_first() -> None:
    record = sd.simulate(SHIP, {'fouling': 0.4}, seed=3)
    found = sd.diagnose(record, ship=replace(SHIP, baseline=None))
    said = words.sentence(found.found)
    assert said.startswith(NO_CLEAN_HULL)
    assert 'othing else is missing' in said
    assert found.verdict in ('none', 'one_of')  # .9 decides between them; neither is of the hull
    assert ('fouling',) in [each.names for each in found.found.candidates]


def test_nothing_missing_is_followed_by_what_would_have_been_seen() -> None:
    found = sd.diagnose(sd.simulate(SHIP, seed=3)).found
    assert found.verdict == 'none'
    assert any('the shaft ran down in 8' in note for note in found.notes)  # as she states it
    assert (
        'These runs would have named, nine times in ten, other parameters as usual: '
        in words.sentence(found)
    )
    fouling, depth = found.limits['fouling'], found.limits['shallow_water']
    # 2 % friction and half a per cent of shape are known of the clean hull
    assert 0.02 < fouling.value < 0.3
    assert fouling.bound == 'upper_95'
    assert 2.0 < fouling.percent_of_r < 25.0
    assert depth.bound == 'lower_95'
    assert found.limits['displacement'].would_be_named is None
