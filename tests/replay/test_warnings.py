# SPDX-License-Identifier: Apache-2.0
"""What was hardly used is named with its cause; what was used is not mentioned."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown, Event, Regimes, Reset
from shipdrag_ros.messages import Unreadable
from shipdrag_ros.replay import InputCounts, words
from shipdrag_ros.samples import Reason

SURPLUS = Unreadable.SURPLUS_JOINT.value


def told(inputs: dict[str, InputCounts], *events: Event) -> tuple[str, ...]:
    result = SimpleNamespace(
        run=SimpleNamespace(warnings=('torn',)), inputs=inputs, events=events, contradictions={}
    )
    return words.run_warnings(result)  # type: ignore[arg-type]


def test_a_sound_run_keeps_the_warnings_of_its_bag_alone() -> None:
    assert told({'position': InputCounts(100, 60, {'late': 40})}) == ('torn',)


def test_the_most_frequent_reason_is_named_below_half() -> None:
    counts = {'position': InputCounts(100, 49, {'late': 11, 'future': 40})}
    assert told(counts)[1].startswith('position: 51 of 100 messages not used; 40 future: stamped')


def test_joints_that_are_left_out_are_told_though_most_are_used() -> None:
    (_, found) = told(
        {'position': InputCounts(1, 1, {}), 'shaft': InputCounts(9, 36, {SURPLUS: 9})}
    )
    assert found.startswith('shaft: 9 readings left out: joints beyond')


def test_of_several_readings_a_message_half_must_be_used() -> None:
    good = {'position': InputCounts(1, 1, {})}
    assert told(good | {'shaft': InputCounts(9, 18, {'nan': 18})}) == ('torn',)
    (_, found) = told(good | {'shaft': InputCounts(9, 17, {'nan': 19})})
    assert found.startswith('shaft: 19 of 36 readings not used; 19 nan')


def test_nothing_to_estimate_from_is_told() -> None:
    assert '--remap' in told({'heading': InputCounts(9, 9, {})})[1]


def test_resets_are_told_and_many_are_counted() -> None:
    resets = [Reset(1_700_000_000_000_000_000, f'jump {i}') for i in range(5)]
    found = told({'position': InputCounts(1, 1, {})}, *resets)
    assert 'jump 0' in found[1]
    assert found[-1] == 'and 2 more times'


def test_a_record_that_the_model_explains_badly_is_told() -> None:
    nothing = np.zeros(0)
    said = []
    for explained in (0.04, 0.06):
        regimes = Regimes(nothing.astype(np.int64), nothing, {}, 0.0, explained)
        ended = EndedCoastdown(0, 1, None, EndedBy.SPEED, None, '', regimes=regimes)
        said.append(told({'position': InputCounts(1, 1, {})}, ended))
    assert 'only as well as 4% of those' in said[0][1]
    assert said[1] == ('torn',)


def test_every_reason_has_its_cause() -> None:
    reasons = {reason.name.lower() for reason in Reason} - {'accepted'}
    reasons |= {reason.value for reason in Unreadable} | {'type'}
    assert set(words._CAUSE) == reasons
