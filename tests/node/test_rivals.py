# SPDX-License-Identifier: Apache-2.0
"""Peers that were there first, peers that flood, peers of the same name: over real DDS and UDP."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy')

from shipdrag_ros.bags import open_runs
from shipdrag_ros.messages import encode
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel
from tests.node.conftest import Instruments, values
from tests.sources.log_samples import sentence

PREFERRED = 'geometry_msgs/msg/TwistWithCovarianceStamped'
PLAIN = 'geometry_msgs/msg/TwistStamped'
PART = 'input speed_through_water'


def twist(speed_m_s: float) -> Any:
    from geometry_msgs.msg import TwistStamped

    message = TwistStamped()
    now_ns = time.time_ns()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, 10**9)
    message.twist.linear.x = speed_m_s
    return message


def preferred(speed_m_s: float) -> bytes:
    block = Block.of(Channel.SPEED_THROUGH_WATER, [time.time_ns()], [speed_m_s])
    (message,) = encode(block)
    return message.payload


class Driver:
    """A publisher of its own context, which sends at a rate until it is closed."""

    def __init__(
        self,
        peer: Any,
        type_name: str,
        message: Any,
        rate_hz: float,
        name: str = 'speed_through_water',
    ) -> None:
        self._peer = type(peer)()
        publisher = self._peer.advertise(f'/{name}', type_name)
        self._ended = threading.Event()

        def send() -> None:
            speed = 5.0
            while not self._ended.wait(1.0 / rate_hz):
                speed += 1e-4
                publisher.publish(message(speed))

        self._thread = threading.Thread(target=send)
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self._peer.close()


def test_peers_of_another_type_that_were_there_first_keep_no_input(
    start_node: Any, peer: Any, diagnostics: Any, tmp_path: Path
) -> None:
    """One is gone, one is silent, one sends no number: each on an input of its own."""
    node = start_node()
    inputs = ('speed_through_water', 'speed_through_water_2', 'speed_through_water_3')
    gone, silent = type(peer)(), type(peer)()
    gone.advertise(f'/{inputs[0]}', PREFERRED)
    silent.advertise(f'/{inputs[1]}', PREFERRED)
    bad = Driver(peer, PREFERRED, lambda _: preferred(float('nan')), 2.0, inputs[2])
    for each in inputs:
        diagnostics.wait_for(f'input {each}', PREFERRED, value='type')
    gone.close()
    late = [Driver(peer, PLAIN, twist, 10.0, each) for each in inputs]
    try:
        for each in inputs:
            diagnostics.wait_for(f'input {each}', PLAIN, value='type')

        def used(name: str) -> int:
            return int(values(diagnostics.of(f'input {name}')).get('used', '0'))

        peer.spin_until(lambda: min(map(used, inputs)) >= 20)
    finally:
        for driver in (*late, bad):
            driver.close()
        silent.close()
    assert node.stop() == 0
    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    (run,) = open_runs([bag])
    result = replay(run)
    assert min(result.inputs[each].used for each in inputs) >= 20
    assert result.recorded.first_difference is None


def test_a_sentence_a_second_does_not_shadow_a_topic_at_10_hz(
    start_node: Any, peer: Any, diagnostics: Any, instruments: Instruments, tmp_path: Path
) -> None:
    node = start_node(nmea=instruments.source)
    ended = threading.Event()

    def talk() -> None:
        while not ended.wait(1.0):
            instruments.say(sentence('IIVHW,,T,,M,10.0,N,,K'))

    talking = threading.Thread(target=talk)
    talking.start()
    try:
        diagnostics.wait_for(PART, f'NMEA {instruments.source}', value='fed by')
        driver = Driver(peer, PLAIN, twist, 10.0)
        try:
            node.wait_for_log('speed_through_water: now from a topic, no longer from NMEA')
            diagnostics.wait_for(PART, PLAIN, value='type')
        finally:
            driver.close()
        # the topic dies: NMEA is there again
        node.wait_for_log('speed_through_water: now from NMEA, no longer from a topic')
    finally:
        ended.set()
        talking.join()
    assert node.stop() == 0
    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    (run,) = open_runs([bag])
    assert replay(run).recorded.first_difference is None


def test_a_flood_on_one_input_delays_no_other(start_node, peer, diagnostics, tmp_path):
    node = start_node()
    ground = peer.advertise('/speed_over_ground', PREFERRED)
    peer.wait_for_listener(ground)
    sent = []

    def sail(seconds: float) -> None:
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            block = Block.of(Channel.SPEED_OVER_GROUND, [time.time_ns()], [[5.0, 0.0]])
            sent.append(int(block.stamp_ns[0]))
            (message,) = encode(block)
            ground.publish(message.payload)
            peer.spin_for(0.1)

    sail(2.0)
    calm = len(sent)
    flood = Driver(peer, PLAIN, twist, 20_000.0)
    try:
        sail(6.0)
        diagnostics.wait_for(PART, 'over 1000 a second')
    finally:
        flood.close()
    assert node.stop() == 0
    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    (run,) = open_runs([bag])
    lags = [
        (block.receive_ns - block.stamp_ns)[block.channel == Channel.SPEED_OVER_GROUND] * 1e-9
        for block in run.inputs()
        if isinstance(block, Block)
    ]
    lag_s = np.concatenate(lags)
    assert len(lag_s) == len(sent)
    before_s, flooded_s = lag_s[:calm], lag_s[calm:]
    # on a machine that is busy anyway, all of it takes longer without a flood too
    assert np.median(flooded_s) < 0.2 + 10.0 * np.median(before_s)
    assert flooded_s.max() < 2.0 + 10.0 * before_s.max()


def test_odd_requests_are_refused_and_a_node_of_the_same_name_is_said(
    start_node: Any, peer: Any, diagnostics: Any
) -> None:
    from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
    from rclpy.parameter import Parameter as Value

    def asked(verb: str, service: Any, **content: Any) -> Any:
        request = service.Request(**content)
        answer = peer.call(f'/coastdown_node/{verb}_parameters', request, service)
        assert peer.state() == 'active'
        return answer

    node = start_node()
    # a giant is refused: not one of 300 000 is looked up
    assert len(asked('get', GetParameters, names=['window_s'] * 300_000).values) == 0
    found = asked('describe', DescribeParameters, names=['window_s'] * 300_000)
    assert len(found.descriptors) == 0
    many = [Value('window_s', value=900.0).to_parameter_msg()] * 30_000
    found = asked('set', SetParameters, parameters=many)
    assert len(found.results) == 1000
    assert 'more than 1000 entries' in found.results[0].reason
    # control characters do not reach the terminal
    assert not peer.change_state('\x1b]0;owned\x07')
    node.wait_for_log('transition refused')
    assert '\x1b]' not in node.log
    assert '\x07' not in node.log
    namesake = type(peer)('coastdown_node')
    try:
        status = diagnostics.wait_for('state', '2 nodes have the name of this one')
        assert status.level >= b'\x01'
    finally:
        namesake.close()
