# SPDX-License-Identifier: Apache-2.0
"""Chunks unpacked ahead: the same as one after the other."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from mmap import ACCESS_READ, mmap
from pathlib import Path

import pytest

from shipdrag_ros.bags.ahead import unpacked
from shipdrag_ros.bags.contents import FileSegment
from shipdrag_ros.bags.mcap_file import McapFile
from shipdrag_ros.bags.records import DamagedRecord, stated_bytes

NAME = 'shipdrag-unpack'


@pytest.fixture
def opened(tmp_path: Path, sample_bag: bytes) -> Iterator[tuple[mmap, list[FileSegment]]]:
    """A file of several chunks, one of which is damaged, and what its index lists."""
    path = tmp_path / 'bag.mcap'
    path.write_bytes(sample_bag)
    segments = McapFile(path).contents.segments
    assert len(segments) > 8
    damaged = bytearray(sample_bag)
    damaged[segments[3].end - 20] ^= 0xFF
    path.write_bytes(damaged)
    with path.open('rb') as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
        yield data, segments


@pytest.fixture
def cores(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Say how many cores this process may use."""
    return lambda many: monkeypatch.setattr(
        os, 'sched_getaffinity', lambda process: set(range(many))
    )


def wrong(records: bytes | DamagedRecord) -> bytes | str:
    """Make damage comparable."""
    return str(records) if isinstance(records, DamagedRecord) else records


def test_what_is_unpacked_ahead_is_the_same_on_every_machine(
    opened: tuple[mmap, list[FileSegment]], cores: Callable[[int], None]
) -> None:
    data, segments = opened
    found = []
    for many in (1, 2, 8):
        cores(many)
        with closing(unpacked(data, segments)) as records:
            found.append(
                [str(each) if isinstance(each, DamagedRecord) else each for each in records]
            )
    assert found[0] == found[1] == found[2]
    assert len(found[0]) == len(segments)
    assert [number for number, each in enumerate(found[0]) if isinstance(each, str)] == [3]


def test_who_stops_early_leaves_no_thread(
    opened: tuple[mmap, list[FileSegment]], cores: Callable[[int], None]
) -> None:
    cores(2)
    with closing(unpacked(*opened)) as records:
        next(records)
        assert any(thread.name.startswith(NAME) for thread in threading.enumerate())
    assert not any(thread.name.startswith(NAME) for thread in threading.enumerate())


def test_damage_holds_no_bytes_of_its_chunk(
    opened: tuple[mmap, list[FileSegment]], cores: Callable[[int], None]
) -> None:
    """Or a file full of damaged chunks would be in the memory as a whole."""
    data, segments = opened
    for many in (1, 2):
        cores(many)
        with closing(unpacked(data, segments)) as records:
            (damage,) = (each for each in records if isinstance(each, DamagedRecord))
        assert damage.__traceback__ is None
        assert damage.__cause__ is None
        assert damage.__context__ is None


def test_a_chunk_takes_its_packed_bytes_at_least(
    opened: tuple[mmap, list[FileSegment]],
) -> None:
    """Whatever size it states: by that is bounded what is unpacked ahead."""
    data, segments = opened
    first = segments[0]
    chunk = bytearray(data[first.offset : first.end])
    for stated, expected in ((0, len(chunk)), (1 << 40, 1 << 40)):
        chunk[25:33] = stated.to_bytes(8, 'little')
        assert stated_bytes(bytes(chunk), 0, len(chunk)) == expected
