# SPDX-License-Identifier: Apache-2.0
"""Small craft leap and stop within a second, and no reading of it is lost."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.coastdown import Monitor, validate
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel, Reason, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship
from tests.coastdown.conftest import bits, window_itself
from tests.runs import write_run

LOG, GROUND, SHAFT = (
    Channel.SPEED_THROUGH_WATER,
    Channel.SPEED_OVER_GROUND,
    Channel.SHAFT,
)
START_NS = 1_700_000_000_000_000_000
BOAT = Ship(
    length_m=1.2,
    displaced_volume_m3=0.0165,
    added_mass=ConstantAddedMass(value=0.08, sd=0.03),
)
QUICK = Parameters(slope_window_s=5.0, froude_min=0.01, update_s=1.0)
STOP_S, LEAP_S = 60.0, 20.0


def sailed(rate: float, *, quick: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Lie still, leap to 3 m/s, and stop as a hull of 1.2 m does; times [s] and speeds [m/s]."""
    fine = np.arange(0.0, 120.0, 0.01)
    speed = np.zeros(len(fine))
    for i in range(1, len(fine)):
        before = speed[i - 1]
        loses = quick * 9.81 * min(before * before / (9.81 * BOAT.length_m), 1.0)
        thrust = 2.9 if LEAP_S < fine[i] < STOP_S else 0.0
        speed[i] = min(3.0, before + 0.01 * thrust) if thrust else before - 0.01 * loses
    time = np.arange(0.0, 120.0, 1.0 / rate)
    return time, np.interp(time, fine, speed)


def block_of(channel: Channel, time_s: np.ndarray, value: np.ndarray) -> Block:
    return Block.of(channel, START_NS + np.round(time_s * 1e9).astype(np.int64), value)


def read(rate: float) -> Block:
    time, speed = sailed(rate)
    return block_of(LOG, time, speed + np.random.default_rng(1).normal(0.0, 0.01, len(time)))


@pytest.mark.parametrize('rate', [2.0, 10.0, 50.0])
def test_a_boat_that_leaps_and_stops_is_believed(rate: float) -> None:
    assert set(validate(read(rate), Parameters(), BOAT.length_m)) == {Reason.ACCEPTED}


def test_a_spike_in_a_hard_stop_is_none_of_it() -> None:
    block = read(10.0)
    value = block.value.copy()
    at = round(10.0 * (STOP_S + 0.5))
    value[at, 0] = 9.0
    found = validate(replace(block, value=value), Parameters(), BOAT.length_m)
    bad = np.flatnonzero(found != Reason.ACCEPTED).tolist()
    assert at in bad
    assert len(bad) <= 5  # with those that waited before it


def reasons(second: np.ndarray, speed: np.ndarray) -> list[Reason]:
    return [Reason(each) for each in validate(block_of(LOG, second, speed), Parameters(), 100.0)]


def test_a_reading_that_was_true_after_all_does_not_let_in_what_is_not() -> None:
    steady = 6.0 + 0.02 * np.random.default_rng(1).standard_normal(60)
    spoilt = [6.25, 6.15, 0.0, 6.0, 6.02, 12.0, 6.01, 9.0, 6.0, 3.0, 6.0]
    speed = np.concatenate([steady, spoilt])
    found = reasons(np.arange(len(speed)), speed)
    bad = [i for i, each in enumerate(found) if each is Reason.OUTLIER]
    assert {60 + spoilt.index(each) for each in (0.0, 12.0, 9.0, 3.0)} <= set(bad)
    assert len(bad) <= 5


def test_two_senders_that_cross_leap_together() -> None:
    draw = np.random.default_rng(1)
    second = np.repeat(np.arange(200.0), 2) - np.tile([0.0, 0.5], 200)
    speed = np.where(second < 60.0, 6.0, 4.0) + 0.02 * draw.standard_normal(400)
    found = np.array(reasons(second + 1.0, speed))
    assert Reason.OUTLIER not in found[:120].tolist()
    assert np.count_nonzero(found == Reason.OUTLIER) < 10  # of the leap, older than what waits


def test_what_comes_again_between_readings_that_wait_hides_none() -> None:
    second = np.arange(120.0)
    noise = 0.02 * np.random.default_rng(1).standard_normal(120)
    at = np.insert(np.arange(120), 63, 59)
    found = reasons(second[at], (np.where(second < 60.0, 6.0, 4.0) + noise)[at])
    assert [each for each in found if each is not Reason.ACCEPTED] == [Reason.DUPLICATE]


def record() -> Block:
    """Return a record with a hard stop, and later one that its log does not explain at once."""
    log = read(10.0)
    value = log.value.copy()
    value[1000:, 0] += 1.7  # a leap between two readings
    value[700:704, 0] += 5.0  # spikes that agree
    time, speed = sailed(10.0)
    turns = 40.0 * ((time > LEAP_S) & (time < STOP_S))
    return in_arrival_order(
        [
            replace(log, value=value),
            block_of(GROUND, time[::5], speed[::5]),
            block_of(SHAFT, time[::3], turns[::3]),
        ]
    )


def test_what_was_refused_and_was_true_is_in_live_and_replay_alike(tmp_path: Path) -> None:
    block = record()
    reasons = validate(block, QUICK, BOAT.length_m)
    of_log = block.channel == LOG
    assert int((reasons[of_log] == Reason.OUTLIER).sum()) == 4
    whole, part = (
        Monitor(BOAT, QUICK, estimate=window_itself, final=window_itself) for _ in range(2)
    )
    events = [*whole.update(block), *whole.finish()]
    again = [each for i in range(len(block)) for each in part.update(block[i : i + 1])]
    assert bits([*again, *part.finish()]) == bits(events)
    assert part.counts() == whole.counts()
    health = whole.counts()['speed_through_water']
    assert health.rejected == {'outlier': 4}
    assert health.used == int(of_log.sum()) - 4
    ended = [each for each in events if isinstance(each, EndedCoastdown) and each.estimate]
    assert ended
    for each in ended:
        stamps = block.stamp_ns[of_log & (reasons == Reason.ACCEPTED)]
        inside = stamps[(stamps >= each.start_ns) & (stamps <= each.end_ns)]
        told = each.estimate.speed_through_water.time_ns
        assert np.array_equal(told[(told >= each.start_ns) & (told <= each.end_ns)], inside)
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', block, BOAT)])
    counts = replay(run, parameters=replace(QUICK, update_s=60.0)).inputs['speed_through_water']
    assert counts.rejected == {'outlier': 4}


@pytest.mark.skipif('SHIPDRAG_DATA' not in os.environ, reason='needs SHIPDRAG_DATA')
@pytest.mark.parametrize('number', [218, 221, 222, 235])
def test_no_reading_of_a_measured_boat_is_lost(tmp_path: Path, number: int) -> None:
    path = Path(os.environ['SHIPDRAG_DATA']) / f'blueboat_{number}_10hz.csv'
    table = np.genfromtxt(path, delimiter=',', names=True)
    block = block_of(LOG, table['t'], table['surge'])
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', block, BOAT)])
    counts = replay(run, parameters=QUICK).inputs['speed_through_water']
    assert counts.used == counts.messages == len(table)
    assert not counts.rejected
