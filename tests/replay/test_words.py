# SPDX-License-Identifier: Apache-2.0
"""Sentences say what the figures say."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.coastdown import given
from shipdrag_ros.coastdown.events import (
    ENDED_BY,
    Dismissal,
    EndedBy,
    EndedCoastdown,
    Event,
    InputCounts,
    Regimes,
    Reset,
)
from shipdrag_ros.estimation import words as estimate_words
from shipdrag_ros.messages import Unreadable
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import (
    Recorded,
    ReplayResult,
    replay,
    why_no_coastdown,
    words,
)
from shipdrag_ros.replay.words import ended
from shipdrag_ros.samples import Block, Channel, Reason
from shipdrag_ros.ship import ConstantAddedMass, Ship
from tests.runs import write_run


def test_every_end_has_words() -> None:
    assert set(ENDED_BY) == set(EndedBy)


def test_the_comparison_with_the_bag_is_said() -> None:
    assert 'it holds none, or was replayed' in words.recorded_sentence(Recorded(0, 0, None))
    assert 'All 7 outputs' in words.recorded_sentence(Recorded(7, 7, None))
    differs = words.recorded_sentence(Recorded(7, 6, '/coastdown_node/speed at 12 ns', 0.1))
    assert '6 of 7' in differs
    assert 'first difference: /coastdown_node/speed at 12 ns' in differs
    rounding = words.recorded_sentence(Recorded(7, 6, 'x', 3e-14))
    assert 'more than 3e-14 of its value' in rounding


def test_what_was_not_compared_is_not_said_to_be_alike() -> None:
    old = Recorded(9, 2, 'recorded 1.0, replayed nothing', np.inf, 0.0, '0.0.1', beside=2)
    some, none = (words.recorded_sentence(replace(old, beside=both)) for both in (2, 0))
    assert 'of 2 in both the estimates differ by 0 standard deviations at most' in some
    assert '7 are in the bag or the replay alone' in some
    assert 'standard deviations' not in none
    assert '9 are in the bag or the replay alone' in none


def test_a_coastdown_without_estimate_gives_its_reason(coastdown, ship):
    failed = replace(coastdown, estimate=None, failure='too few samples')
    assert words.summary(failed, ship) == ('No resistance could be estimated: too few samples.',)
    assert coastdown.estimate is not None
    assert words.summary(coastdown, ship) == estimate_words.summary(coastdown.estimate, ship)


SURPLUS = Unreadable.SURPLUS_JOINT.value


def told(
    inputs: dict[str, InputCounts], *events: Event, coastdowns: tuple[str, ...] = ('one',)
) -> tuple[str, ...]:
    result = SimpleNamespace(
        run=SimpleNamespace(warnings=('torn',)),
        inputs=inputs,
        events=events,
        coastdowns=coastdowns,
        contradictions={},
    )
    return words.run_warnings(result)  # type: ignore[arg-type]


def test_a_sound_run_keeps_the_warnings_of_its_bag_alone() -> None:
    assert told({'position': InputCounts(100, 60, {'late': 40})}) == ('torn',)


def test_the_most_frequent_reason_is_named_below_half() -> None:
    counts = {'position': InputCounts(100, 49, {'late': 11, 'future': 40})}
    assert told(counts)[1].startswith('position: 51 of 100 messages not used; 40 future: stamped')


def test_a_tenth_that_is_bad_is_named_where_no_coastdown_is_found() -> None:
    counts = {'position': InputCounts(100, 89, {'outlier': 11})}
    assert told(counts) == ('torn',)
    (_, found) = told(counts, coastdowns=())
    assert found.startswith('position: 11 of 100 messages not used; 11 outlier: impossible')


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


START_NS = 10**18


def log(speed: np.ndarray, step_s: float = 1.0) -> Block:
    stamps = START_NS + np.round(np.arange(len(speed)) * step_s * 1e9).astype(np.int64)
    return Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed)


def replayed(path: Path, block: Block, ship: Ship, **options: object) -> ReplayResult:
    (run,) = open_runs([write_run(path / 'a.mcap', block)])
    return replay(run, ship=ship, **options)


def test_a_small_craft_that_slowed_in_seconds_is_said_to(tmp_path: Path) -> None:
    craft = Ship(length_m=4.5, displaced_volume_m3=1.4, added_mass=ConstantAddedMass(value=0.1))
    time_s = np.arange(0.0, 38.0, 0.01)
    speed = np.interp(time_s, [0.0, 10.0, 15.0, 38.0], [0.0, 0.0, 12.0, 0.5])
    speed += np.random.default_rng(1).normal(0.0, 0.02, len(speed))
    short = Parameters(slope_window_s=5.0, froude_min=0.01)
    why = why_no_coastdown(replayed(tmp_path, log(speed, 0.01), craft, parameters=short))
    assert 'never fell' not in why
    assert 'fell most from 11' in why


def test_a_record_that_begins_in_a_glide_is_said_to(tmp_path: Path, voyage, ship: Ship) -> None:
    block = voyage()
    block = block[block.stamp_ns >= block.stamp_ns[0] + 410 * 10**9]
    shaft = block.channel == Channel.SHAFT
    value = block.value.copy()
    # it stands, read with noise
    left = 0.8 * np.exp(-np.arange(shaft.sum()) / 8.0)
    value[shaft, 0] = left + np.random.default_rng(7).normal(0.0, 0.03, shaft.sum())
    result = replayed(tmp_path, replace(block, value=value), ship)
    assert not result.coastdowns
    assert {each.reason for each in result.not_coastdowns} == {Dismissal.LEAD_IN}
    texts = [each.text for each in result.not_coastdowns]
    assert any('no steady sailing is seen before it' in text for text in texts)
    assert any('--window START END' in text for text in texts)


def test_no_minimum_speed_is_reached_above_it(tmp_path: Path) -> None:
    cargo = Ship.load(Path(str(files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')))
    speed = np.where(np.arange(700) < 400, 6.0, 3.0)
    speed += np.random.default_rng(1).normal(0.0, 0.03, len(speed))
    result = replayed(tmp_path, log(speed), cargo)
    ended = [each for each in result.events if isinstance(each, EndedCoastdown)]
    assert EndedBy.SPEED not in {each.ended_by for each in ended}


def test_nothing_is_made_of_a_gap(tmp_path: Path, voyage, ship: Ship) -> None:
    block = voyage(coast_s=1200.0)
    second = (block.stamp_ns - block.stamp_ns[0]) / 1e9
    result = replayed(tmp_path, block[(second < 500.0) | (second >= 1000.0)], ship)
    before, after = result.coastdowns
    assert before.ended_by is EndedBy.DATA_STOP
    assert (after.start_ns - block.stamp_ns[0]) / 1e9 == pytest.approx(1000.0, abs=5.0)
    (cut,) = after.cuts
    assert (cut.start_ns, cut.end_ns) == (before.end_ns, after.start_ns)
    assert cut.reason is Dismissal.GAP
    assert 'nothing was read' in cut.text


@pytest.mark.parametrize(
    ('gap_s', 'sails_s'),
    [((1300, 1420), 2800), ((1210, 1900), 2800), ((1210, 1900), 2400), ((1300, 1900), 1900)],
)
def test_the_rest_after_a_gap_is_found_or_asked_for(tmp_path, ship: Ship, gap_s, sails_s) -> None:
    second, rng = np.arange(2800), np.random.default_rng(0)
    speed, gust = np.full(len(second), 7.0), 0.0
    for k in range(1, len(speed)):
        gust = 0.975 * gust + 1.4e-4 * rng.normal()  # correlated over 40 s
        drag = 2.6e-4 * (speed[k - 1] ** 2 - 49.0 * (k <= 1200))
        speed[k] = speed[k - 1] + (gust - drag) / 1.05
    speed[sails_s:] = 6.0
    speed += rng.normal(0.0, 0.04, len(speed))
    block = log(speed)[(second < gap_s[0]) | (second > gap_s[1])]
    result = replayed(tmp_path, block, ship)
    told = [each for each in result.coastdowns if each.ended_by is EndedBy.DATA_STOP]
    ends_s = [(each.end_ns - block.stamp_ns[0]) / 1e9 for each in result.coastdowns]
    assert not any(gap_s[0] < end_s < gap_s[1] for end_s in ends_s)
    said = ' '.join(words.run_warnings(result))
    rest = [each for each in result.coastdowns if each.cuts]
    # ten seconds of a glide, then nothing: all of it is found, or that a lower level is as likely
    if not told and gap_s == (1210, 1900):
        assert any(abs(end_s - sails_s) < 60.0 for end_s in ends_s) or (
            'P(gliding)' in result.not_coastdowns[0].text
        )
        return
    assert told
    if gap_s[1] < 1500:
        assert rest
        assert 'the readings of speed ceased for' not in said
    else:
        asked = [float(each) for each in re.findall(r'--window 1901 (\S+)', said)]
        glides = [pytest.approx(sails_s, abs=60.0)] if sails_s > gap_s[1] else []
        assert rest or asked == glides
        assert rest or 'and no rest of it was found' in said


def test_a_glide_that_is_too_slow_is_not_said_to_be_at_rest() -> None:
    judge = SimpleNamespace(_binned=SimpleNamespace(speed=np.array([1.9, 1.8])), _slow=3.1)
    reason, text = given._Judge._why(judge, 0, 2, given.GLIDES, None)
    assert reason is Dismissal.SLOW
    assert text == 'she is slower than 3.1 m/s, too slow for a coastdown: 1.9 m/s at most'


def test_thrust_after_a_glide_is_no_reduced_power_and_its_probability_is_said(tmp_path, ship):
    speed = np.full(2700, 6.0)
    for k in range(901, len(speed)):
        thrust = 0.0 if k < 1500 else 1.2e-3
        speed[k] = speed[k - 1] - 2.4e-4 * speed[k - 1] ** 2 + thrust
    result = replayed(tmp_path, log(np.round(speed / 0.0514444) * 0.0514444), ship)
    assert result.coastdowns
    for coastdown in result.coastdowns:
        assert re.search(r'drove the ship again \(P [01]\.\d+\)', ended(coastdown))
    assert [each.reason for each in result.not_coastdowns] == [Dismissal.THRUST]
