# SPDX-License-Identifier: Apache-2.0
"""What is checked and recovered as a whole: directories, missing ends, and traps for memory."""

from __future__ import annotations

import multiprocessing
import random
import resource
import stat
import struct
import time
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import IndexType, Writer
from rosbags.rosbag2 import CompressionMode

from shipdrag_ros.bags import BagWriter, Compression, open_runs
from shipdrag_ros.bags.check import check
from shipdrag_ros.bags.records import MAGIC, walk
from shipdrag_ros.bags.recover import recover
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import EncodedMessage
from shipdrag_ros.samples import Block, Channel, concatenate
from tests.bags.conftest import as_chunk, as_record, assert_same, listed, rosbag2

WriteBag = Callable[..., Path]
MIB = 1 << 20


@pytest.mark.parametrize('mode', CompressionMode)
def test_a_directory_of_rosbag2(tmp_path: Path, block: Block, mode: CompressionMode) -> None:
    source = rosbag2(tmp_path / 'bag', block[:300], mode)
    (report,) = check([source])
    assert report.damage == ()
    result = recover(source, tmp_path / 'saved.mcap')
    assert result.messages_recovered == 300
    assert result.damage == ()
    assert result.quarantine is None
    # not 0600, as temporary files are: the group may read it
    assert stat.S_IMODE(Path(result.output).stat().st_mode) == 0o640
    (run,) = open_runs([result.output])
    assert_same(run.inputs().block(), block[:300])
    # cut off, as a loss of power leaves it
    (file,) = source.glob('*.mcap*')
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    assert not check([source])[0].sound
    if mode is CompressionMode.FILE:  # one block, of which nothing can be unpacked
        with pytest.raises(BagError, match='nothing can be saved'):
            recover(source, tmp_path / 'cut.mcap')
        return
    cut = recover(source, tmp_path / 'cut.mcap')
    assert cut.damage_count > 0
    (about,) = check([cut.output])
    assert about.damage == ()
    assert about.messages == cut.messages_recovered


def test_a_message_that_is_packed_by_itself_and_damaged_is_lost_and_told(tmp_path, block):
    source = rosbag2(tmp_path / 'bag', block[:50], CompressionMode.MESSAGE)
    (file,) = source.glob('*.mcap')
    content = file.read_bytes()
    frame = b'\x28\xb5\x2f\xfd'
    at = content.index(frame, content.index(frame) + 4)
    file.write_bytes(content[:at] + bytes(4) + content[at + 4 :])
    result = recover(source, tmp_path / 'saved.mcap')
    assert result.messages_recovered + result.messages_crc_suspect == 49
    assert ('message', 'compression') in {(d.record, d.kind.value) for d in result.damage}


def test_a_split_bag_is_joined_and_each_damage_names_its_file(tmp_path, write_bag, block):
    folder = tmp_path / 'split'
    folder.mkdir()
    for part in range(3):
        write_bag(f'split/split_{part}.mcap', block[part * 100 :][:100], chunk_bytes=1000)
    cut = folder / 'split_1.mcap'
    cut.write_bytes(cut.read_bytes()[:-14_000])
    (folder / 'split_3.mcap').touch()
    listed(folder, [f'split_{number}.mcap' for number in range(5)])
    reports = check([folder])
    assert [report.sound for report in reports] == [True, False, True, False, False]
    result = recover(folder, tmp_path / 'saved.mcap')
    assert 200 < result.messages_recovered < 300
    named = {(d.file, d.record, d.kind.value, d.detail) for d in result.damage}
    assert ('split_1.mcap', 'footer', 'missing', '') in named
    assert ('split_3.mcap', 'file', 'truncated', 'it is empty') in named
    missing = 'split_4.mcap is listed in metadata.yaml and is not there'
    assert ('', 'file', 'missing', missing) in named
    (about,) = check([result.output])
    assert about.damage == ()
    (run,) = open_runs([result.output])
    # the same topic of three files is one channel
    assert len({topic.topic for topic in run.topics}) == len(run.topics)
    whole = concatenate([block[:100], block[200:300]])
    assert set(whole.receive_ns) <= set(run.inputs().block().receive_ns)


def test_several_bags_are_not_joined(tmp_path: Path, write_bag: WriteBag, block: Block) -> None:
    folder = tmp_path / 'bags'
    folder.mkdir()
    for name in 'ab':
        write_bag(f'bags/{name}.mcap', block[:9])
    with pytest.raises(BagError, match=r'holds 2 bags; recover each by itself: .*a\.mcap'):
        recover(folder, tmp_path / 'saved.mcap')


