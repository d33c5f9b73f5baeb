# SPDX-License-Identifier: Apache-2.0
"""A finished part, rewritten: the same messages, smaller, and never neither file."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from shipdrag_ros import __version__
from shipdrag_ros.bags import recover
from shipdrag_ros.bags.durable import LiveFile
from shipdrag_ros.bags.recover import SUFFIX, compact
from shipdrag_ros.bags.writer import RecordWriter
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import encode
from shipdrag_ros.samples import Block
from tests.recorded import attachments, summary

ATTACHED = {'ship.yaml': 'name: x\n', 'parameters.yaml': '{}\n'}


def grown(path: Path, block: Block, *, close: bool = True) -> LiveFile:
    file = LiveFile(path, recording_id='r', part=2, attachments=ATTACHED)
    messages = list(encode(block))
    for first in range(0, len(messages), 5):
        file.append(messages[first : first + 5])
    if close:
        file.close()
    else:
        file.sync()
    return file


def content(path: Path) -> list[tuple[str, str, int, int, bytes]]:
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [
            (c.topic, s.name if s else '', m.log_time, m.publish_time, m.data)
            for s, c, m in reader.iter_messages(log_time_order=False)
        ]


@pytest.mark.parametrize('close', [True, False])
def test_the_same_messages_with_an_index_in_less_room(tmp_path, block: Block, close: bool) -> None:
    file = grown(tmp_path / 'a.mcap', block, close=close)
    before = file.path.stat().st_size
    compact(file.path, messages=len(block))
    assert content(file.path) == [
        (m.topic, m.type, m.log_ns, m.publish_ns, m.payload) for m in encode(block)
    ]
    assert file.path.stat().st_size < 0.35 * before
    assert [path.name for path in tmp_path.iterdir()] == ['a.mcap']
    sizes = [chunk.uncompressed_size for chunk in summary(file.path).chunk_indexes]
    # a flipped bit costs one of them
    assert 1 << 14 <= max(sizes) < 0.1 * sum(sizes)
    assert attachments(file.path) == ATTACHED
    with file.path.open('rb') as stream:
        (metadata,) = make_reader(stream).iter_metadata()
    assert metadata.metadata == {'version': __version__, 'recording_id': 'r', 'part': '2'}


def test_without_its_first_chunk_the_others_still_know_their_topics(tmp_path, block):
    file = grown(tmp_path / 'a.mcap', block)
    compact(file.path, messages=len(block))
    opcodes = []
    with file.path.open('rb') as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            opcodes.append(type(record).__name__)
    topics = {message.topic for message in encode(block)}
    outside_of_chunks = opcodes[: opcodes.index('DataEnd')]
    assert outside_of_chunks.count('Channel') == len(topics)
    assert 'Schema' in opcodes[: opcodes.index('Chunk')]


def test_a_file_in_which_messages_are_missing_is_left_alone(tmp_path: Path, block: Block) -> None:
    file = grown(tmp_path / 'a.mcap', block)
    with file.path.open('r+b') as stream:
        stream.truncate(file.path.stat().st_size - 500)
    before = file.path.read_bytes()
    with pytest.raises(BagError, match=f'{len(block)} were written'):
        compact(file.path, messages=len(block))
    assert file.path.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ['a.mcap']


def test_a_damaged_file_is_left_alone(tmp_path: Path, block: Block) -> None:
    file = grown(tmp_path / 'a.mcap', block)
    damaged = bytearray(file.path.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    file.path.write_bytes(damaged)
    with pytest.raises(BagError, match='cannot be compacted'):
        compact(file.path, messages=len(block))
    assert file.path.read_bytes() == damaged


def test_what_an_interrupted_attempt_left_is_no_obstacle(tmp_path: Path, block: Block) -> None:
    file = grown(tmp_path / 'a.mcap', block)
    for name in (f'a.mcap{SUFFIX}', f'.a.mcap{SUFFIX}.part'):
        (tmp_path / name).write_bytes(b'half of it')
    compact(file.path, messages=len(block))
    assert len(content(file.path)) == len(block)
    assert [path.name for path in tmp_path.iterdir()] == ['a.mcap']


@pytest.mark.parametrize(
    ('owner', 'step', 'call', 'whole'),
    [
        (RecordWriter, 'close', 1, 'before'),
        (Path, 'replace', 1, 'before'),
        (recover, 'sync_directory', 1, 'after'),
    ],
)
def test_killed_at_any_step_it_leaves_one_whole_file(
    tmp_path: Path,
    block: Block,
    monkeypatch: pytest.MonkeyPatch,
    owner: Any,
    step: str,
    call: int,
    whole: str,
) -> None:
    file = grown(tmp_path / 'a.mcap', block)
    before = file.path.read_bytes()

    calls = []
    done = getattr(owner, step)

    def die(*given: Any, **named: Any) -> Any:
        calls.append(given)
        if len(calls) == call:
            os.kill(os.getpid(), signal.SIGKILL)
        return done(*given, **named)

    child = os.fork()
    if child == 0:
        monkeypatch.setattr(owner, step, die)
        try:
            compact(file.path, messages=len(block))
        finally:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == -signal.SIGKILL
    assert (file.path.read_bytes() == before) == (whole == 'before')
    if whole == 'after':
        assert len(content(file.path)) == len(block)
