# SPDX-License-Identifier: Apache-2.0
"""Bad bags: damaged, foreign, without what is needed, with impossible times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mcap.writer import Writer

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.messages import EncodedMessage, encode
from shipdrag_ros.samples import Block
from tests.bad_input.case import Case, steady, write, write_messages


def _bytes(content: bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = folder / 'bag.mcap'
        path.write_bytes(content)
        return path

    return make


def _sound(folder: Path) -> Path:
    return write(folder / 'bag.mcap', steady())


def _cut(fraction: float, *, zeros: bool = False) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        content = _sound(folder).read_bytes()
        kept = content[: int(fraction * len(content))]
        return _bytes(kept + bytes(len(content) - len(kept)) if zeros else kept)(folder)

    return make


def _messages(change: Callable[[int, EncodedMessage], EncodedMessage]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        changed = [change(i, message) for i, message in enumerate(encode(steady()))]
        return write_messages(folder / 'bag.mcap', changed)

    return make


def _samples(change: Callable[[Block], Block], *, ship: bool = True) -> Callable[[Path], Path]:
    return lambda folder: write(folder / 'bag.mcap', change(steady()), ship=ship)


def _in_protobuf(folder: Path) -> Path:
    path = folder / 'bag.mcap'
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema('foxglove.Log', 'protobuf', b'')
        channel = writer.register_channel('/speed_through_water', 'protobuf', schema)
        for second in range(10):
            writer.add_message(channel, second, b'\x08\x01', second)
        writer.finish()
    return path


def _bad_ship(folder: Path) -> Path:
    path = folder / 'bag.mcap'
    with BagWriter(path) as bag:
        bag.attach('ship.yaml', 'length_m: 150.0\n')
        bag.write_samples(steady())
    return path


def _log_of_another_type(_: int, message: EncodedMessage) -> EncodedMessage:
    if message.topic != '/speed_through_water':
        return message
    return message._replace(type='sensor_msgs/msg/Range')


def _cut_payload(_: int, message: EncodedMessage) -> EncodedMessage:
    return message._replace(payload=message.payload[:-9])


def _log_time_zero(_: int, message: EncodedMessage) -> EncodedMessage:
    return message._replace(log_ns=0)


def _stamps_from_1970(block: Block) -> Block:
    return replace(block, stamp_ns=block.stamp_ns - block.stamp_ns[0])


def _case(kind: str, make: Callable[[Path], Path], *says: str, status: int = 1) -> Case:
    return Case('Bags', kind, lambda folder: ['replay', str(make(folder))], status, says)


CASES = (
    _case('an empty file', _bytes(b''), "'bag.mcap' is empty; nothing was recorded"),
    _case(
        'a text file called .mcap',
        _bytes(b'time,speed\n0,8.0\n'),
        "is no MCAP file, it begins with b'time,spe'",
        'give a .mcap file',
    ),
    _case(
        'an sqlite3 file',
        _bytes(b'SQLite format 3\0' + bytes(4096)),
        'is a bag in sqlite3 storage',
        'shipdrag import',
    ),
    _case(
        'a bag of ROS 1',
        _bytes(b'#ROSBAG V2.0\n' + bytes(4096)),
        'is a bag of ROS 1',
        'shipdrag import',
    ),
    _case(
        'cut off in its first 20 bytes',
        lambda f: _bytes(_sound(f).read_bytes()[:20])(f),
        'holds no message',
        'is damaged (truncated): left out',
        'give another bag',
    ),
    _case(
        'cut off at 40 %',
        _cut(0.4),
        'Warning: bag.mcap: the file was not closed, or it is cut off',
        'is damaged (truncated): left out',
        status=0,
    ),
    _case(
        'zeros from the middle on, as a power cut leaves them',
        _cut(0.5, zeros=True),
        'Warning: bag.mcap: the record at byte',
        'is damaged (garbage): left out',
        status=0,
    ),
    _case(
        'no messages at all',
        _samples(lambda b: b[:0]),
        "'bag.mcap' holds no message: nothing was recorded; give another bag",
    ),
    _case(
        'another type on the topic of an input',
        _messages(_log_of_another_type),
        'Warning: speed_through_water: 302 of 302 messages not used; 302 type',
        status=0,
    ),
    _case(
        'no ship file attached',
        _samples(lambda b: b, ship=False),
        "'bag.mcap' has no ship.yaml attached or beside it; give one with --ship FILE",
    ),
    _case(
        'a bad ship file attached',
        _bad_ship,
        'ship.yaml: 1 problem',
        'displaced_volume_m3: missing, expected',
    ),
    _case(
        'messages in another encoding than CDR',
        _in_protobuf,
        '/speed_through_water is foxglove.Log (protobuf)',
        'read are speed_through_water: geometry_msgs',
    ),
    _case(
        'all payloads cut short',
        _messages(_cut_payload),
        'Warning: speed_through_water: 302 of 302 messages not used; 302 malformed',
        'check the driver and the recorder',
        status=0,
    ),
    _case(
        'log time 0 in every message',
        _messages(_log_time_zero),
        'Warning: speed_through_water: 302 of 302 messages not used; 302 future',
        'set the clocks',
        status=0,
    ),
    _case(
        'all stamps 0',
        _samples(lambda b: replace(b, stamp_ns=0 * b.stamp_ns)),
        'Warning: speed_through_water: 301 of 302 messages not used; 301 duplicate',
        'does the driver stamp each message?',
        status=0,
    ),
    _case(
        'stamps from 1970 on, clock never set',
        _samples(_stamps_from_1970),
        'speed_through_water       302   302',
        status=0,
    ),
)
