# SPDX-License-Identifier: Apache-2.0
"""Coastdowns through bad readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel

S = 1_000_000_000
LOG, TRACK = Channel.SPEED_THROUGH_WATER, Channel.POSITION
STOP_S = 900

RNG = np.random.default_rng(0)
ONE_IN_20 = RNG.random(1800) < 0.05
FEW = RNG.random(1800) < 0.01


def between(first: int, last: int) -> np.ndarray:
    """Return which of the readings once a second are between two times after the stop."""
    return (np.arange(1800) >= STOP_S + first) & (np.arange(1800) < STOP_S + last)


def put(value: float, where: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: np.where(where[:, None], value, values)


def spiked(values: np.ndarray) -> np.ndarray:
    return np.where(FEW[:, None], values + RNG.uniform(-6.0, 6.0, values.shape), values)


FAULTS = {
    'a zero in 20': (LOG, put(0.0, ONE_IN_20)),
    'a zero before the stop': (LOG, put(0.0, between(-5, -4))),
    'a zero after the stop': (LOG, put(0.0, between(30, 31))),
    'a burst of zeros': (LOG, put(0.0, between(10, 20))),
    'spikes': (LOG, spiked),
    'a gap': (LOG, put(np.nan, between(-10, 20))),
    'a longer gap': (LOG, put(np.nan, between(-70, -15))),
    'far positions': (TRACK, put(1e308, ONE_IN_20)),
    'no position': (TRACK, put(0.0, ONE_IN_20)),
}


def spoilt(block: Block, channel: Channel, spoil) -> Block:
    rows = block.channel == channel
    columns = 2 if channel is TRACK else 1
    value = block.value.copy()
    value[rows, :columns] = spoil(value[rows, :columns][:1800])
    return replace(block, value=value)


@pytest.fixture(scope='module')
def clean(record, sensors) -> Block:
    block = record(sensors=(sensors['log'], sensors['radar']))
    return block[block.stamp_ns < block.stamp_ns[0] + 1800 * S]


@pytest.fixture(scope='module')
def as_it_is(clean, watch) -> EndedCoastdown:
    [one] = [event for event in watch(clean) if isinstance(event, EndedCoastdown)]
    return one


@pytest.mark.parametrize('name', FAULTS)
def test_bad_readings_neither_hide_nor_move_a_coastdown(clean, as_it_is, watch, name) -> None:
    events = watch(spoilt(clean, *FAULTS[name]))
    [bad] = [event for event in events if isinstance(event, EndedCoastdown)]
    assert abs(bad.start_ns - as_it_is.start_ns) <= 10 * S
    assert bad.end_ns == as_it_is.end_ns


@pytest.mark.parametrize('at_s', [-300, 0, 200])
@pytest.mark.parametrize('value', [0.0, None])
def test_the_track_stands_in_for_a_log_that_fails(ship, clean, at_s, value) -> None:
    def fail(values: np.ndarray) -> np.ndarray:
        inside = between(at_s, 900)
        return put(values[np.argmax(inside), 0] if value is None else value, inside)(values)

    monitor = Monitor(ship, Parameters(update_s=600.0))
    events = [*monitor.update(spoilt(clean, LOG, fail)), *monitor.finish()]
    ended = [event for event in events if isinstance(event, EndedCoastdown)]
    # positions alone leave open whether the engine drove her for half a minute as the log failed
    assert len(ended) <= 2
    assert ended[-1].start_ns - ended[0].end_ns < 60 * S
    assert ended[-1].end_ns > clean.stamp_ns[-1] - 30 * S
    assert abs(ended[0].start_ns - clean.stamp_ns[0] - STOP_S * S) < 30 * S
    coastdown = ended[-1]
    assert coastdown.estimate is not None
    [note] = [note for note in coastdown.estimate.notes if 'no usable reading' in note]
    assert note.startswith('speed_through_water')
    assert note.endswith('rests on position')
