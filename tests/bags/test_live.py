# SPDX-License-Identifier: Apache-2.0
"""A file that grows: what is in it wherever it is cut, and what other readers say of it."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from mcap.exceptions import EndOfFile
from mcap.records import Attachment, Channel, Message, Schema
from mcap.stream_reader import StreamReader

from shipdrag_ros.bags.durable import DECLARE_BYTES, LiveFile
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import EncodedMessage

SHAFT, DEPTH = 'sensor_msgs/msg/JointState', 'sensor_msgs/msg/Range'


def message(number: int, *, topic: str = '/depth', size: int = 40) -> EncodedMessage:
    kind = DEPTH if topic == '/depth' else SHAFT
    return EncodedMessage(topic, kind, number.to_bytes(size, 'little'), number, number)


def live(path: Path) -> LiveFile:
    return LiveFile(path, recording_id='r', part=2, attachments={'ship.yaml': 'name: x\n'})


def records(path: Path, *, until: int | None = None) -> list[object]:
    """Return what a plain reader gets out of the first bytes of a file."""
    cut = path.with_suffix('.cut')
    cut.write_bytes(path.read_bytes()[:until])
    found: list[object] = []
    with cut.open('rb') as stream:
        try:
            for record in StreamReader(stream, validate_crcs=True).records:
                found.append(record)
        except (EndOfFile, struct.error):
            pass
    return found


def numbers(found: list[object]) -> list[int]:
    return [record.log_time for record in found if isinstance(record, Message)]


def test_attachments_stand_before_the_first_message_and_topics_before_their_own(tmp_path) -> None:
    file = live(tmp_path / 'a.mcap')
    file.append([message(1)])
    file.append([message(2, topic='/shaft')])
    file.close()
    kinds = [type(it) for it in records(file.path)]
    order = [kind for kind in kinds if kind in (Attachment, Schema, Channel, Message)]
    assert order == [Attachment, Schema, Channel, Message, Schema, Channel, Message]


def test_topics_are_declared_again(tmp_path: Path) -> None:
    file = live(tmp_path / 'a.mcap')
    for number in range(3):
        file.append([message(number, size=DECLARE_BYTES)])
    file.close()
    channels = [it for it in records(file.path) if isinstance(it, Channel)]
    assert [channel.topic for channel in channels] == ['/depth'] * 3
    assert {channel.id for channel in channels} == {1}


def test_only_what_was_synced_is_left_of_a_file_that_is_abandoned(tmp_path: Path) -> None:
    file = live(tmp_path / 'a.mcap')
    file.append([message(1)])
    assert (file.synced_messages, file.synced_bytes < file.size_bytes) == (0, True)
    file.sync()
    assert (file.synced_messages, file.synced_bytes) == (1, file.size_bytes)
    file.append([message(2)])
    file.abandon()
    assert file.path.stat().st_size == file.synced_bytes
    assert numbers(records(file.path)) == [1]


def test_nothing_is_left_of_a_file_without_messages_that_is_abandoned(tmp_path: Path) -> None:
    file = live(tmp_path / 'a.mcap')
    file.append([message(1)])
    file.abandon()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('replaced', [False, True])
def test_a_file_that_was_taken_away_is_noticed(tmp_path: Path, replaced: bool) -> None:
    file = live(tmp_path / 'a.mcap')
    file.append([message(1)])
    file.path.rename(tmp_path / 'b.mcap')
    if replaced:
        file.path.write_text('another')
    with pytest.raises(BagError, match=r"a\.mcap'.*(No such file|replaced)"):
        file.sync()