def test_nothing_is_overwritten_and_nothing_is_left_behind(tmp_path, sample_bag: bytes) -> None:
    source = tmp_path / 'source.mcap'
    source.write_bytes(sample_bag)
    for taken in ('saved.mcap', 'saved.quarantine.mcap'):
        (tmp_path / taken).write_text('mine')
        with pytest.raises(BagError, match='exists; choose another name'):
            recover(source, tmp_path / 'saved.mcap')
        assert (tmp_path / taken).read_text() == 'mine'
        (tmp_path / taken).unlink()
    source.write_bytes(MAGIC + bytes(1000))
    with pytest.raises(BagError, match='holds no record of MCAP'):
        recover(source, tmp_path / 'saved.mcap')
    assert [path.name for path in tmp_path.iterdir()] == ['source.mcap']
    source.write_bytes(sample_bag)
    with pytest.raises(BagError, match='give a name in a folder that is there'):
        recover(source, tmp_path / 'nowhere' / 'saved.mcap')


@pytest.mark.parametrize(
    ('options', 'expected'),
    [
        ({'index_types': IndexType.NONE}, {'chunk_index', 'attachment_index', 'metadata_index'}),
        ({'use_statistics': False}, {'statistics'}),
        (
            {
                'index_types': IndexType.NONE,
                'use_statistics': False,
                'repeat_channels': False,
                'repeat_schemas': False,
                'use_summary_offsets': False,
            },
            {'summary'},
        ),
    ],
)
def test_what_the_summary_leaves_out_is_named_and_recovered(tmp_path, options, expected):
    path = tmp_path / 'bag.mcap'
    with path.open('wb') as file:
        writer = Writer(file, **options)
        writer.start('ros2')
        writer.add_attachment(0, 0, 'a.txt', 'text/plain', b'text')
        writer.add_metadata('notes', {'weather': 'calm'})
        channel = writer.register_channel('/a', 'cdr', 0)
        for number in range(9):
            writer.add_message(channel, number, bytes(8), number)
        writer.finish()
    (report,) = check([path])
    assert {(d.record, d.kind.value) for d in report.damage} == {
        (record, 'missing') for record in expected
    }
    result = recover(path, tmp_path / 'saved.mcap')
    assert result.messages_recovered == 9
    assert result.damage == ()
    assert check([result.output])[0].sound


@pytest.fixture(scope='module', params=['zstd', 'lz4'])
def bomb(request: pytest.FixtureRequest) -> tuple[str, bytes]:
    """Pack 512 MiB of zeros, by a compression, into some MiB at most."""
    packer: Any
    if request.param == 'zstd':
        packer = zstandard.ZstdCompressor(level=1).compressobj()
        packed = []
    else:
        packer = lz4.frame.LZ4FrameCompressor()
        packed = [packer.begin()]
    packed += [packer.compress(bytes(MIB)) for _ in range(512)]
    return request.param, b''.join((*packed, packer.flush()))


HEADER = as_record(Opcode.HEADER, struct.pack('<I4sI', 4, b'ros2', 0))
END = as_record(Opcode.DATA_END, bytes(4)) + as_record(Opcode.FOOTER, bytes(20)) + MAGIC


def use_everything(folder: Path, contents: Sequence[bytes]) -> list[set[tuple[str, str]]]:
    """Check, recover, tell and read files; return what was found."""
    named = []
    for number, content in enumerate(contents):
        path = folder / f'{number}.mcap'
        path.write_bytes(MAGIC + HEADER + content + END)
        named.append({(d.record, d.kind.value) for d in check([path])[0].damage})
        recover(path, folder / f'{number}.saved.mcap')
        for run in open_runs([path]):
            list(run.inputs())
    return named


def used(folder: Path, *contents: bytes) -> tuple[list[set[tuple[str, str]]], int]:
    """Use files in a process of its own; return what was found, and the memory it took."""
    return in_a_process(lambda: use_everything(folder, contents))


def in_a_process(use: Callable[[], Any]) -> tuple[Any, int]:
    """Return a result, and by how many bytes the memory of a process of its own grew."""
    context = multiprocessing.get_context('fork')
    results = context.Queue()

    def run() -> None:
        before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        found = use()
        after_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        results.put((found, (after_kib - before_kib) << 10))

    process = context.Process(target=run)
    process.start()
    found: tuple[Any, int] = results.get(timeout=200)
    process.join(60)
    assert process.exitcode == 0
    return found


