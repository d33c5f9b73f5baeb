# SPDX-License-Identifier: Apache-2.0
"""What is encoded comes back, and rclpy agrees with it."""

from __future__ import annotations

import importlib
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.messages import TOPICS, Source, decode, encode, input_type
from shipdrag_ros.samples import Block, Channel

CARRIES_VARIANCE = {
    Channel.SPEED_THROUGH_WATER,
    Channel.SPEED_OVER_GROUND,
    Channel.POSITION,
    Channel.POSITION_GEODETIC,
}
TWO_COLUMNS = {Channel.POSITION, Channel.POSITION_GEODETIC, Channel.WIND_APPARENT}


def decoded_again(block: Block) -> Block:
    (message,) = encode(block)
    return decode(
        Source(message.topic.removeprefix('/'), message.type), [message.payload], [message.log_ns]
    ).block


@settings(max_examples=100, deadline=None)
@given(
    channel=st.sampled_from(Channel),
    stamp_ns=st.integers(0, 2**31 * 10**9 - 1),
    delay_ns=st.integers(0, 10**9),
    value=st.tuples(st.floats(0.0, 40.0, width=32), st.floats(-90.0, 90.0)),
    variance=st.tuples(st.floats(1e-9, 1e3), st.floats(1e-9, 1e3)),
)
def test_round_trip(channel, stamp_ns, delay_ns, value, variance):
    if channel is Channel.HEADING:
        value = (math.remainder(value[0], 2 * math.pi), 0.0)
    if channel not in TWO_COLUMNS:
        value = (value[0], 0.0)
    block = Block.of(
        channel, [stamp_ns], [value], receive_ns=[stamp_ns + delay_ns], variance=[variance]
    )
    again = decoded_again(block)
    assert again.channel.tolist() == [channel]
    assert again.stamp_ns.tolist() == [stamp_ns]
    assert again.receive_ns.tolist() == [stamp_ns + delay_ns]
    # a heading passes through sine and cosine
    atol = 1e-15 * 10 if channel is Channel.HEADING else 0.0
    np.testing.assert_allclose(again.value, block.value, rtol=0, atol=atol)
    if channel in CARRIES_VARIANCE:
        columns = 2 if channel in TWO_COLUMNS else 1
        np.testing.assert_array_equal(again.variance[0, :columns], variance[:columns])


@pytest.mark.parametrize('channel', Channel)
def test_unknown_variance_stays_unknown(channel: Channel) -> None:
    assert np.isnan(decoded_again(Block.of(channel, [1], [0.5])).variance).all()


@pytest.mark.parametrize('channel', Channel)
def test_types_are_accepted_ones_and_topics_lie_in_the_namespace(channel: Channel) -> None:
    assert input_type(channel) in TOPICS[channel.input]
    (message,) = encode(Block.of(channel, [1], [0.5]), namespace='/ship')
    assert message.topic == f'/ship/{channel.input}'
    assert message.type == input_type(channel)


def test_a_depth_beyond_float32_becomes_infinite() -> None:
    assert decoded_again(Block.of(Channel.DEPTH, [1], [1e300])).value[0, 0] == math.inf


@pytest.mark.parametrize('channel', Channel)
def test_rclpy_reads_and_writes_the_same(channel: Channel) -> None:
    serialization = pytest.importorskip('rclpy.serialization')
    block = Block.of(channel, [5_000_000_001], [(0.25, 0.5)], variance=[(0.01, 0.02)])
    (message,) = encode(block)
    package, _, name = message.type.split('/')
    kind = getattr(importlib.import_module(f'{package}.msg'), name)
    read = serialization.deserialize_message(message.payload, kind)
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (5, 1)
    # not the same bytes: rclpy leaves the padding as it finds it
    rewritten = serialization.serialize_message(read)
    source = Source(channel.input, message.type)
    for payload in (message.payload, rewritten):
        again = decode(source, [payload], [5_000_000_001]).block
        np.testing.assert_array_equal(again.value, decoded_again(block).value)
        np.testing.assert_array_equal(again.variance, decoded_again(block).variance)
