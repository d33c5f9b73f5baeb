# SPDX-License-Identifier: Apache-2.0
"""Whatever the container, the samples come out in order of arrival."""

from __future__ import annotations

import os
import shutil
import tracemalloc
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import CompressionMode

from shipdrag_ros.bags import BagWriter, Compression, ResetMark, mcap_file, open_runs
from shipdrag_ros.bags import run as run_module
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import EncodedMessage, EventKind, EventNote, encode, event_message
from shipdrag_ros.samples import Block, Channel, concatenate
from tests.bags.conftest import assert_same, foreign, listed, rosbag2

WriteBag = Callable[..., Path]
START_NS = 1_700_000_000_000_000_000


@pytest.mark.parametrize('compression', Compression)
def test_what_was_written_is_read(write_bag, block, compression):
    path = write_bag('a.mcap', block, compression=compression, chunk_bytes=5000)
    (run,) = open_runs([path])
    assert_same(run.inputs().block(), block)
    assert run.name == str(path)
    assert run.paths == (path,)
    assert run.warnings == ()
    assert run.span_ns == (block.receive_ns[0], block.receive_ns[-1])
    counted = {topic.input: topic.messages for topic in run.topics}
    assert counted == Counter(Channel(code).input for code in block.channel)


@pytest.mark.parametrize(
    'options',
    [
        {'use_chunking': False},
        {'use_chunking': False, 'use_statistics': False},
        {'index_types': IndexType.NONE},
        {'index_types': IndexType.NONE, 'compression': CompressionType.LZ4, 'chunk_size': 3000},
        {'use_statistics': False, 'chunk_size': 3000},
        {'repeat_channels': False},
        {'repeat_schemas': False},
        {
            'repeat_channels': False,
            'repeat_schemas': False,
            'use_statistics': False,
            'use_summary_offsets': False,
            'index_types': IndexType.NONE,
        },
        {'enable_crcs': False, 'chunk_size': 3000},
    ],
    ids=lambda options: '-'.join(options),
)
def test_files_without_an_index_are_read_too(tmp_path, block, options):
    (run,) = open_runs([foreign(tmp_path / 'a.mcap', block, **options)])
    assert_same(run.inputs().block(), block)
    assert run.warnings == ()
    assert {topic.topic.rpartition('/')[0] for topic in run.topics} == {'/ship'}


@pytest.mark.parametrize('mode', CompressionMode)
def test_bags_of_rosbag2_by_another_tool(tmp_path, block: Block, mode: CompressionMode) -> None:
    path = rosbag2(tmp_path / 'bag', block, mode)
    (run,) = open_runs([path])
    assert_same(run.inputs().block(), block)
    assert run.warnings == ()
    (same,) = open_runs([path / 'metadata.yaml'])
    assert_same(same.inputs().block(), block)
    if mode is not CompressionMode.MESSAGE:  # which only metadata.yaml tells of
        (single,) = open_runs([next(path.glob('*.mcap*'))])
        assert_same(single.inputs().block(), block)


@pytest.mark.parametrize('chunked', [True, False])
def test_arrival_decides_the_order_and_then_the_place(tmp_path: Path, chunked: bool) -> None:
    # written out of order, with ties, over many chunks
    rng = np.random.default_rng(4)
    n = 3000
    received = rng.integers(0, 400, n) + np.arange(n) // 10
    block = Block.of(Channel.SHAFT, np.arange(n), rng.normal(size=n), receive_ns=received)
    path = foreign(tmp_path / 'a.mcap', block, chunk_size=2000, use_chunking=chunked)
    (run,) = open_runs([path])
    assert_same(run.inputs().block(), block[np.argsort(received, kind='stable')])


def test_a_batch_is_bounded_and_its_size_changes_nothing(write_bag, block, monkeypatch):
    (run,) = open_runs([write_bag('a.mcap', block, chunk_bytes=3000)])
    monkeypatch.setattr(run_module, 'BATCH', 7)
    blocks = [item for item in run.inputs() if isinstance(item, Block)]
    assert max(map(len, blocks)) == 7
    assert_same(concatenate(blocks), block)


def test_memory_does_not_grow_with_the_bag(write_bag: WriteBag, monkeypatch) -> None:
    monkeypatch.setattr(run_module, 'BATCH', 256)
    monkeypatch.setattr(mcap_file, '_WORTHWHILE_BYTES', 20_000)
    peaks = []
    for n in (8000, 40_000):
        block = Block.of(Channel.SHAFT, START_NS + np.arange(n) * 10**8, 1.0)
        (run,) = open_runs([write_bag(f'{n}.mcap', block, chunk_bytes=20_000)])
        tracemalloc.start()
        for _ in run.inputs():
            pass
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # the samples alone would be 5 times as many bytes
    assert peaks[1] < 1.2 * peaks[0]


def test_a_range_of_time(write_bag: WriteBag, block: Block) -> None:
    (run,) = open_runs([write_bag('a.mcap', block, chunk_bytes=3000)])
    start, end = block.receive_ns[[100, 300]].tolist()
    (part,) = run.inputs(start_ns=start, end_ns=end)
    assert isinstance(part, Block)
    assert_same(part, block[100:301])
    assert run.warnings == ()


