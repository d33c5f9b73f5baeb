# SPDX-License-Identifier: Apache-2.0
"""Bad messages on the way into the monitor: values, stamps, arrivals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from shipdrag_ros.messages import EncodedMessage, encode, types
from shipdrag_ros.samples import Block, Channel, Float64
from tests.bad_input.case import SECOND_NS, Case, coastdown, steady, write, write_messages

_COAST = slice(900, 910)


def log() -> Block:
    """Steady sailing, by the log alone."""
    return coastdown()[:600]


def _value(places: slice, value: float) -> Callable[[Block], Block]:
    def change(block: Block) -> Block:
        values: Float64 = block.value.copy()
        values[places, 0] = value
        return replace(block, value=values)

    return change


def _stamp(places: slice, shift_s: float) -> Callable[[Block], Block]:
    def change(block: Block) -> Block:
        stamps = block.stamp_ns.copy()
        stamps[places] += round(shift_s * SECOND_NS)
        return replace(block, stamp_ns=stamps)

    return change


def _with_gap(block: Block) -> Block:
    return block[np.delete(np.arange(len(block)), slice(900, 990))]


def _set_back(block: Block) -> Block:
    later = np.arange(len(block)) >= 300
    return replace(block, stamp_ns=block.stamp_ns - later * 3600 * SECOND_NS)


def _recorder_set_back(block: Block) -> Block:
    later = np.arange(len(block)) >= 300
    shift_ns = later * 3600 * SECOND_NS
    return replace(
        block, stamp_ns=block.stamp_ns - shift_ns, receive_ns=block.receive_ns - shift_ns
    )


def _no_fix(message: EncodedMessage, *, status: int, latitude: float) -> EncodedMessage:
    fix = types.make(
        types.NAV_SAT_FIX,
        header=types.header(message.publish_ns, 'gps'),
        status=types.make('sensor_msgs/msg/NavSatStatus', status=status, service=1),
        latitude=latitude,
        longitude=5.0,
        altitude=0.0,
        position_covariance=np.zeros(9),
        position_covariance_type=0,
    )
    return message._replace(
        type=types.NAV_SAT_FIX, payload=types.serialize(types.NAV_SAT_FIX, fix)
    )


def _zero_rotation(message: EncodedMessage) -> EncodedMessage:
    zero = types.make('geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=0.0, w=0.0)
    sent = types.make(
        types.QUATERNION, header=types.header(message.publish_ns, 'base_link'), quaternion=zero
    )
    return message._replace(payload=types.serialize(types.QUATERNION, sent))


def _other_joint(message: EncodedMessage) -> EncodedMessage:
    sent = types.make(
        types.JOINT_STATE,
        header=types.header(message.publish_ns, ''),
        name=['engine'],
        position=np.zeros(0),
        velocity=np.array([8.0]),
        effort=np.zeros(0),
    )
    return message._replace(payload=types.serialize(types.JOINT_STATE, sent))


def _samples(
    kind: str, change: Callable[[Block], Block], *says: str, of: Callable[[], Block] = log
) -> Case:
    def line(folder: Path) -> list[str]:
        return ['replay', str(write(folder / 'bag.mcap', change(of())))]

    return Case('Messages', kind, line, 0, says)


def _messages(
    kind: str, topic: str, change: Callable[[EncodedMessage], EncodedMessage], *says: str
) -> Case:
    def line(folder: Path) -> list[str]:
        changed = [
            change(message) if message.topic == topic else message for message in encode(steady())
        ]
        return ['replay', str(write_messages(folder / 'bag.mcap', changed))]

    return Case('Messages', kind, line, 0, says)


def _epochs(block: Block) -> Block:
    year = np.where(block.channel == Channel.POSITION, 0, 365 * 86400 * SECOND_NS)
    return replace(block, stamp_ns=block.stamp_ns - year)


CASES = (
    _samples('NaN in a coastdown', _value(_COAST, np.nan), 'Coastdown 1', '10 nan', of=coastdown),
    _samples(
        'a log that hangs all the time',
        _value(slice(None), 8.0),
        'Warning: speed_through_water: 479 of 600 messages not used; 479 frozen',
        'check the sensor',
    ),
    _samples(
        'a clock ahead by 5 s all the time',
        _stamp(slice(None), 5.0),
        '600 of 600 messages not used; 600 future',
        'set the clocks of sensor and recorder alike',
    ),
    _samples(
        'the clock of the recorder set back: the order is by log time',
        _recorder_set_back,
        '600   600',
    ),
    _samples(
        'the clock of the sensor alone set back',
        _set_back,
        'everything before was dropped: speed_through_water: the stamp went back by 3597.000 s',
        '2 late',
    ),
    _samples(
        'a gap of 90 s in a coastdown',
        _with_gap,
        'the data stopped',
        of=coastdown,
    ),
    _messages(
        'GNSS without a fix',
        '/position',
        lambda m: _no_fix(m, status=-1, latitude=60.0),
        'position: 302 of 302 messages not used; 302 nan',
        'check the sensor',
    ),
    _messages(
        'a latitude of 600 degrees',
        '/position',
        lambda m: _no_fix(m, status=0, latitude=600.0),
        'position: 302 of 302 messages not used; 302 absurd',
        'check the unit',
    ),
    _messages(
        'a rotation of zeros',
        '/heading',
        _zero_rotation,
        'heading: 302 of 302 messages not used; 302 nan',
        'check the sensor',
    ),
    _messages(
        'a joint of another name',
        '/shaft',
        _other_joint,
        'shaft: 302 of 302 messages not used; 302 no_joint',
        'name it in the driver',
    ),
    _samples(
        'a position stamped a year after the rest',
        _epochs,
        'speed_through_water: 301 of 302 messages not used; 301 late',
        'set the clocks of the sensors alike',
        of=steady,
    ),
)
