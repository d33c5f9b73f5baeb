# SPDX-License-Identifier: Apache-2.0
"""What is written is what other readers read."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from shipdrag_ros import __version__
from shipdrag_ros.bags import BagWriter, Compression, writer
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import OUTPUT_TOPICS, TOPICS, EncodedMessage, encode, types
from shipdrag_ros.samples import Block, Channel
from tests.recorded import rows, summary


@pytest.mark.parametrize('compression', Compression)
def test_the_reference_reader_decodes_it(write_bag, block, compression):
    path = write_bag('a.mcap', block, compression=compression, chunk_bytes=10_000)
    with path.open('rb') as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        assert summary is not None
        assert {chunk.compression for chunk in summary.chunk_indexes} == {compression.value}
        assert len(summary.chunk_indexes) > 5
        assert {schema.encoding for schema in summary.schemas.values()} == {'ros2msg'}
        assert {channel.message_encoding for channel in summary.channels.values()} == {'cdr'}
        decoded = list(reader.iter_decoded_messages())
    assert len(decoded) == len(block)
    for item, channel, stamp, received, value in zip(
        decoded, block.channel, block.stamp_ns, block.receive_ns, block.value, strict=True
    ):
        message = item.decoded_message
        assert item.channel.topic == f'/{Channel(channel).input}'
        assert item.message.log_time == received
        assert item.message.publish_time == stamp
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
        if channel == Channel.SPEED_THROUGH_WATER:
            assert message.twist.twist.linear.x == value[0]
            assert message.twist.covariance[0] == 0.01


def test_chunks_have_the_size_asked_for(write_bag: Callable[..., Path], block: Block) -> None:
    counts = []
    for size in (4096, 65536):
        path = write_bag(f'{size}.mcap', block, chunk_bytes=size)
        counts.append(len(summary(path).chunk_indexes))
    assert counts[0] > 8 * counts[1]


def test_attachments_and_version_come_first(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'a.mcap', recording_id='abc', part=3) as bag:
        bag.attach('ship.yaml', 'name: Ægir\n')
        bag.attach('note.txt', 'x')
        bag.register('/shaft', 'sensor_msgs/msg/JointState')
    with (tmp_path / 'a.mcap').open('rb') as file:
        reader = make_reader(file)
        attachments = {item.name: item for item in reader.iter_attachments()}
        (metadata,) = reader.iter_metadata()
        summary = reader.get_summary()
        assert summary is not None
    assert attachments['ship.yaml'].data.decode() == 'name: Ægir\n'
    assert attachments['ship.yaml'].media_type == 'application/yaml'
    assert attachments['note.txt'].media_type == 'text/plain'
    assert metadata.name == 'shipdrag_ros'
    assert metadata.metadata == {'version': __version__, 'recording_id': 'abc', 'part': '3'}
    assert [channel.topic for channel in summary.channels.values()] == ['/shaft']


def test_what_is_latched_is_and_every_channel_has_its_type_hash(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for topic in OUTPUT_TOPICS:
            bag.register(topic.under('/node'), topic.type)
    channels = summary(tmp_path / 'a.mcap').channels.values()
    metadata = {channel.topic: channel.metadata for channel in channels}
    latched = {
        topic
        for topic, each in metadata.items()
        if 'transient_local' in each['offered_qos_profiles']
    }
    kept = ('resistance_curve', 'forecast', 'forecast_path', 'diagnosis')
    assert latched == {f'/node/{name}' for name in kept}
    assert all(each['topic_type_hash'].startswith('RIHS01_') for each in metadata.values())


SHARE = Path(os.environ.get('AMENT_PREFIX_PATH', sys.prefix).partition(os.pathsep)[0]) / 'share'
WRITTEN = {kind for kinds in TOPICS.values() for kind in kinds}
WRITTEN |= {topic.type for topic in OUTPUT_TOPICS}


@pytest.mark.parametrize('type_name', sorted(WRITTEN))
def test_definitions_and_type_hashes_are_those_of_ros(type_name: str) -> None:
    package, _, name = type_name.split('/')
    about = SHARE / package / 'msg' / f'{name}.json'
    if not about.exists():
        pytest.skip('needs a ROS 2 that describes its types')
    hashes = {
        item['type_name']: item['hash_string']
        for item in json.loads(about.read_text())['type_hashes']
    }
    assert types.type_hash(type_name) == hashes[type_name]


def test_a_file_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / 'a.mcap'
    path.write_text('precious')
    with pytest.raises(BagError, match=r'a\.mcap.* exists'):
        BagWriter(path)
    assert path.read_text() == 'precious'


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(BagError, match='cannot be made'):
        BagWriter(tmp_path / 'nowhere' / 'a.mcap')


def test_a_type_that_nobody_knows_is_told(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag, pytest.raises(BagError, match='my_msgs/msg/Log'):
        bag.register('/log', 'my_msgs/msg/Log')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='no /dev/full here')
def test_a_full_disk_is_told(monkeypatch: pytest.MonkeyPatch, block: Block) -> None:
    monkeypatch.setattr(writer, 'private_opener', lambda *_: os.open('/dev/full', os.O_WRONLY))
    bag = BagWriter(Path('a.mcap'), chunk_bytes=1024)
    with pytest.raises(BagError, match=r'a\.mcap.* cannot be written: No space'):
        bag.write_samples(block)
    with pytest.raises(BagError, match='No space'):
        bag.close()
    bag.close()


def test_closing_twice_is_harmless_and_an_exception_keeps_what_is_written(tmp_path: Path) -> None:
    path = tmp_path / 'a.mcap'
    (message,) = encode(Block.of(Channel.SHAFT, [5], [1.0]))
    with pytest.raises(RuntimeError, match='stop'), BagWriter(path) as bag:  # noqa: PT012
        bag.put(
            EncodedMessage(message.topic, message.type, message.payload, 6, message.publish_ns)
        )
        raise RuntimeError('stop')
    bag.close()
    assert len(rows(path)) == 1


def test_a_stamp_before_1970_is_no_obstacle(tmp_path: Path) -> None:
    (message,) = encode(Block.of(Channel.SHAFT, [-5], [1.0]))
    with BagWriter(tmp_path / 'a.mcap') as bag:
        bag.put(message._replace(log_ns=6, publish_ns=-5))
    (row,) = rows(tmp_path / 'a.mcap')
    assert (row.publish_ns, row.payload) == (0, message.payload)