def test_parts_of_one_recording_are_joined_in_their_order(write_bag, block):
    paths = [
        write_bag(f'{name}.mcap', block[start : start + 100], recording_id='r', part=part)
        for name, part, start in (('c', 0, 0), ('a', 2, 200), ('b', 1, 100))
    ]
    other = write_bag('other.mcap', block[:50])
    run, alone = open_runs([paths[1], other, paths[0], paths[2]])
    assert_same(run.inputs().block(), block[:300])
    assert [path.name for path in run.paths] == ['c.mcap', 'b.mcap', 'a.mcap']
    assert_same(alone.inputs().block(), block[:50])
    (short,) = open_runs([paths[1], paths[0]])
    assert short.warnings == ('part 1 of the recording is missing',)
    with pytest.raises(BagError, match='are the same part 0'):
        open_runs([paths[0], paths[0]])


def test_parts_follow_each_other_even_if_the_clock_went_back(write_bag, block):
    paths = [
        write_bag('0.mcap', block[100:200], recording_id='r', part=0),
        write_bag('1.mcap', block[:100], recording_id='r', part=1),
    ]
    (run,) = open_runs(paths)
    assert_same(run.inputs().block(), concatenate([block[100:200], block[:100]]))
    assert run.span_ns == (block.receive_ns[0], block.receive_ns[199])


def test_bags_given_together_are_runs_of_their_own(write_bag: WriteBag, block: Block) -> None:
    paths = [write_bag(f'{i}.mcap', block[: i + 1]) for i in range(3)]
    runs = open_runs(paths)
    assert [run.name for run in runs] == [str(path) for path in paths]
    # and so are those of a folder
    assert [run.paths for run in open_runs([paths[0].parent])] == [run.paths for run in runs]


def test_a_split_bag_of_rosbag2_with_and_without_its_metadata(tmp_path, block: Block) -> None:
    folder = tmp_path / 'split'
    folder.mkdir()
    for i in range(11):
        foreign(folder / f'split_{i}.mcap', block[i * 20 : i * 20 + 20])
    (run,) = open_runs([folder])
    assert_same(run.inputs().block(), block[:220])
    assert 'metadata.yaml is missing' in run.warnings[0]
    listed(folder, [f'split_{i}.mcap' for i in range(12)])
    (run,) = open_runs([folder])
    assert_same(run.inputs().block(), block[:220])
    assert run.warnings == ('split_11.mcap is listed in metadata.yaml and is not there',)


def test_a_split_bag_may_hold_files_of_another_tool(write_bag: WriteBag, block: Block) -> None:
    own = write_bag('a.mcap', block[:100])
    foreign(own.with_name('b.mcap'), block[:0])
    listed(own.parent, ['a.mcap', 'b.mcap'])
    (run,) = open_runs([own.parent])
    assert [path.name for path in run.paths] == ['a.mcap', 'b.mcap']
    assert_same(run.inputs().block(), block[:100])


def test_attachments_are_read_and_a_difference_between_parts_is_told(tmp_path: Path) -> None:
    for part, text in enumerate(['a: 1\n', 'a: 1\n', 'a: 2\n']):
        with BagWriter(tmp_path / f'{part}.mcap', recording_id='r', part=part) as bag:
            bag.attach('ship.yaml', text)
    (run,) = open_runs([tmp_path])
    assert run.attachments == {'ship.yaml': 'a: 1\n'}
    (warning,) = run.warnings
    assert warning.startswith('2.mcap: its ship.yaml differs')


def test_resets_are_read_at_their_place(tmp_path: Path, block: Block) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for i, message in enumerate(encode(block[:20])):
            if i in (5, 12):
                mark = event_message(
                    EventNote(EventKind.RESET_REQUEST, message.log_ns, f'reason {i}')
                )
                bag.put(EncodedMessage(mark.topic, mark.type, mark.payload, message.log_ns, 0))
            bag.put(message)
    (run,) = open_runs([tmp_path / 'a.mcap'])
    first, reset, second, again, third = run.inputs()
    assert isinstance(first, Block)
    assert isinstance(second, Block)
    assert isinstance(third, Block)
    assert_same(first, block[:5])
    assert_same(second, block[5:12])
    assert_same(third, block[12:20])
    assert reset == ResetMark(int(block.receive_ns[5]), 'reason 5')
    assert again == ResetMark(int(block.receive_ns[12]), 'reason 12')
    assert run.node == '/coastdown_node'
    assert [message.topic for message in run.outputs()] == ['/coastdown_node/events'] * 2


