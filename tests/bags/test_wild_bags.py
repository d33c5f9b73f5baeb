# SPDX-License-Identifier: Apache-2.0
"""
Bags with anything in them: no crash, no hang, no unbounded memory, nothing lost in silence.
"""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from collections.abc import Callable
from contextlib import suppress
from datetime import timedelta
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.writer import CompressionType

from shipdrag_ros.bags import BagWriter, Compression, mcap_file, open_runs
from shipdrag_ros.bags.check import check
from shipdrag_ros.bags.durable import LiveFile
from shipdrag_ros.bags.records import MAGIC, walk
from shipdrag_ros.bags.recover import recover
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import encode
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from tests.bags.conftest import as_chunk, as_record, foreign

EXAMPLES = settings(
    max_examples=60,
    deadline=timedelta(seconds=10),  # a hang, not a slow machine
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
WILD = (0, 1, 1 << 31, 1 << 32, 1 << 60, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)
BOMB_BYTES = 1 << 29
SHIP = Ship(name='test ship', length_m=150.0, displaced_volume_m3=20200.0)


def by_us(path: Path, block: Block, compression: Compression) -> None:
    with BagWriter(path, compression=compression, chunk_bytes=3000) as bag:
        bag.attach('ship.yaml', SHIP.to_yaml())
        bag.write_samples(block)


def unfinished(path: Path, block: Block) -> None:
    file = LiveFile(path, recording_id='r', part=0, attachments={'ship.yaml': SHIP.to_yaml()})
    messages = list(encode(block))
    for first in range(0, len(messages), 7):
        file.append(messages[first : first + 7])
    file.sync()
    file.abandon()


MAKERS: dict[str, Callable[[Path, Block], None]] = {
    'zstd': lambda path, block: by_us(path, block, Compression.ZSTD),
    'lz4': lambda path, block: by_us(path, block, Compression.LZ4),
    'none': lambda path, block: by_us(path, block, Compression.NONE),
    'live': unfinished,
    'one chunk': lambda path, block: foreign(path, block, chunk_size=1 << 20),
    'unchunked': lambda path, block: foreign(path, block, use_chunking=False),
    'no checksums': lambda path, block: foreign(
        path, block, enable_crcs=False, chunk_size=3000, compression=CompressionType.NONE
    ),
}
CHECKED = ['zstd', 'lz4', 'none', 'live']  # whose chunks and index have checksums


@pytest.fixture(scope='module')
def bags(tmp_path_factory: pytest.TempPathFactory, block: Block) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp('bags')
    for name, make in MAKERS.items():
        make(folder / f'{name}.mcap', block[:200])
    return {name: (folder / f'{name}.mcap').read_bytes() for name in MAKERS}


def read(path: Path, content: bytes) -> tuple[Block, tuple[str, ...]]:
    """Return the samples, and what is said of damage."""
    path.write_bytes(content)
    (run,) = open_runs([path])
    inputs = run.inputs()
    found = inputs.block()
    list(run.outputs())
    span = run.span_ns
    if span is not None:
        list(run.inputs(start_ns=sum(span) // 2, end_ns=span[1]))
    return found, run.warnings + tuple(str(reasons) for reasons in inputs.unreadable.items())


def read_or_refuse(path: Path, content: bytes) -> tuple[Block, tuple[str, ...]] | None:
    try:
        return read(path, content)
    except BagError as error:
        assert str(path) in str(error)  # noqa: PT017
        return None


def offsets(content: bytes) -> list[int]:
    closed = content.endswith(MAGIC)
    end = len(content) - len(MAGIC) if closed else len(content)
    return [place.offset for place in walk(content, len(MAGIC), end)]


def mangled(draw: Callable[[st.SearchStrategy[Any]], Any], content: bytes) -> bytes:
    """Flip, overwrite, cut out, double, cut off or put in."""
    data = bytearray(content)
    records = offsets(content)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(data) - 1) | st.sampled_from(records))
        at = min(at, len(data) - 1)
        size = draw(st.integers(1, 300))
        match draw(st.integers(0, 7)):
            case 0 | 1:
                data[at] ^= 1 << draw(st.integers(0, 7))
            case 2:  # the length of a record, or of something in it
                at += draw(st.integers(1, 40))
                data[at : at + 8] = draw(st.sampled_from(WILD)).to_bytes(8, 'little')
            case 3:
                data[at : at + size] = bytes(len(data[at : at + size]))
            case 4:
                del data[at : at + size]
            case 5:
                data[at:at] = data[at : at + size]
            case 6:
                del data[at + 1 :]
            case 7:
                data[at:at] = draw(st.binary(max_size=64))
        if not data:
            break
    return bytes(data)


@pytest.mark.parametrize('name', MAKERS)
@EXAMPLES
@given(data=st.data())
def test_no_damage_makes_a_crash(tmp_path, bags, name, data):
    path = tmp_path / 'a.mcap'
    read_or_refuse(path, mangled(data.draw, bags[name]))
    with suppress(BagError):
        check([path])
    saved = tmp_path / 'saved.mcap'
    for each in (saved, saved.with_suffix('.quarantine.mcap')):
        each.unlink(missing_ok=True)
    with suppress(BagError):
        recover(path, saved)


@pytest.mark.parametrize('name', CHECKED)
@EXAMPLES
@given(data=st.data())
def test_flipped_bits_lose_nothing_in_silence_and_change_nothing(tmp_path, bags, name, data):
    whole, _ = read(tmp_path / 'whole.mcap', bags[name])
    damaged = bytearray(bags[name])
    for place in data.draw(st.lists(st.integers(8, len(damaged) - 1), min_size=1, max_size=3)):
        damaged[place] ^= 1 << data.draw(st.integers(0, 7))
    result = read_or_refuse(tmp_path / 'a.mcap', bytes(damaged))
    if result is None:
        return
    found, told = result
    if len(found) < len(whole):
        assert told
    place = {int(time): number for number, time in enumerate(whole.receive_ns)}
    kept = whole[np.array([place[int(time)] for time in found.receive_ns], np.intp)]
    np.testing.assert_array_equal(found.stamp_ns, kept.stamp_ns)
    np.testing.assert_array_equal(found.value, kept.value)


def without_checksum(content: bytes) -> bytearray:
    """Let the index be changed unnoticed: a checksum of 0 is none."""
    data = bytearray(content)
    data[-len(MAGIC) - 4 : -len(MAGIC)] = bytes(4)
    return data


@pytest.mark.parametrize('name', ['zstd', 'unchunked', 'no checksums'])
@EXAMPLES
@given(data=st.data())
def test_no_wild_index_makes_a_crash(tmp_path, bags, name, data):
    damaged = without_checksum(bags[name])
    (summary_start,) = struct.unpack_from('<Q', damaged, len(damaged) - len(MAGIC) - 20)
    places = st.integers(summary_start, len(damaged) - len(MAGIC) - 8)
    for place in data.draw(st.lists(places, min_size=1, max_size=4)):
        wild = data.draw(st.sampled_from(WILD) | st.integers(0, len(damaged)))
        damaged[place : place + 8] = wild.to_bytes(8, 'little')
    read_or_refuse(tmp_path / 'a.mcap', bytes(damaged))


def chunk_indexes(content: bytes) -> list[int]:
    """Return where the contents of the chunk indexes are: two times, then a place."""
    found = walk(content, len(MAGIC), len(content) - len(MAGIC))
    return [place.start for place in found if place.opcode == Opcode.CHUNK_INDEX]


@pytest.mark.parametrize(
    ('field', 'value'),
    [
        (16, 'the place of the first'),
        (16, 'behind a chunk'),
        (8, 1 << 63),
        (0, (1 << 64) - 1),
        (16, 1 << 60),
    ],
)
def test_an_index_that_cannot_be_true_is_not_used(tmp_path, bags, field, value):
    whole, _ = read(tmp_path / 'whole.mcap', bags['zstd'])
    damaged = without_checksum(bags['zstd'])
    first, second, *_ = chunk_indexes(bytes(damaged))
    start, length = struct.unpack_from('<QQ', damaged, first + 16)
    if isinstance(value, str):
        value = start if value == 'the place of the first' else start + length
    struct.pack_into('<Q', damaged, second + field, value)
    found, told = read(tmp_path / 'a.mcap', bytes(damaged))
    np.testing.assert_array_equal(found.value, whole.value)
    assert 'read from its beginning, without an index' in told[0]


def zstd_without_size(content: bytes) -> bytes:
    compressor = zstandard.ZstdCompressor(level=1).compressobj()
    return compressor.compress(content) + compressor.flush()


@pytest.fixture(scope='module')
def bombs() -> dict[str, bytes]:
    """Small when packed, too large when unpacked."""
    content = bytes(BOMB_BYTES)
    return {
        'zstd': zstandard.ZstdCompressor(level=1).compress(content),
        'zstd without a size': zstd_without_size(content),
        'lz4': lz4.frame.compress(content),
    }


@pytest.mark.parametrize('stated', [1000, BOMB_BYTES, 1 << 60, (1 << 64) - 1])
@pytest.mark.parametrize('kind', ['zstd', 'zstd without a size', 'lz4'])
def test_a_chunk_that_unpacks_without_end(tmp_path, bombs, kind, stated):
    bomb = bombs[kind]
    content = MAGIC + as_chunk(kind.split()[0], bomb, stated)
    assert len(content) < BOMB_BYTES / 100
    tracemalloc.start()
    found, told = read(tmp_path / 'a.mcap', content)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(found) == 0
    assert any('the chunk at byte 8 is damaged' in text for text in told)
    assert peak < 3 * len(bomb) + (1 << 22)


def test_a_packed_file_that_unpacks_without_end(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(mcap_file, 'CHUNK_LIMIT_BYTES', 1 << 20)
    path = tmp_path / 'a.mcap.zstd'
    for size, raised in ((1 << 19, 'is no MCAP file'), (1 << 27, 'cannot be unpacked')):
        path.write_bytes(zstandard.ZstdCompressor().compress(bytes(size)))
        with pytest.raises(BagError, match=raised):
            open_runs([path])


def test_messages_out_of_order_are_held_back_up_to_a_limit(tmp_path, monkeypatch) -> None:
    n = 3000
    received = np.arange(n) + 1000
    received[::20] = 5  # in every chunk one that came first
    block = Block.of(Channel.SHAFT, np.arange(n), np.arange(n) * 1.0, receive_ns=received)
    foreign(tmp_path / 'a.mcap', block, chunk_size=2000)
    content = (tmp_path / 'a.mcap').read_bytes()
    monkeypatch.setattr(mcap_file, '_WORTHWHILE_BYTES', 1)
    found, _ = read(tmp_path / 'a.mcap', content)
    np.testing.assert_array_equal(found.stamp_ns, np.argsort(received, kind='stable'))
    monkeypatch.setattr(mcap_file, '_WAITING_LIMIT_BYTES', 50_000)
    with pytest.raises(BagError, match=r'out of order.*write it again'):
        read(tmp_path / 'a.mcap', content)


@EXAMPLES
@given(data=st.data())
def test_a_live_file_cut_anywhere_gives_what_came_before(tmp_path, bags, data):
    whole, _ = read(tmp_path / 'whole.mcap', bags['live'])
    end = data.draw(st.integers(len(MAGIC), len(bags['live'])))
    found, told = read(tmp_path / 'a.mcap', bags['live'][:end])
    np.testing.assert_array_equal(found.value, whole.value[: len(found)])
    assert len(found) % 7 == 0 or len(found) == len(whole)
    assert 'was not closed, or it is cut off' in told[0]


@pytest.mark.parametrize('fraction', [0.6, 0.9, 1.0])
def test_a_live_file_is_replayed_and_its_damage_told(tmp_path, bags, fraction):
    path = tmp_path / 'a.mcap'
    whole = bags['live']
    path.write_bytes(whole[: int(fraction * len(whole))])
    (run,) = open_runs([path])
    result = replay(run)
    assert result.ship == SHIP
    messages = sum(counts.messages for counts in result.inputs.values())
    assert messages == sum(topic.messages for topic in run.topics)
    assert (messages == 200) is (fraction == 1.0)
    assert 'was not closed, or it is cut off' in result.run.warnings[0]
    assert len(run.warnings) == (1 if fraction == 1.0 else 2)


def test_a_checksum_is_tested(tmp_path: Path, bags: dict[str, bytes]) -> None:
    """The same record in a chunk with the right checksum, a wrong one, and none."""
    records = as_record(Opcode.METADATA, b'')
    for checksum, told in ((zlib.crc32(records), False), (1, True), (0, False)):
        _, warnings = read(
            tmp_path / 'a.mcap', MAGIC + as_chunk('', records, len(records), checksum)
        )
        assert any('(checksum)' in text for text in warnings) is told


@pytest.mark.parametrize('packing', ['zstd', 'lz4'])
def test_a_chunk_where_the_index_should_be_is_not_unpacked(tmp_path: Path, packing: str) -> None:
    """No writer puts one there; whoever does may say that it is of any size, or packed wrong."""
    head = MAGIC + as_record(Opcode.HEADER, struct.pack('<I4sI', 4, b'ros2', 0))
    head += as_record(Opcode.DATA_END, bytes(4))
    footer = as_record(Opcode.FOOTER, struct.pack('<QQI', len(head), 0, 0)) + MAGIC
    content = head + as_chunk(packing, b'nonsense', 1 << 40) + footer
    found, told = read(tmp_path / 'a.mcap', content)
    assert (len(found), told) == (0, ())
    assert not open_runs([tmp_path / 'a.mcap'])[0].indexed