@pytest.mark.parametrize('stated', [1000, 1 << 29])
def test_a_bomb_is_named_and_takes_neither_memory_nor_time(tmp_path, bomb, stated):
    (named,), grown = used(tmp_path, as_chunk(*bomb, stated))
    kinds = {'too_large'} if stated > 1000 else {'compression', 'size'}
    assert named & {('chunk', kind) for kind in kinds}
    assert grown < 700 * MIB, 'a chunk is unpacked up to 256 MiB, in pieces that are then joined'


def test_lengths_of_2_to_the_60_are_named_and_take_no_memory(tmp_path: Path) -> None:
    opcodes = range(1, 16)
    (unpacked, *named), grown = used(
        tmp_path,
        as_chunk('zstd', b'', 1 << 60),
        *(as_record(opcode, bytes(100), 1 << 60) for opcode in opcodes),
    )
    assert ('chunk', 'too_large') in unpacked
    for opcode, found in zip(opcodes, named, strict=True):
        assert (Opcode(opcode).name.lower(), 'length') in found
    assert grown < 100 * MIB


def test_overlapping_records_are_not_read_again_and_again(tmp_path: Path) -> None:
    """Each claims to reach over thousands of others; ten times as many take ten times as long."""
    times = []
    for count in (2000, 20_000):
        head = bytes(24) + struct.pack('<Q', 50_000 - 36) + b'abc'
        path = tmp_path / f'{count}.mcap'
        path.write_bytes(MAGIC + as_record(Opcode.ATTACHMENT, head, 50_000) * count)
        begun = time.process_time()
        assert not check([path])[0].sound
        times.append(time.process_time() - begun)
    assert times[1] < 30 * times[0] + 1.0


@pytest.mark.parametrize('damaged', [False, True])
def test_a_large_bag_takes_no_more_memory_than_a_small_one(tmp_path: Path, damaged: bool) -> None:
    rng = random.Random(1)
    path = tmp_path / 'large.mcap'
    with BagWriter(path) as bag:
        for number in range(1500):
            payload = rng.randbytes(64_000)
            bag.put(EncodedMessage('/cloud', 'std_msgs/msg/String', payload, number, number))
    if damaged:
        with path.open('r+b') as file:
            file.seek(48 * MIB)
            file.write(bytes(100))
    (report,), of_check = in_a_process(lambda: check([path]))
    result, of_recover = in_a_process(lambda: recover(path, tmp_path / 'saved.mcap'))
    assert report.sound == (not damaged)
    assert result.messages_recovered > 1400
    assert path.stat().st_size > 90 * MIB
    # a window of the file is held, 16 MiB, and a chunk in several states
    assert max(of_check, of_recover) < 45 * MIB


def test_topics_that_have_other_numbers_in_each_file_are_joined(tmp_path: Path) -> None:
    folder = tmp_path / 'split'
    folder.mkdir()
    written = set()
    for part, topics in enumerate((('/a', '/b'), ('/b', '/c', '/a'))):
        with (folder / f'split_{part}.mcap').open('wb') as file:
            writer = Writer(file, chunk_size=200)
            writer.start('ros2')
            # one declared in the middle of a chunk, behind messages of another
            for number, topic in enumerate(topics):
                schema = writer.register_schema(f'x/msg/T{topic[1:]}', 'ros2msg', b'uint8 x')
                channel = writer.register_channel(topic, 'cdr', schema)
                for n in range(3 + 2 * number):
                    log_ns = part * 1000 + number * 100 + n
                    payload = f'{topic} {log_ns}'.encode()
                    writer.add_message(channel, log_ns, payload, log_ns + 1, n)
                    written.add((topic, f'x/msg/T{topic[1:]}', n, log_ns, log_ns + 1, payload))
            writer.finish()
    listed(folder, ['split_0.mcap', 'split_1.mcap'])
    result = recover(folder, tmp_path / 'saved.mcap')
    assert (result.damage, result.bytes_lost, result.quarantine) == ((), 0, None)
    assert check([result.output])[0].damage == ()
    with result.output.open('rb') as file:
        reader = make_reader(file)
        saved = {
            (channel.topic, schema.name, m.sequence, m.log_time, m.publish_time, m.data)
            for schema, channel, m in reader.iter_messages()
        }
        assert saved == written
        assert reader.get_summary().statistics.channel_count == 3


START_NS = 1_700_000_000 * 10**9


