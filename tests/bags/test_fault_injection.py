# SPDX-License-Identifier: Apache-2.0
"""
Every kind of record of files of several writers: cut at, flipped in, deleted, doubled.

Whatever the damage, each message that it did not touch is saved, nothing is invented,
the outcome is sound, and the damage is found.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from shutil import disk_usage
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.bags.check import check
from shipdrag_ros.bags.durable import LiveFile
from shipdrag_ros.bags.records import HEAD, MAGIC, walk
from shipdrag_ros.bags.recover import recover
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.messages import encode, types
from shipdrag_ros.samples import Block, Channel

WRITERS: dict[str, dict[str, Any]] = {
    'zstd': {'compression': CompressionType.ZSTD, 'chunk_size': 2048},
    'lz4': {'compression': CompressionType.LZ4, 'chunk_size': 4096},
    'plain chunks': {'compression': CompressionType.NONE, 'chunk_size': 3000},
    'one chunk': {'compression': CompressionType.ZSTD, 'chunk_size': 1 << 20},
    'unchunked': {'use_chunking': False},
}
MESSAGES = 120
MEMORY = Path('/dev/shm')  # a disk would sync each of thousands of files
ENOUGH_BYTES = 1 << 30
SMALL = [Channel.SHAFT, Channel.DEPTH]  # of few bytes a message


class Message(NamedTuple):
    """A message, known by what was written."""

    number: int
    topic: str
    log_ns: int
    payload: bytes


class Record(NamedTuple):
    """A record of a sound file, and the numbers of the messages in it."""

    opcode: int
    offset: int
    end: int
    inside: frozenset[int]


class Sample(NamedTuple):
    """A sound file."""

    content: bytes
    records: tuple[Record, ...]
    messages: frozenset[Message]

    def untouched(self, record: Record) -> frozenset[Message]:
        """Return the messages that do not lie in a record."""
        return frozenset(m for m in self.messages if m.number not in record.inside)


class Saved(NamedTuple):
    """What came out."""

    sound: frozenset[Message]
    doubtful: frozenset[Message]


Samples = dict[str, Sample]
Save = Callable[[bytes], Saved]
DamageOf = Callable[[bytes], set[tuple[str, str]]]


def make(block: Block, options: dict[str, Any]) -> Sample:
    """Write a file with all kinds of records, and a checksum over all of them."""
    file = BytesIO()
    writer = Writer(file, enable_data_crcs=True, **options)
    writer.start('ros2', 'a library')
    writer.add_attachment(0, 0, 'ship.yaml', 'application/yaml', b'name: x\n' * 20)
    writer.add_metadata('notes', {'weather': 'calm'})
    channels: dict[str, int] = {}
    for number, message in enumerate(encode(block[:MESSAGES])):
        if message.topic not in channels:
            text = types.definition(message.type).encode()
            schema = writer.register_schema(message.type, 'ros2msg', text)
            channels[message.topic] = writer.register_channel(message.topic, 'cdr', schema, {})
        writer.add_message(
            channels[message.topic], message.log_ns, message.payload, message.publish_ns, number
        )
    writer.finish()
    content = file.getvalue()
    return Sample(content, tuple(records_of(content)), messages_of(content))


def records_of(content: bytes) -> Iterator[Record]:
    """Yield the records of a sound file; those of a chunk are part of it."""
    at = len(MAGIC)
    while at < len(content) - len(MAGIC):
        opcode, length = HEAD.unpack_from(content, at)
        end = at + HEAD.size + length
        inside = set()
        if opcode in (Opcode.CHUNK, Opcode.MESSAGE):
            stream = StreamReader(BytesIO(content[at:end]), skip_magic=True)
            try:
                for record in stream.records:
                    if hasattr(record, 'sequence'):
                        inside.add(record.sequence)
            except McapError:
                pass  # the end of the span
        yield Record(opcode, at, end, frozenset(inside))
        at = end


def messages_of(content: bytes) -> frozenset[Message]:
    """Return the messages of a sound file, as another reader finds them."""
    return frozenset(
        Message(message.sequence, channel.topic, message.log_time, message.data)
        for _, channel, message in make_reader(BytesIO(content)).iter_messages()
    )


@pytest.fixture(scope='module')
def samples(block: Block) -> dict[str, Sample]:
    return {writer: make(block, options) for writer, options in WRITERS.items()}


@pytest.fixture
def tmp_path(tmp_path: Path) -> Iterator[Path]:
    """Return a folder that need not last: in memory where there is room."""
    if not MEMORY.is_dir() or disk_usage(MEMORY).free < ENOUGH_BYTES:
        yield tmp_path
        return
    with TemporaryDirectory(dir=MEMORY) as folder:
        yield Path(folder)


@pytest.fixture
def save(tmp_path: Path) -> Callable[[bytes], Saved]:
    """Recover a file, and check that what comes out is sound and told rightly."""
    counted = iter(range(10**6))

    def run(content: bytes) -> Saved:
        source = tmp_path / f'{next(counted)}.mcap'
        source.write_bytes(content)
        result = recover(source, source.with_suffix('.out.mcap'))
        found = []
        for path, count in (
            (result.output, result.messages_recovered),
            (result.quarantine, result.messages_crc_suspect),
        ):
            if path is None:
                assert count == 0
                found.append(frozenset[Message]())
                continue
            (report,) = check([path])
            assert report.damage == ()
            assert report.messages == count
            found.append(messages_of(path.read_bytes()))
        assert 0 <= result.bytes_lost <= result.bytes_read == len(content)
        return Saved(*found)

    return run


@pytest.fixture
def damage_of(tmp_path: Path) -> Callable[[bytes], set[tuple[str, str]]]:
    """Name what `check` finds."""

    def run(content: bytes) -> set[tuple[str, str]]:
        path = tmp_path / 'checked.mcap'
        path.write_bytes(content)
        (report,) = check([path])
        assert report.sound == (not report.damage)
        assert all(0 <= each.offset <= len(content) for each in report.damage)
        return {(each.record, each.kind.value) for each in report.damage}

    return run


@pytest.mark.parametrize('writer', WRITERS)
def test_a_sound_file_is_sound_and_comes_out_whole(writer, samples, save, damage_of):
    sample = samples[writer]
    assert damage_of(sample.content) == set()
    assert save(sample.content) == (sample.messages, frozenset())
    assert {name(record.opcode) for record in sample.records} >= {
        'header',
        'attachment',
        'metadata',
        'data_end',
        'statistics',
        'attachment_index',
        'metadata_index',
        'summary_offset',
        'schema',
        'channel',
        'footer',
        *(['message'] if writer == 'unchunked' else ['chunk', 'message_index', 'chunk_index']),
    }


@pytest.mark.parametrize('writer', WRITERS)
def test_cut_at_every_record_and_inside(writer, samples, save, damage_of):
    sample = samples[writer]
    for record in _each_kind(sample):
        for cut in (record.offset, record.offset + 5, record.end - 9):
            before = {n for r in sample.records if r.end <= cut for n in r.inside}
            content = sample.content[:cut]
            assert ('footer', 'missing') in damage_of(content)
            if cut < sample.records[0].end:
                continue  # nothing is there to save
            saved = save(content)
            whole = {m for m in sample.messages if m.number in before}
            assert saved.sound == whole
            assert saved.doubtful <= sample.messages - whole
            if (
                writer == 'plain chunks'
                and record.opcode == Opcode.CHUNK
                and cut > record.end - 99
            ):
                assert saved.doubtful  # what lies before the cut needs no unpacking


@pytest.mark.parametrize('writer', WRITERS)
def test_a_bit_flipped_in_every_kind_of_record(writer, samples, save, damage_of):
    sample = samples[writer]
    rng = random.Random(1)
    for record in _each_kind(sample):
        # opcode, low, middle and high byte of the length, content
        places = [0, 1, 4, 8, *(rng.randrange(9, record.end - record.offset) for _ in range(3))]
        for place in places:
            bit = rng.randrange(8)
            content = bytearray(sample.content)
            content[record.offset + place] ^= 1 << bit
            what = f'{name(record.opcode)} at {record.offset}, byte {place}, bit {bit}'
            assert damage_of(bytes(content)), what
            saved = save(bytes(content))
            if record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and writer == 'unchunked':
                # each declared twice: one of the two may be believed
                assert _numbers(saved) == _numbers_of(sample.messages), what
                continue
            whole = sample.untouched(record)
            assert saved.sound | saved.doubtful >= whole, what
            if record.opcode != Opcode.MESSAGE:
                assert saved.sound >= whole, what
                assert saved.sound <= sample.messages, what
            else:  # the flipped one alone has no checksum of its own
                assert len(saved.sound - sample.messages) <= 1, what
            if record.opcode == Opcode.CHUNK and place < HEAD.size:
                assert saved.sound == sample.messages, what  # its checksum vouches for it


@pytest.mark.parametrize('writer', WRITERS)
@pytest.mark.parametrize('fault', ['delete', 'duplicate', 'garbage before', 'zeros before'])
def test_a_record_deleted_doubled_or_after_garbage(writer, fault, samples, save, damage_of):
    sample = samples[writer]
    rng = random.Random(2)
    for record in _each_kind(sample):
        content = sample.content
        put = {
            'delete': b'',
            'duplicate': 2 * content[record.offset : record.end],
            'garbage before': rng.randbytes(77) + content[record.offset : record.end],
            'zeros before': bytes(77) + content[record.offset : record.end],
        }[fault]
        damaged = content[: record.offset] + put + content[record.end :]
        what = f'{name(record.opcode)} at {record.offset}'
        assert damage_of(damaged), what
        saved = save(damaged)
        if fault == 'delete':
            assert saved.sound == sample.untouched(record), what
        else:
            assert saved.sound == sample.messages, what


@pytest.mark.parametrize('writer', WRITERS)
def test_bytes_lost_in_the_middle_of_a_record(writer: str, samples: Samples, save: Save) -> None:
    sample = samples[writer]
    rng = random.Random(3)
    for record in _each_kind(sample):
        for lost in (1, 16, 60):
            begin = rng.randrange(record.offset, record.end - 1)
            end = min(begin + lost, record.end)
            saved = save(sample.content[:begin] + sample.content[end:])
            whole = sample.untouched(record)
            what = f'{name(record.opcode)} at {record.offset}, {begin} to {end}'
            assert saved.sound | saved.doubtful >= whole, what
            if record.opcode != Opcode.MESSAGE:
                assert whole <= saved.sound <= sample.messages, what


@pytest.mark.parametrize('writer', WRITERS)
def test_damage_is_named_by_place_and_kind(writer: str, samples: Samples, tmp_path: Path) -> None:
    sample = samples[writer]
    for record in _each_kind(sample):
        content = bytearray(sample.content)
        content[record.offset + 8] ^= 0x10  # the record claims 2^60 bytes
        path = tmp_path / 'bag.mcap'
        path.write_bytes(content)
        (report,) = check([path])
        named = {(each.offset, each.record, each.kind.value) for each in report.damage}
        assert (record.offset, name(record.opcode), 'length') in named


def test_the_first_chunk_lost_its_topics_are_those_of_the_summary(samples, save, damage_of):
    sample = samples['zstd']
    first = next(record for record in sample.records if record.opcode == Opcode.CHUNK)
    content = bytearray(sample.content)
    content[first.offset : first.end] = bytes(first.end - first.offset)
    assert ('channel', 'duplicate') not in damage_of(bytes(content))
    saved = save(bytes(content))
    assert saved.sound == sample.untouched(first)
    # without a summary the messages are there, under names of their own
    cut = next(record for record in sample.records if record.opcode == Opcode.DATA_END)
    saved = save(bytes(content[: cut.offset]))
    assert saved.sound < sample.untouched(first)
    assert _numbers(saved) == _numbers_of(sample.untouched(first))
    assert {m.topic.rpartition('_')[0] for m in saved.doubtful} == {'/unknown_channel'}


def growing(path: Path, block: Block) -> bytes:
    file = LiveFile(path, recording_id='r', part=0, attachments={'ship.yaml': 'name: x'})
    messages = list(encode(block))
    for first in range(0, len(messages), 3):
        file.append(messages[first : first + 3])
    file.sync()
    return path.read_bytes()


def finished(path: Path, block: Block) -> bytes:
    with BagWriter(path, chunk_bytes=250) as bag:
        bag.attach('ship.yaml', 'name: x')
        bag.write_samples(block)
    return path.read_bytes()


def inside(content: bytes) -> list[tuple[int, int, Counter[bytes]]]:
    """Return where the chunks are, and the payloads in each."""
    found = []
    for place in walk(content, len(MAGIC), len(content)):
        if place.opcode == Opcode.CHUNK:
            stream = StreamReader(BytesIO(content[place.offset : place.end]), skip_magic=True)
            payloads: Counter[bytes] = Counter()
            with suppress(McapError):  # the end of the span
                payloads.update(it.data for it in stream.records if isinstance(it, McapMessage))
            found.append((place.offset, place.end, payloads))
    return found


@pytest.mark.parametrize('write', [growing, finished])
def test_cut_and_flipped_everywhere(write, tmp_path, block, save, damage_of):
    """A chunk that is whole is saved whole; nothing that is not is taken for sound."""
    content = write(tmp_path / 'a.mcap', block[np.isin(block.channel, SMALL)][:9])
    chunks = inside(content)
    everything = sum((payloads for *_, payloads in chunks), Counter())
    assert len(chunks) >= 3
    rng = random.Random(5)
    begin = chunks[0][0] - 60  # before it are long texts: of these some
    places = [*range(120, begin, 197), *range(begin, len(content), 5)]
    for number, at in enumerate(places):
        flipped = number % 2
        damaged = bytearray(content[: None if flipped else at])
        if flipped:
            damaged[at] ^= 1 << rng.randrange(8)
        saved = save(bytes(damaged))
        sound = Counter(message.payload for message in saved.sound)
        doubtful = Counter(message.payload for message in saved.doubtful)
        hit = [payloads for start, end, payloads in chunks if start <= at < end]
        if not flipped:
            hit += [payloads for start, _, payloads in chunks if start > at]
        whole = everything - sum(hit, Counter())
        assert sound + doubtful >= whole, at
        assert sound <= everything, at
        if hit or not flipped:  # elsewhere it may be what the channels are called
            assert sound >= whole, at
        # a bit that no unpacking looks at changes nothing
        assert damage_of(bytes(damaged)) or sound == everything, at


def test_a_key_without_its_value_is_damage(samples: Samples, tmp_path: Path) -> None:
    for first in range(0, 600, 9):
        content = bytearray(samples['zstd'].content)
        content[first : first + 300] = bytes(300)
        path = tmp_path / f'{first}.mcap'
        path.write_bytes(content)
        with suppress(ShipdragError):
            recover(path, path.with_name(f'{first}_saved.mcap'))


def name(opcode: int) -> str:
    return Opcode(opcode).name.lower()


def _each_kind(sample: Sample) -> list[Record]:
    """Return the first, a middle and the last record of each kind."""
    chosen: list[Record] = []
    for opcode in sorted({record.opcode for record in sample.records}):
        of_kind = [record for record in sample.records if record.opcode == opcode]
        chosen += {of_kind[0], of_kind[len(of_kind) // 2], of_kind[-1]}
    return chosen


def _numbers(saved: Saved) -> set[int]:
    return _numbers_of(saved.sound | saved.doubtful)


def _numbers_of(messages: frozenset[Message]) -> set[int]:
    return {message.number for message in messages}
