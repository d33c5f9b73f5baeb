# SPDX-License-Identifier: Apache-2.0
"""
Replay of what a session recorded gives its figures again, to the last bit.

The same over DDS is in `test_coastdown.py`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.coastdown.events import EndedBy
from shipdrag_ros.messages import (
    EncodedMessage,
    EventKind,
    encode,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import ReplayResult, replay
from shipdrag_ros.samples import Block, concatenate
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors
from tests.node.desk import Desk

SHIP_FILE = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
SECOND_NS = 10**9
LEAD_IN_S = 300.0
APART_S = 1500.0  # longer than what is kept of the first
DURATION_S = 340.0
PARAMETERS = Parameters(
    steady_s=120.0, slope_window_s=30.0, window_s=600.0, update_s=40.0, estimator='s1_joint'
)


@cache
def record() -> Block:
    """Two coastdowns, and a silence between them."""
    ship = Ship.load(SHIP_FILE)
    scenario = Scenario(speed_m_s=8.2, lead_in_s=LEAD_IN_S, duration_s=DURATION_S)
    truth = simulate(ship, scenario)
    one = sense(truth, standard_sensors(), seed=1)
    two = sense(
        truth,
        standard_sensors(),
        seed=2,
        start_ns=int(one.receive_ns[0]) + round(APART_S * SECOND_NS),
    )
    return concatenate([one, two])


@cache
def messages() -> tuple[EncodedMessage, ...]:
    return tuple(encode(record()))


class ReplayedDesk(Desk):
    """A desk that is fed parts of the record, and the replay of what it published."""

    def feed(self, from_s: float, to_s: float) -> None:
        start_ns = record().receive_ns[0]
        time_s = (record().receive_ns - start_ns) / SECOND_NS
        first, last = np.searchsorted(time_s, [from_s, to_s])
        self.receive(messages()[first:last])

    def replay(self) -> list[ReplayResult]:
        return [replay(run) for run in open_runs(self.recorded())]


@pytest.fixture
def desk(tmp_path: Path) -> ReplayedDesk:
    return ReplayedDesk(tmp_path, Ship.load(SHIP_FILE), PARAMETERS)


def assert_identical(result: ReplayResult, *, at_least: int) -> None:
    assert result.recorded.first_difference is None
    assert result.recorded.compared == result.recorded.identical
    assert result.recorded.compared >= at_least


def test_from_the_beginning(desk: ReplayedDesk) -> None:
    desk.recorder.start()
    desk.feed(0, 1e9)
    (result,) = desk.replay()
    assert [it.ended_by for it in result.coastdowns] == [EndedBy.DATA_STOP, EndedBy.RECORD_END]
    figures = [it for it in desk.published if not it.topic.endswith('/events')]
    assert_identical(result, at_least=len(figures))
    assert len(figures) > 50


def test_a_recording_that_stops_and_starts_mid_run(desk: ReplayedDesk) -> None:
    desk.recorder.start()
    desk.feed(0, LEAD_IN_S + 200.0)
    desk.recorder.stop()
    desk.feed(LEAD_IN_S + 200.0, LEAD_IN_S + 300.0)
    desk.recorder.start()
    desk.feed(LEAD_IN_S + 300.0, 1e9)
    first, second = desk.replay()
    assert_identical(first, at_least=10)
    assert_identical(second, at_least=20)


def test_after_a_reset(desk: ReplayedDesk) -> None:
    desk.recorder.start()
    start_ns = int(record().receive_ns[0])
    desk.feed(0, LEAD_IN_S + 250.0)
    desk.session.reset('asked for', start_ns + round((LEAD_IN_S + 250.0) * SECOND_NS))
    desk.feed(LEAD_IN_S + 250.0, 1e9)
    (result,) = desk.replay()
    assert [it.ended_by for it in result.coastdowns] == [EndedBy.RESET, EndedBy.RECORD_END]
    assert_identical(result, at_least=30)


def test_both_sides_of_a_clock_that_was_set_back(desk: ReplayedDesk) -> None:
    desk.recorder.start()
    desk.feed(0, LEAD_IN_S + 250.0)
    desk.feed(0, APART_S)
    first, second = desk.replay()
    assert [it.ended_by for it in first.coastdowns] == [EndedBy.RESET]
    assert_identical(first, at_least=10)
    assert_identical(second, at_least=20)


@pytest.mark.parametrize('recorded_from', ['mid run', 'after the silence'])
def test_a_coastdown_whose_sources_all_fall_silent(desk: ReplayedDesk, recorded_from: str) -> None:
    silent_s = LEAD_IN_S + 250.0
    ended_ns = int(record().receive_ns[0]) + round((silent_s + 61.0) * SECOND_NS)
    desk.feed(0.0, LEAD_IN_S + 200.0)
    if recorded_from == 'mid run':
        desk.recorder.start()
    desk.feed(LEAD_IN_S + 200.0, silent_s)
    desk.session.fall_silent('nothing was heard', ended_ns)
    # ended now, by the clock, and not when the sensors are back; and only once
    assert desk.kinds()[-2:] == [EventKind.SILENCE, EventKind.COASTDOWN]
    desk.session.fall_silent('nothing was heard', ended_ns + SECOND_NS)
    assert desk.kinds()[-1] is EventKind.COASTDOWN
    if recorded_from == 'after the silence':
        desk.recorder.start()
    desk.feed(APART_S - 50.0, 1e9)
    (result,) = desk.replay()
    ended = [it.ended_by for it in result.coastdowns]
    assert ended == [EndedBy.SILENCE, EndedBy.RECORD_END]
    assert_identical(result, at_least=20)


def test_a_clock_that_is_set_forward_ends_the_run(desk: ReplayedDesk) -> None:
    desk.recorder.start()
    desk.feed(0, LEAD_IN_S + 250.0)
    now_ns = int(record().receive_ns[0]) + round((LEAD_IN_S + 270.0) * SECOND_NS)
    desk.session.clock_was_set('the clock of this computer went forward by 20.0 s', now_ns)
    desk.feed(LEAD_IN_S + 271.0, 1e9)
    (result,) = desk.replay()
    assert result.coastdowns[0].ended_by is EndedBy.RESET
    assert result.coastdowns[-1].ended_by is EndedBy.RECORD_END
    assert EventKind.CLOCK_JUMP in desk.kinds()
    assert_identical(result, at_least=30)