def test_sound_chunks_are_copied_as_they_are(tmp_path: Path) -> None:
    """A flipped bit in one chunk; the packed bytes of the others stand in the output."""
    block = Block.of(Channel.DEPTH, range(START_NS, START_NS + 4000), np.arange(4000) % 97)
    with BagWriter(tmp_path / 'a.mcap', chunk_bytes=1 << 14) as bag:
        bag.write_samples(block)
    data = bytearray((tmp_path / 'a.mcap').read_bytes())
    chunks = [each for each in walk(bytes(data), 8, len(data)) if each.opcode == Opcode.CHUNK]
    assert len(chunks) > 10
    data[chunks[3].end - 9] ^= 4
    (tmp_path / 'b.mcap').write_bytes(data)
    found = recover(tmp_path / 'b.mcap', tmp_path / 'c.mcap')
    saved = (tmp_path / 'c.mcap').read_bytes()
    kept = [bytes(data[each.start + 28 : each.end]) in saved for each in chunks]
    assert kept == [place != 3 for place in range(len(chunks))]
    assert check([tmp_path / 'c.mcap'])[0].sound
    assert found.messages_recovered + found.messages_crc_suspect <= 4000
    (run,) = open_runs([tmp_path / 'c.mcap'])
    assert len(run.inputs().block()) > 3000


def test_a_chunk_with_a_topic_that_cannot_be_read_is_not_copied(tmp_path: Path) -> None:
    """Its checksum is right; the channel has a key of metadata without its value."""
    names = b''.join(struct.pack('<I', len(text)) + text for text in (b'/a', b'cdr'))
    sound = as_record(Opcode.CHANNEL, struct.pack('<HH', 1, 0) + names + bytes(4))
    broken = as_record(Opcode.CHANNEL, struct.pack('<HH', 2, 0) + names + struct.pack('<II', 4, 0))
    message = as_record(Opcode.MESSAGE, struct.pack('<HIQQ', 1, 0, 1, 1) + bytes(20_000))
    records = broken + message
    chunk = as_chunk('', records, len(records), zlib.crc32(records))
    (tmp_path / 'a.mcap').write_bytes(MAGIC + HEADER + sound + chunk + END)
    found = recover(tmp_path / 'a.mcap', tmp_path / 'b.mcap')
    assert (found.messages_recovered, found.messages_crc_suspect) == (1, 0)
    assert [(each.record, each.kind.value) for each in found.damage] == [('channel', 'content')]
    assert check([tmp_path / 'b.mcap'])[0].sound


def test_chunks_of_two_files_whose_numbers_meet_keep_their_topics(tmp_path: Path) -> None:
    """Both files call their one topic number 1; in one bag they cannot."""
    folder = tmp_path / 'run'
    folder.mkdir()
    for place, channel in enumerate((Channel.DEPTH, Channel.SPEED_THROUGH_WATER)):
        with BagWriter(folder / f'run_{place}.mcap') as bag:
            stamps = range(START_NS + place * 10**6, START_NS + place * 10**6 + 2000)
            bag.write_samples(Block.of(channel, stamps, np.full(2000, 5.0 + place)))
    recover(folder, tmp_path / 'c.mcap')
    assert check([tmp_path / 'c.mcap'])[0].sound
    (run,) = open_runs([tmp_path / 'c.mcap'])
    block = run.inputs().block()
    for place, channel in enumerate((Channel.DEPTH, Channel.SPEED_THROUGH_WATER)):
        assert np.all(block.value[block.channel == channel, 0] == 5.0 + place)
        assert np.sum(block.channel == channel) == 2000


def test_a_chunk_without_the_end_of_its_frame_is_packed_again(tmp_path: Path) -> None:
    """All of it can be unpacked and its checksum is right, but other readers refuse it."""
    block = Block.of(Channel.DEPTH, range(START_NS, START_NS + 4000), np.arange(4000) % 97)
    with BagWriter(tmp_path / 'a.mcap', compression=Compression.LZ4, chunk_bytes=1 << 14) as bag:
        bag.write_samples(block)
    data = bytearray((tmp_path / 'a.mcap').read_bytes())
    chunk = next(each for each in walk(bytes(data), 8, len(data)) if each.opcode == Opcode.CHUNK)
    data[chunk.end - 4] ^= 1  # of the four bytes that end a frame
    (tmp_path / 'b.mcap').write_bytes(data)
    assert ('chunk', 'compression') in {
        (each.record, each.kind.value) for each in check([tmp_path / 'b.mcap'])[0].damage
    }
    assert recover(tmp_path / 'b.mcap', tmp_path / 'c.mcap').messages_recovered == 4000
    with (tmp_path / 'c.mcap').open('rb') as file:
        assert len(list(make_reader(file).iter_messages())) == 4000
