# SPDX-License-Identifier: Apache-2.0
"""Traces are means by second, bounded, and one clock that is off does not spoil them."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.live.figures import COARSE_S, FINE_S, LONGEST_S, Trace, TraceRow
from shipdrag_ros.samples import Block, Channel, in_arrival_order

START_S = 1_700_000_000


def readings(channel: Channel, seconds: np.ndarray, value: float) -> Block:
    return Block.of(channel, (seconds * 1e9).astype(np.int64), np.full(len(seconds), value))


def rest_of(trace: Trace) -> list[TraceRow]:
    """Close the newest second too, as a later reading would."""
    trace.newest_s += 1
    return trace.closed()


def test_a_row_is_the_mean_of_its_second_and_is_given_once() -> None:
    trace = Trace()
    times = START_S + np.array([0.1, 0.5, 0.9, 1.2, 2.0])
    trace.add(Block.of(Channel.SPEED_THROUGH_WATER, (times * 1e9).astype(np.int64), range(5)))
    ground = Block.of(Channel.SPEED_OVER_GROUND, [START_S * 10**9], [[3.0, 4.0]])
    trace.add(ground)
    trace.add_estimate(START_S * 10**9, 2.5)
    assert trace.closed() == [(START_S, 1.0, 5.0, 2.5, None), (START_S + 1, 3.0, None, None, None)]
    assert trace.closed() == []
    assert rest_of(trace) == [(START_S + 2, 4.0, None, None, None)]


def test_the_first_instrument_that_speaks_in_a_second_is_drawn() -> None:
    trace = Trace()
    seconds = START_S + np.arange(3)
    trace.add(readings(Channel.SPEED_THROUGH_WATER_2, seconds, 7.0))
    trace.add(readings(Channel.SPEED_THROUGH_WATER, seconds[1:2], 5.0))
    trace.add(readings(Channel.SPEED_THROUGH_WATER_3, seconds[:2], 9.0))
    trace.add(Block.of(Channel.SPEED_OVER_GROUND_3, [START_S * 10**9], [[3.0, 4.0]]))
    assert [row[1:3] for row in rest_of(trace)] == [
        (7.0, 5.0),
        (5.0, None),
        (7.0, None),
    ]


def test_days_are_thinned_and_forgotten() -> None:
    trace = Trace()
    for day in range(3):
        seconds = START_S + 86400 * day + np.arange(86400)
        trace.add(readings(Channel.SPEED_THROUGH_WATER, seconds, float(day)))
        trace.closed()
    rows = trace.rows()
    assert [row[0] for row in rows] == sorted(row[0] for row in rows)
    assert rows[-1][0] - rows[0][0] <= LONGEST_S + COARSE_S
    assert len(rows) <= LONGEST_S / COARSE_S + FINE_S + COARSE_S + 2
    assert rows[0][1] == 1.0
    assert rows[-1][1] == 2.0


@pytest.mark.parametrize('off_s', [-7200, 7200, 10**8])
def test_one_clock_that_is_off_is_left_out(off_s: int) -> None:
    trace = Trace()
    for second in range(START_S, START_S + 100):
        good = readings(Channel.SPEED_THROUGH_WATER, np.array([second]), 8.0)
        bad = readings(Channel.SHAFT, np.array([second + off_s]), 9.0)
        trace.add(in_arrival_order([good]))
        trace.add(bad)
    rows = rest_of(trace)
    assert len(rows) == 100
    assert {row[1:] for row in rows} == {(8.0, None, None, None)}
    assert not trace.restarted


def test_where_all_clocks_go_back_it_starts_over() -> None:
    trace = Trace()
    trace.add(readings(Channel.SHAFT, START_S + np.arange(100), 9.0))
    trace.closed()
    trace.add(readings(Channel.SHAFT, START_S - 10_000 + np.arange(100), 8.0))
    assert trace.restarted
    rest_of(trace)
    assert {row[4] for row in trace.rows()} == {8.0}


def test_the_newest_second_is_read_as_far_as_it_has_come() -> None:
    trace = Trace()
    assert trace.current is None
    for tenth, speed in enumerate((8.0, 9.0, 10.0)):
        stamp_ns = START_S * 10**9 + tenth * 10**8
        trace.add(Block.of(Channel.SPEED_THROUGH_WATER, [stamp_ns], [speed]))
        found = trace.current
        assert found is not None
        assert found[:2] == (START_S, 8.0 + 0.5 * tenth)
    assert trace.rows() == []
    rest_of(trace)
    assert trace.current == trace.rows()[-1] == (START_S, 9.0, None, None, None)
