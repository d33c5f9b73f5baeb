# SPDX-License-Identifier: Apache-2.0
"""Bad bags: damaged, foreign, without what is needed, with impossible times."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.writer import Writer

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.bags.mcap_file import McapFile
from shipdrag_ros.messages import EncodedMessage, encode
from shipdrag_ros.samples import Block, Channel
from tests.bad_input.case import Case, steady, write, write_messages

_KILLED = """
import os, signal, sys
from shipdrag_ros.bags import BagWriter
from shipdrag_ros.messages import encode
sys.path.insert(0, sys.argv[2])
from tests.bad_input.case import SHIP_FILE, steady
bag = BagWriter(sys.argv[1], chunk_bytes=16384)
bag.attach('ship.yaml', SHIP_FILE.read_text())
bag.write_samples(steady())
os.kill(os.getpid(), signal.SIGKILL)
"""
_SQLITE = 'rosbag2_bagfile_information:\n  storage_identifier: sqlite3\n'
_MISSING_PART = """\
rosbag2_bagfile_information:
  storage_identifier: mcap
  relative_file_paths: [bag_0.mcap, bag_1.mcap]
"""


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
        path = _sound(folder)
        content = path.read_bytes()
        kept = content[: int(fraction * len(content))]
        path.write_bytes(kept + bytes(len(content) - len(kept)) if zeros else kept)
        return path

    return make


def _flip(place: Callable[[Path], int]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = _sound(folder)
        content = bytearray(path.read_bytes())
        content[place(path)] ^= 1
        path.write_bytes(content)
        return path

    return make


def _in_a_chunk(path: Path) -> int:
    segments = McapFile(path).contents.segments
    chunk = segments[len(segments) // 2]
    return (chunk.offset + chunk.end) // 2


def _in_the_index(path: Path) -> int:
    return path.stat().st_size - 200


def _killed(folder: Path) -> Path:
    path = folder / 'bag.mcap'
    here = str(Path(__file__).parent)
    subprocess.run([sys.executable, '-c', _KILLED, str(path), here], check=False, timeout=60)
    return path


def _directory(**files: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = folder / 'bag'
        path.mkdir()
        for name, text in files.items():
            (path / name.replace('__', '.')).write_text(text)
        return path

    return make


def _part_missing(folder: Path) -> Path:
    path = _directory(metadata__yaml=_MISSING_PART)(folder)
    write(path / 'bag_0.mcap', steady())
    return path


def _messages(change: Callable[[int, EncodedMessage], EncodedMessage]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        changed = [change(i, message) for i, message in enumerate(encode(steady()))]
        return write_messages(folder / 'bag.mcap', changed)

    return make


def _samples(change: Callable[[Block], Block], *, ship: bool = True) -> Callable[[Path], Path]:
    return lambda folder: write(folder / 'bag.mcap', change(steady()), ship=ship)


def _two_namespaces(folder: Path) -> Path:
    messages = [*encode(steady(), namespace='/port'), *encode(steady(), namespace='/starboard')]
    return write_messages(folder / 'bag.mcap', sorted(messages, key=lambda m: m.log_ns))


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


def _other_topic(_: int, message: EncodedMessage) -> EncodedMessage:
    return message._replace(topic=f'/log{message.topic}_raw')


def _log_of_another_type(_: int, message: EncodedMessage) -> EncodedMessage:
    if message.topic != '/speed_through_water':
        return message
    return message._replace(type='sensor_msgs/msg/Range')


def _cut_payload(which: Callable[[int], bool]) -> Callable[[int, EncodedMessage], EncodedMessage]:
    return lambda i, message: (
        message._replace(payload=message.payload[:-9]) if which(i) else message
    )


def _log_time_zero(_: int, message: EncodedMessage) -> EncodedMessage:
    return message._replace(log_ns=0)


def _stamps_from_1970(block: Block) -> Block:
    return replace(block, stamp_ns=block.stamp_ns - block.stamp_ns[0])


def _log_from_1970(block: Block) -> Block:
    away = np.where(block.channel == Channel.SPEED_THROUGH_WATER, block.stamp_ns[0], 0)
    return replace(block, stamp_ns=block.stamp_ns - away)


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
    _case('a file of zeros', _bytes(bytes(4096)), 'is no MCAP file', 'give a .mcap file'),
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
        'cut off before the last bytes',
        _cut(0.999),
        'Warning: bag.mcap: the file was not closed, or it is cut off',
        '302   302',
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
        'a bit flipped in the middle',
        _flip(_in_a_chunk),
        'Warning: bag.mcap: the chunk at byte',
        'is damaged (checksum): left out',
        'messages are there where the index lists 1208',
        status=0,
    ),
    _case(
        'a bit flipped in the index',
        _flip(_in_the_index),
        'Warning: bag.mcap: the index has a wrong checksum',
        '302   302',
        status=0,
    ),
    _case(
        'the recording process was killed',
        _killed,
        'Warning: bag.mcap: the file was not closed, or it is cut off',
        status=0,
    ),
    _case(
        'no messages at all',
        _samples(lambda b: b[:0]),
        "'bag.mcap' holds no message: nothing was recorded; give another bag",
    ),
    _case(
        'a directory without any bag',
        _directory(notes__txt='nothing here'),
        "'bag' holds no .mcap file; it holds notes.txt",
    ),
    _case(
        'a rosbag2 directory in sqlite3',
        _directory(metadata__yaml=_SQLITE),
        "'bag' is a bag in 'sqlite3' storage",
        'shipdrag import',
    ),
    _case(
        'a metadata.yaml that is none',
        _directory(metadata__yaml='speed: [1, 2\n'),
        "'bag/metadata.yaml' is no metadata of rosbag2 (not YAML: line",
    ),
    _case(
        'a rosbag2 directory with a part missing',
        _part_missing,
        'Warning: bag_1.mcap is listed in metadata.yaml and is not there',
        status=0,
    ),
    _case(
        'none of the topics is an input',
        _messages(_other_topic),
        'holds none of the inputs speed_through_water',
        '/log/speed_through_water_raw',
        '--remap FROM:=TO',
    ),
    _case(
        'another type on the topic of an input',
        _messages(_log_of_another_type),
        'Warning: speed_through_water: 302 of 302 messages not used; 302 type',
        status=0,
    ),
    _case(
        'the same input in two namespaces',
        _two_namespaces,
        'found under 2 topics, /port/speed_through_water, /starboard/speed_through_water',
        'choose one with --remap',
    ),
    _case(
        'no ship file attached',
        _samples(lambda b: b, ship=False),
        "'bag.mcap' has no ship.yaml attached; give one with --ship FILE",
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
        'every tenth payload cut short',
        _messages(_cut_payload(lambda i: i % 10 == 0)),
        '61 malformed',
        status=0,
    ),
    _case(
        'all payloads cut short',
        _messages(_cut_payload(lambda i: True)),
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
    _case(
        'the clock of one sensor in 1970',
        _samples(_log_from_1970),
        'Warning: speed_through_water: 301 of 302 messages not used; 301 late',
        'set the clocks',
        status=0,
    ),
)
