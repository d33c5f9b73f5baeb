# SPDX-License-Identifier: Apache-2.0
"""What is told of a bag is what is in it."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.writer import IndexType, Writer

from shipdrag_ros.bags import BagWriter, open_runs
from shipdrag_ros.bags.contents import contents_of
from shipdrag_ros.bags.records import MAGIC
from shipdrag_ros.bags.run import info
from shipdrag_ros.messages import EventKind, EventNote, event_message


def test_attachments_outputs_and_damage(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        bag.attach('ship.yaml', 'é')
        mark = event_message(EventNote(EventKind.RESET_REQUEST, 5, 'x'))
        bag.write(mark.topic, mark.type, mark.payload, log_ns=5, publish_ns=5)
    content = (tmp_path / 'a.mcap').read_bytes()
    (tmp_path / 'a.mcap').write_bytes(content[:-20])
    (run,) = open_runs([tmp_path / 'a.mcap'])
    told = info(run)
    assert told.attachments == {'ship.yaml': 2}
    assert told.node == '/coastdown_node'
    assert not told.indexed
    assert told.topics[0].rate_hz is None
    assert len(told.warnings) == 1


def test_an_empty_bag_of_another_tool(tmp_path: Path) -> None:
    with (tmp_path / 'a.mcap').open('wb') as file:
        writer = Writer(file, index_types=IndexType.NONE)
        writer.start()
        writer.finish()
    (run,) = open_runs([tmp_path / 'a.mcap'])
    told = info(run)
    assert told.start_ns is None
    assert told.duration_s == 0.0
    assert told.software is None
    assert told.compression == 'none'


@pytest.mark.parametrize('packing', [b'zstd', b'lz4'])
def test_a_chunk_where_the_index_should_be_is_not_unpacked(packing: bytes) -> None:
    """No writer puts one there; whoever does may say that it is of any size, or packed wrong."""

    def record(opcode: int, content: bytes) -> bytes:
        return struct.pack('<BQ', opcode, len(content)) + content

    def text(content: bytes) -> bytes:
        return struct.pack('<I', len(content)) + content

    head = MAGIC + record(Opcode.HEADER, text(b'ros2') + text(b''))
    head += record(Opcode.DATA_END, bytes(4))
    packed = struct.pack('<Q', 8) + b'nonsense'
    chunk = record(Opcode.CHUNK, struct.pack('<QQQI', 1, 1, 1 << 40, 0) + text(packing) + packed)
    footer = record(Opcode.FOOTER, struct.pack('<QQI', len(head), 0, 0)) + MAGIC
    contents = contents_of(head + chunk + footer)
    assert not contents.counts
    assert contents.warnings == []
    assert not contents.indexed