def test_outputs_of_two_nodes_are_told_and_not_mixed(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for node in ('/a', '/b'):
            mark = event_message(EventNote(EventKind.RESET_REQUEST, 5, 'x'), node=node)
            bag.put(EncodedMessage(mark.topic, mark.type, mark.payload, 5, 5))
    (run,) = open_runs([tmp_path / 'a.mcap'])
    assert run.node is None
    assert list(run.outputs()) == []
    assert 'outputs of 2 nodes, /a, /b' in run.warnings[0]


def test_types_and_encodings_that_are_not_accepted_are_refused(tmp_path: Path) -> None:
    with (tmp_path / 'a.mcap').open('wb') as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema('std_msgs/msg/Float32', 'ros2msg', b'float32 data')
        writer.add_message(writer.register_channel('/shaft', 'cdr', schema), 1, b'', 1)
        schema = writer.register_schema('sensor_msgs/Range', 'jsonschema', b'{}')
        writer.add_message(writer.register_channel('/depth', 'json', schema), 1, b'{}', 1)
        writer.add_message(writer.register_channel('/chatter', 'cdr', 0), 1, b'', 1)
        writer.finish()
    (run,) = open_runs([tmp_path / 'a.mcap'])
    assert [(t.topic, t.type, t.refused, t.input) for t in run.topics] == [
        ('/chatter', '', False, None),
        ('/depth', 'sensor_msgs/msg/Range (json)', True, None),
        ('/shaft', 'std_msgs/msg/Float32', True, None),
    ]
    assert list(run.inputs()) == []


@pytest.mark.parametrize(
    ('files', 'expected'),
    [
        ({}, r'holds no \.mcap file; give a bag'),
        (
            {'notes.txt': ''},
            r"it holds notes\.txt\. Logs are given by their own names: '.*/notes\.txt'",
        ),
        ({f'{n}.txt': '' for n in range(5)}, r'it holds 0\.txt, 1\.txt, 2\.txt and 2 more\. Logs'),
        ({'bag_0.db3': 'x'}, 'sqlite3 storage; make a bag of it with .shipdrag import'),
        ({'metadata.yaml': '{'}, 'is no metadata of rosbag2'),
        ({'metadata.yaml': 'a: 1'}, 'is no metadata of rosbag2'),
        ({'metadata.yaml': 'rosbag2_bagfile_information: 3'}, 'holds 3, expected'),
        (
            {'metadata.yaml': 'rosbag2_bagfile_information: {storage_identifier: sqlite3}'},
            "'sqlite3' storage; make a bag of it with .shipdrag import",
        ),
        (
            {
                'metadata.yaml': 'rosbag2_bagfile_information: '
                '{storage_identifier: mcap, relative_file_paths: [a.mcap]}'
            },
            'lists no file that is there',
        ),
        (
            {
                'metadata.yaml': 'rosbag2_bagfile_information: '
                '{storage_identifier: mcap, relative_file_paths: 5}'
            },
            'relative_file_paths is 5, expected a list',
        ),
        (
            {
                'metadata.yaml': 'rosbag2_bagfile_information: '
                '{storage_identifier: mcap, compression_format: xz}'
            },
            "compressed with 'xz'",
        ),
        ({'a.mcap.zstd': 'x'}, 'cannot be unpacked'),
    ],
)
def test_folders_that_are_no_bags(tmp_path: Path, files: dict[str, str], expected: str) -> None:
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    with pytest.raises(BagError, match=expected):
        open_runs([tmp_path])


def test_a_bag_that_may_not_be_read(tmp_path: Path, sample_bag: bytes) -> None:
    path = tmp_path / 'a.mcap'
    path.write_bytes(sample_bag)
    path.chmod(0)
    try:
        path.read_bytes()
    except PermissionError:
        with pytest.raises(BagError, match='cannot be read: Permission denied'):
            open_runs([path])
    else:
        pytest.skip('this user may read everything')


def test_a_bag_without_messages_is_a_run_without_samples(tmp_path: Path) -> None:
    BagWriter(tmp_path / 'a.mcap').close()
    (run,) = open_runs([tmp_path / 'a.mcap'])
    assert list(run.inputs()) == []
    assert run.span_ns is None
    shutil.rmtree(tmp_path)


def test_attachments_outputs_and_damage(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        bag.attach('ship.yaml', 'é')
        mark = event_message(EventNote(EventKind.RESET_REQUEST, 5, 'x'))
        bag.put(EncodedMessage(mark.topic, mark.type, mark.payload, 5, 5))
    content = (tmp_path / 'a.mcap').read_bytes()
    (tmp_path / 'a.mcap').write_bytes(content[:-20])
    (run,) = open_runs([tmp_path / 'a.mcap'])
    assert run.attachments == {'ship.yaml': 'é'}
    assert run.node == '/coastdown_node'
    assert not run.indexed
    assert run.topics[0].rate_hz is None
    assert len(run.warnings) == 1


def test_an_empty_bag_of_another_tool(tmp_path: Path) -> None:
    with (tmp_path / 'a.mcap').open('wb') as file:
        writer = Writer(file, index_types=IndexType.NONE)
        writer.start()
        writer.finish()
    (run,) = open_runs([tmp_path / 'a.mcap'])
    assert run.span_ns is None
    assert run.duration_s == 0.0
    assert run.software is None
    assert run.compression == 'none'


@pytest.mark.parametrize('name', ['a.mcap', 'a.mcap.zstd', 'a.gz'])
def test_a_named_pipe_is_refused_and_not_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(BagError, match='not seekable'):
        open_runs([tmp_path / name])
