# SPDX-License-Identifier: Apache-2.0
"""What is told of a bag is what is in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import IndexType, Writer

from shipdrag_ros import __version__
from shipdrag_ros.bags import BagWriter, Compression, open_runs
from shipdrag_ros.bags.reader import info
from shipdrag_ros.messages import reset_request
from shipdrag_ros.samples import Block, Channel


@pytest.mark.parametrize('compression', Compression)
def test_a_bag(write_bag: Callable[..., Path], compression: Compression) -> None:
    stamps = 10**18 + np.arange(101) * 10**8
    path = write_bag('a.mcap', Block.of(Channel.SHAFT, stamps, 1.0), compression=compression)
    (run,) = open_runs([path])
    told = info(run)
    assert told.size_bytes == path.stat().st_size
    assert (told.start_ns, told.end_ns) == (10**18, 10**18 + 10**10)
    assert told.duration_s == pytest.approx(10.0)
    assert told.messages == 101
    assert told.compression == compression.value
    assert told.indexed
    (topic,) = told.topics
    assert topic.rate_hz == pytest.approx(10.0)
    assert (topic.topic.topic, topic.topic.input) == ('/shaft', 'shaft')
    assert 'shaft' not in told.missing
    assert len(told.missing) == 7
    assert told.software == __version__
    assert told.node is None
    assert told.warnings == ()


def test_attachments_outputs_and_damage(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        bag.attach('ship.yaml', 'é')
        mark = reset_request(5, 'x')
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
