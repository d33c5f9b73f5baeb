# SPDX-License-Identifier: Apache-2.0
"""How a record is cut, and what was long before, must not change one bit."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import (
    EndedBy,
    EndedCoastdown,
    NotCoastdown,
    Onset,
    Reset,
    Update,
    WholeGlide,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, concatenate, in_arrival_order
from shipdrag_ros.simulation import EngineOrder, Sensor, Turn
from tests.coastdown.conftest import bits, window_itself

START_NS = 1_700_000_000_000_000_000
S = 1_000_000_000
LOG = Channel.SPEED_THROUGH_WATER
INPUTS = (LOG, Channel.SPEED_OVER_GROUND, Channel.POSITION, Channel.HEADING, Channel.SHAFT)

QUICK = Parameters(
    steady_s=300.0,
    slope_window_s=20.0,
    window_s=150.0,
    update_s=7.0,
    data_stop_s=20.0,
    frozen_s=15.0,
)


def spoil(block: Block, seed: int) -> Block:
    """Strew every kind of bad sample and a clock that was set over a record."""
    rng = np.random.default_rng(seed)
    n = len(block)
    arrays = [
        block.channel.copy(),
        block.stamp_ns.copy(),
        block.receive_ns.copy(),
        block.value.copy(),
        block.variance.copy(),
    ]
    _, stamp, receive, value, _ = arrays
    receive += rng.integers(0, 400_000_000, n)
    stamp += rng.integers(-100_000_000, 100_000_000, n)
    for share, change in (
        (0.01, lambda i: value.__setitem__((i, 0), np.nan)),
        (0.01, lambda i: value.__setitem__((i, 0), np.inf)),
        (0.01, lambda i: value.__setitem__((i, 0), 1e4)),
        (0.01, lambda i: stamp.__setitem__(i, stamp[i] - 9 * S)),
        (0.01, lambda i: stamp.__setitem__(i, stamp[i] + 9 * S)),
        (0.01, lambda i: stamp.__setitem__(i, stamp[max(0, i - 4)])),
    ):
        for i in np.flatnonzero(rng.random(n) < share):
            change(i)
    at = int(rng.integers(0, n))
    value[at : at + 100] = value[at]
    at = int(rng.integers(0, n))
    stamp[at:] -= 30 * S
    at = int(rng.integers(0, n))
    receive[at:] -= 300 * S
    stamp[at:] -= 300 * S
    order = np.argsort(receive[:at], kind='stable')
    later = at + np.argsort(receive[at:], kind='stable')
    return Block(*arrays)[np.concatenate([order, later])]


@pytest.fixture(scope='module')
def eventful(record, sensors) -> Block:
    """Two coastdowns, the second with a turn, on five inputs at five rates."""
    parts = []
    for i, turns in enumerate(((), (Turn(140.0, 60.0, 0.02),))):
        block = record(
            sensors=(
                replace(sensors['log'], rate_hz=2.5),
                Sensor(channel=Channel.SPEED_OVER_GROUND, rate_hz=0.7, sd=0.1),
                replace(sensors['radar'], rate_hz=0.5, sd=0.3),
                replace(sensors['compass'], rate_hz=2.0),
                replace(sensors['shaft'], rate_hz=1.0),
            ),
            lead_in_s=330.0,
            duration_s=270.0,
            turns=turns,
            seed=i,
        )
        shift = i * 600 * S
        parts.append(
            replace(block, stamp_ns=block.stamp_ns + shift, receive_ns=block.receive_ns + shift)
        )
    return concatenate(parts)


def watching(ship) -> Monitor:
    return Monitor(ship, QUICK, estimate=window_itself, final=window_itself)


def run(ship, blocks) -> tuple[list, dict]:
    monitor = watching(ship)
    events = []
    for block in blocks:
        events += monitor.update(block)
    return events + monitor.finish(), monitor.counts()


@pytest.fixture(scope='module')
def said(ship, eventful) -> list:
    """What is said of the whole of it."""
    return run(ship, [eventful])[0]


def cut(block: Block, places) -> list[Block]:
    edges = [0, *sorted(places), len(block)]
    return [block[a:b] for a, b in pairwise(edges)]


def on_the_globe(block: Block) -> Block:
    """Put the positions where the ship crosses the date line."""
    track = block.channel == Channel.POSITION
    value = block.value.copy()
    east, north = block.value[track].T
    longitude = 179.98 + east / 111_195.0
    value[track] = np.column_stack([-17.0 + north / 111_195.0, (longitude + 180) % 360 - 180])
    channel = np.where(track, np.uint8(Channel.POSITION_GEODETIC), block.channel)
    return replace(block, channel=channel, value=value)


def thinned(block: Block, every) -> Block:
    """Keep each so-and-so-many-th sample of each of the `INPUTS`, none for 0."""
    kept = np.zeros(len(block), bool)
    for channel, step in zip(INPUTS, every, strict=True):
        if step:
            kept[np.flatnonzero(block.channel == channel)[::step]] = True
    return block[kept]


@settings(max_examples=4, deadline=None)
@given(
    data=st.data(),
    seed=st.integers(0, 1000),
    every=st.tuples(*[st.integers(0, 4)] * len(INPUTS)).filter(any),
    globe=st.booleans(),
    silence=st.tuples(st.integers(0, 1200), st.integers(0, 300)),
)
def test_where_the_record_is_cut_changes_no_bit(ship, eventful, data, seed, every, globe, silence):
    block = thinned(eventful, every)
    second = (block.stamp_ns - START_NS) // S
    block = block[(second < silence[0]) | (second >= sum(silence))]
    block = spoil(on_the_globe(block) if globe else block, seed)
    places = data.draw(st.lists(st.integers(0, len(block)), max_size=60))
    events, health = run(ship, [block])
    assert len(events) > 0
    again, health_again = run(ship, cut(block, places))
    assert bits(again) == bits(events)
    assert health_again == health


@settings(max_examples=2, deadline=None)
@given(data=st.data(), into_s=st.integers(1, 200), seed=st.integers(0, 1000))
def test_a_reset_in_mid_coastdown_is_a_fresh_start(ship, eventful, said, data, into_s, seed):
    onset = next(event for event in said if isinstance(event, Onset))
    place = int(np.searchsorted(eventful.receive_ns, onset.detected_ns + into_s * S))
    before, after = eventful[:place], spoil(eventful[place:], seed)
    first, monitor = watching(ship), watching(ship)
    expected = [*first.update(before), *first.reset(7, 'asked for'), *run(ship, [after])[0]]
    assert any(isinstance(e, EndedCoastdown) and e.ended_by is EndedBy.RESET for e in expected)

    def pieces(block: Block) -> list[Block]:
        return cut(block, data.draw(st.lists(st.integers(0, len(block)), max_size=20)))

    events = [event for piece in pieces(before) for event in monitor.update(piece)]
    events += monitor.reset(7, 'asked for')
    events += [event for piece in pieces(after) for event in monitor.update(piece)]
    assert bits(events + monitor.finish()) == bits(expected)


def test_sample_by_sample_changes_no_bit(ship, eventful) -> None:
    block = spoil(eventful, 5)
    events, _ = run(ship, [block])
    assert {Onset, Update, EndedCoastdown, Reset} <= {type(event) for event in events}
    assert bits(run(ship, cut(block, range(1, len(block))))[0]) == bits(events)


def test_real_estimates_change_no_bit(ship, record) -> None:
    block = record(lead_in_s=300.0, duration_s=120.0)
    whole, part = Monitor(ship, QUICK), Monitor(ship, QUICK)
    events = whole.update(block) + whole.finish()
    again = [event for piece in cut(block, range(0, 420, 3)) for event in part.update(piece)]
    assert any(isinstance(event, Update) for event in events)
    assert bits(again + part.finish()) == bits(events)


def test_strided_and_read_only_blocks_change_no_bit(ship, eventful, said) -> None:
    twice = eventful[np.repeat(np.arange(len(eventful)), 2)]
    strided = twice[::2]
    for array in (strided.stamp_ns, strided.value, strided.channel):
        array.flags.writeable = False
    assert not strided.value.flags.c_contiguous
    assert bits(run(ship, [strided])[0]) == bits(said)


@pytest.fixture(scope='module')
def long_record(record, sensors) -> Block:
    """Coastdowns, a slow-down and turns, and even power for some minutes between them."""
    orders = []
    for start in (0.0, 1500.0, 3200.0):
        orders += [
            EngineOrder(start, shaft=0.0, thrust=0.0),
            EngineOrder(start + 300.0, shaft=1.0, thrust=1.0),
        ]
    orders.insert(4, EngineOrder(2500.0, shaft=0.7, thrust=0.5))
    return record(
        sensors=(sensors['log'], replace(sensors['radar'], sd=0.3), sensors['compass']),
        orders=tuple(orders),
        turns=(Turn(1650.0, 60.0, 0.02), Turn(3750.0, 100.0, 0.01)),
        lead_in_s=400.0,
        duration_s=4000.0,
    )


@pytest.fixture(scope='module')
def long_records(ship, long_record) -> list:
    """Of all inputs, and of a log and fixes on the globe, each with what the whole of it says."""
    early = long_record.stamp_ns < START_NS + 3300 * S
    heard = np.isin(long_record.channel, [LOG, Channel.POSITION])
    fixes = on_the_globe(long_record[early & heard])
    return [(block, run(ship, [block])[0]) for block in (long_record, fixes)]


@pytest.mark.parametrize(('start_s', 'globe'), [(686, False), (500, True)])
def test_a_monitor_that_starts_later_says_the_same(ship, long_records, start_s, globe):
    block, whole = long_records[globe]
    part, _ = run(ship, [block[block.stamp_ns >= START_NS + start_s * S]])
    known_ns = START_NS + start_s * S + Monitor(ship, QUICK).history_ns

    def known(events) -> list:
        spans = Onset | EndedCoastdown | NotCoastdown | WholeGlide
        return [
            event
            for event in events
            if (event.start_ns if isinstance(event, spans) else event.stamp_ns) >= known_ns
        ]

    assert bits(known(part)) == bits(known(whole))
    assert known(whole)


def test_a_slow_down_that_follows_a_glide_and_even_power_is_no_coastdown(long_records) -> None:
    told = [one for one in long_records[0][1] if isinstance(one, EndedCoastdown)]
    begun = [(one.start_ns - START_NS) / S for one in told if not one.withdrawn]
    assert len(begun) == 4
    assert not any(2250.0 < at_s < 2700.0 for at_s in begun)


def test_the_order_of_arrival_decides_between_inputs(ship, eventful) -> None:
    # the same samples, all of the compass a second later: still one sequence, still events
    late = np.where(eventful.channel == Channel.HEADING, S, 0)
    moved = in_arrival_order([replace(eventful, receive_ns=eventful.receive_ns + late)])
    events, counts = run(ship, [moved])
    assert counts['heading'].used
    assert set(counts['heading'].rejected) <= {'duplicate'}  # none is late or out of order
    # two stops, and the glide that goes on after the turn
    ended = [event for event in events if isinstance(event, EndedCoastdown)]
    standing = [event.ended_by for event in ended if not event.withdrawn]
    assert standing[1:] == [EndedBy.TURN, EndedBy.RECORD_END]
    assert ended[0].end_ns == START_NS + 600 * S  # where the second record is joined
