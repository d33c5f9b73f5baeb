# SPDX-License-Identifier: Apache-2.0
"""A coastdown is handed on whole where the clock of the log is off; why there is none is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.coastdown.events import EndedBy
from shipdrag_ros.errors import BagError
from shipdrag_ros.replay import (
    accepted_samples,
    clocks_apart,
    coast_windows,
    replay,
    why_no_coastdown,
)
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship
from tests.runs import write_run

START_NS = 1_700_000_000_000_000_000
S = 1_000_000_000
LOG = Channel.SPEED_THROUGH_WATER
STOP_S = 400.0
BOAT = Ship(length_m=10.0, displaced_volume_m3=5.0, added_mass=ConstantAddedMass(value=0.1))
STAMPS = 10**18 + np.arange(1800) * 10**9


def with_clock(block: Block, offset_s: float, *, silent_s: tuple[float, float]) -> Block:
    """Set the clock of the log, which says nothing for a while; fixes become rare."""
    log = block.channel == LOG
    second = (block.stamp_ns - START_NS) / S
    silent = log & (second > silent_s[0]) & (second < silent_s[1])
    rare = (block.channel == Channel.POSITION) & (np.round(second) % 60 != 0)
    stamps = block.stamp_ns + np.where(log, round(offset_s * S), 0)
    return in_arrival_order([replace(block, stamp_ns=stamps)[~silent & ~rare]])


@pytest.mark.parametrize('shaft', [True, False])
@pytest.mark.parametrize('offset_s', [-36.0, -9.0, 9.0])
def test_a_log_whose_clock_is_off_is_heard(ship, parameters, voyage, tmp_path, offset_s, shaft):
    block = with_clock(voyage(), offset_s, silent_s=(600.0, 640.0))
    if not shaft:
        block = block[block.channel != Channel.SHAFT]
    (run,) = open_runs([write_run(tmp_path / 'apart.mcap', block, ship=ship)])
    result = replay(run, parameters=parameters)
    counts = result.inputs['speed_through_water']
    assert counts.rejected['late' if offset_s < 0.0 else 'future'] > 0.9 * counts.messages
    assert result.coastdowns == ()

    assert clocks_apart(result) == ('speed_through_water',)
    ((coastdown, window),) = coast_windows(result)
    assert coastdown.ended_by is EndedBy.RECORD_END  # the clock is not silence
    assert coastdown.estimate is None
    # the speed falls by the clock of the log, the shaft stops by its own: it is one of the two
    clocks_s = np.array([0.0, offset_s if shaft else 0.0]) + (0.0 if shaft else offset_s)
    off_s = (coastdown.start_ns - START_NS) / S - STOP_S - clocks_s
    assert np.abs(off_s).min() <= 8.0
    inside = (block.stamp_ns >= window.start_ns) & (block.stamp_ns <= window.end_ns)
    log = inside & (block.channel == LOG)
    np.testing.assert_array_equal(window.speed_through_water.value, block.value[log, 0])


def test_what_the_clocks_do_not_ask_for_is_not_done(ship, parameters, voyage, tmp_path) -> None:
    (run,) = open_runs([write_run(tmp_path / 'sound.mcap', voyage(), ship=ship)])
    result = replay(run, parameters=parameters)
    assert clocks_apart(result) == ()
    ((coastdown, window),) = coast_windows(result)
    assert (coastdown,) == result.coastdowns
    assert window.found
    assert coastdown.estimate is not None


def test_a_window_that_was_given_stays(ship, parameters, voyage, tmp_path) -> None:
    block = with_clock(voyage(), -9.0, silent_s=(600.0, 640.0))
    (run,) = open_runs([write_run(tmp_path / 'apart.mcap', block, ship=ship)])
    result = replay(run, parameters=parameters, window=(450.0, 900.0))
    ((coastdown, window),) = coast_windows(result)
    assert coastdown.ended_by is EndedBy.GIVEN
    assert not window.found
    assert (window.start_ns, window.end_ns) == (coastdown.start_ns, coastdown.end_ns)
    assert len(window.speed_through_water.value) > 400


@pytest.mark.parametrize('channel', [Channel.SPEED_THROUGH_WATER, Channel.SPEED_THROUGH_WATER_2])
def test_zeros_of_any_log_are_kept_where_asked_for(tmp_path: Path, channel: Channel) -> None:
    stamps = 10**18 + np.arange(1200) * 10**9
    speed = np.linspace(8.0, -8.0, len(stamps))
    speed += 0.01 * np.random.default_rng(1).standard_normal(len(stamps))
    speed = np.maximum(speed, 0.0)
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', Block.of(channel, stamps, speed))])
    sound, _ = accepted_samples(run, None)
    every, _ = accepted_samples(run, None, zeros=True)
    assert len(sound) < 1000
    assert len(every) == len(stamps)


def test_a_run_without_an_input_says_what_it_holds(tmp_path: Path) -> None:
    stamps = 10**18 + np.arange(10) * 10**9
    path = write_run(tmp_path / 'a.mcap', Block.of(Channel.HEADING, stamps, np.zeros(10)))
    (run,) = open_runs([path])
    (topic,) = run.topics
    run.topics = (replace(topic, topic='/gyro', input=None),)
    with pytest.raises(BagError, match=r'holds none of the inputs .*/gyro .*--remap'):
        accepted_samples(run, None)


@pytest.mark.parametrize(
    ('set_s', 'by_s'), [(0.0, -3600.0), (50.0, -3600.0), (50.0, -300.0), (50.0, 3600.0)]
)
def test_samples_are_found_by_the_clock_that_stamped_them(
    ship, parameters, voyage, tmp_path, set_s, by_s
) -> None:
    block = voyage(steady_s=450.0)
    second = (block.receive_ns - START_NS) / S
    stamps = block.stamp_ns + np.where(second >= set_s, round(by_s * S), 0)
    shifted = replace(block, stamp_ns=stamps)
    if by_s > 0.0:  # of a sensor whose arrival is told by its own clock
        shifted = replace(shifted, receive_ns=np.maximum(block.receive_ns, stamps))
    (run,) = open_runs([write_run(tmp_path / 'moved.mcap', shifted, ship=ship)])
    *_, (coastdown, window) = coast_windows(replay(run, parameters=parameters))
    assert coastdown.estimate is not None
    assert abs(window.start_ns / S - START_NS / S - 450.0 - by_s) < 10.0
    inside = (stamps >= window.start_ns) & (stamps <= window.end_ns)
    log = inside & (block.channel == LOG) & (second >= set_s)
    np.testing.assert_array_equal(window.speed_through_water.value, block.value[log, 0])
    assert window.before is not None
    assert len(window.before.speed_through_water) > 350


@pytest.mark.parametrize(
    ('from_s', 'channel'),
    [
        (0, Channel.SPEED_THROUGH_WATER),
        (600, Channel.SPEED_THROUGH_WATER),
        (600, Channel.SPEED_OVER_GROUND_3),
    ],
)
def test_a_log_that_stands_still_is_told(tmp_path: Path, from_s: int, channel: Channel) -> None:
    speed = 4.0 + 0.01 * np.random.default_rng(1).standard_normal(len(STAMPS))
    speed[from_s:] = 4.017
    path = write_run(tmp_path / 'a.mcap', Block.of(channel, STAMPS, speed))
    (run,) = open_runs([path])
    why = why_no_coastdown(replay(run, ship=BOAT))
    minutes = (1799 - from_s) / 60.0
    assert f'{channel.input} stood still at 4.02 m/s for {minutes:.0f} min' in why


@pytest.mark.parametrize('steady', [0.0, 4.0])
def test_a_log_at_work_and_a_ship_at_rest_do_not_stand_still(tmp_path, steady: float) -> None:
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(STAMPS))
    speed = steady + noise if steady else np.zeros(len(STAMPS))
    path = write_run(tmp_path / 'a.mcap', Block.of(Channel.SPEED_THROUGH_WATER, STAMPS, speed))
    (run,) = open_runs([path])
    assert 'stood still' not in why_no_coastdown(replay(run, ship=BOAT))


@pytest.mark.parametrize('lead_s', [40, 90])
def test_as_much_steady_sailing_is_asked_for_as_the_monitor_needs(tmp_path, lead_s: int) -> None:
    time_s = np.arange(400)
    # she gathers a little way, then brakes
    speed = np.interp(time_s, [0, lead_s, lead_s + 60, 400], [4.0, 4.1, 2.0, 1.9])
    log = Block.of(Channel.SPEED_THROUGH_WATER, STAMPS[:400], speed)
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', log)])
    result = replay(run, ship=BOAT)
    why = why_no_coastdown(replace(result, coastdowns=(), events=(), steady_lead_s=None))
    assert 'the speed by speed_through_water fell most' in why
    needed_s = result.parameters.slope_window_s
    assert (f'at least {needed_s:.0f} s of steady sailing' in why) == (lead_s < needed_s)
