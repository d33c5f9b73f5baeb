# SPDX-License-Identifier: Apache-2.0
"""
One MCAP file: what is in it, and its messages in order of arrival.

Without a sound index the file is walked once from its beginning, and what is
whole in it is read; the damage is stated, not mended.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from mmap import ACCESS_READ, mmap
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

import numpy as np
import zstandard

from shipdrag_ros.bags.ahead import unpacked
from shipdrag_ros.bags.contents import Contents, FileSegment, read_index, scan
from shipdrag_ros.bags.message_index import CHANNELS, Messages, index_messages
from shipdrag_ros.bags.records import (
    CHUNK_LIMIT_BYTES,
    MAGIC,
    DamagedRecord,
)
from shipdrag_ros.errors import BagError
from shipdrag_ros.samples import UInt8

CONVERT = 'convert it with `rosbags-convert --src BAG --dst NEW --dst-storage mcap`'
IMPORT = 'make a bag of it with `shipdrag import SOURCE -o NEW.mcap`'
# smaller chunks are read together: what a chunk costs beside its bytes is then small
_WORTHWHILE_BYTES = 1 << 18
# messages held back because earlier ones may follow in the file
_WAITING_LIMIT_BYTES = 1 << 29
# of a packed file, by its size; logs of ships are packed to a tenth or so
_FILE_RATIO = 4096
_FOREIGN = {
    b'SQLite format 3\0': 'is a bag in sqlite3 storage',
    b'#ROSBAG V2.0': 'is a bag of ROS 1',
}


class McapFile:
    """
    An MCAP file.

    Parameters
    ----------
    path
        `.mcap`, or `.mcap.zstd` as rosbag2 compresses files.

    Attributes
    ----------
    contents
        What is in it; reading messages may add to its warnings.
    indexed
        Whether that was found by the index of the file.

    Raises
    ------
    BagError
        If it is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.indexed = True
        self._unpacked: IO[bytes] | None = None
        if path.suffix == '.zstd':
            self._unpacked = _unpack(path)
        with self._data() as data:
            self.contents = self._read_contents(data)
        self.contents.segments.sort()

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last log time [ns]; None without messages."""
        segments = self.contents.segments
        if not segments:
            return None
        return segments[0].start_ns, max(segment.end_ns for segment in segments)

    def messages(
        self, channels: Collection[int], *, start_ns: int = 0, end_ns: int = sys.maxsize
    ) -> Iterator[Messages]:
        """
        Yield messages in order of log time, then of place, a chunk at a time.

        Parameters
        ----------
        channels
            Numbers of those to read.
        start_ns, end_ns
            First and last log time to read [ns].
        """
        wanted = frozenset(channels)
        in_time = [
            s for s in self.contents.segments if s.end_ns >= start_ns and s.start_ns <= end_ns
        ]
        segments = deque(s for s in in_time if not s.channels or s.channels & wanted)
        table = np.zeros(CHANNELS, np.uint8)
        table[list(wanted)] = 1
        found = 0
        waiting: Messages | None = None
        with self._data() as data, closing(unpacked(data, tuple(segments))) as records:
            while segments:
                # as much again as waits, so that what overlaps is not sorted over and over
                loaded = self._load(records, segments, table, len(waiting.data) if waiting else 0)
                found += len(loaded)
                if (loaded.log_ns < start_ns).any() or (loaded.log_ns > end_ns).any():
                    loaded = loaded[(loaded.log_ns >= start_ns) & (loaded.log_ns <= end_ns)]
                if waiting is not None:
                    loaded = waiting.followed_by(loaded)
                    waiting = None
                loaded = loaded.in_arrival_order()
                ready = len(loaded)
                if segments:  # the next may begin before this one ends
                    ready = int(np.searchsorted(loaded.log_ns, segments[0].start_ns))
                if ready < len(loaded):
                    waiting = loaded[ready:].packed()
                    if len(waiting.data) > _WAITING_LIMIT_BYTES:
                        raise BagError(
                            f'{str(self.path)!r}: more than {_WAITING_LIMIT_BYTES} bytes of '
                            'messages are out of order; write it anew in order of arrival'
                        )
                if ready:
                    yield loaded[:ready]
        expected = sum(self.contents.counts[channel] for channel in wanted)
        if len(in_time) == len(self.contents.segments) and found != expected:
            self._warn(f'{found} messages are there where the index lists {expected}')

    def _load(
        self,
        records: Iterator[bytes | DamagedRecord],
        segments: deque[FileSegment],
        wanted: UInt8,
        least_bytes: int,
    ) -> Messages:
        """Take segments off the queue, one or as many small ones as are worth it."""
        least_bytes = max(least_bytes, _WORTHWHILE_BYTES)
        sound: list[bytes] = []
        offsets: list[int] = []
        size = 0
        while segments and size < least_bytes:
            segment, found = segments.popleft(), next(records)
            if isinstance(found, DamagedRecord):
                self._warn(f'{found}: left out')
                continue
            sound.append(found)
            offsets.append(segment.offset)
            size += len(found)
        indexed = index_messages(sound, offsets, wanted)
        for text in indexed.damage:
            self._warn(text)
        return indexed.messages

    def _read_contents(self, data: mmap) -> Contents:
        head = data[:16]
        if not head.startswith(MAGIC):
            for magic, what in _FOREIGN.items():
                if head.startswith(magic):
                    raise BagError(f'{str(self.path)!r} {what}; {IMPORT}')
            raise BagError(
                f'{str(self.path)!r} is no MCAP file, it begins with {head[:8]!r}; '
                'give a .mcap file or a rosbag2 directory'
            )
        warnings: list[str] = []
        try:
            contents = read_index(data)
        except DamagedRecord as damage:
            contents = None
            warnings = [f'{damage}: read from its beginning, without an index']
        if contents is None:
            self.indexed = False
            contents = scan(data)
            contents.warnings[:0] = warnings
        return contents

    def _warn(self, text: str) -> None:
        if text not in self.contents.warnings:  # a file may be read twice
            self.contents.warnings.append(text)

    @contextmanager
    def _data(self) -> Iterator[mmap]:
        try:
            with self.path.open('rb') as file:
                if self.path.stat().st_size == 0:
                    raise BagError(f'{str(self.path)!r} is empty; nothing was recorded')
                data = mmap((self._unpacked or file).fileno(), 0, access=ACCESS_READ)
        except OSError as error:
            raise BagError(f'{str(self.path)!r} cannot be read: {error.strerror}') from error
        with data:
            yield data


def _unpack(path: Path) -> IO[bytes]:
    unpacked = TemporaryFile(prefix='shipdrag_')  # noqa: SIM115 (kept while the bag is)
    try:
        with path.open('rb') as packed:
            limit = max(CHUNK_LIMIT_BYTES, path.stat().st_size * _FILE_RATIO)
            for piece in zstandard.ZstdDecompressor().read_to_iter(packed):
                unpacked.write(piece)
                if unpacked.tell() > limit:
                    raise BagError(f'{str(path)!r} unpacks to more than {limit} bytes')
    except OSError as error:
        raise BagError(f'{str(path)!r} cannot be unpacked: {error.strerror}') from error
    except zstandard.ZstdError as error:
        raise BagError(f'{str(path)!r} cannot be unpacked: {error}') from error
    unpacked.flush()
    if unpacked.tell() == 0:
        raise BagError(f'{str(path)!r} is empty; nothing was recorded')
    return unpacked
