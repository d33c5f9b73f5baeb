# SPDX-License-Identifier: Apache-2.0
"""
Chunks unpacked ahead of whoever reads them, on another core where there is one.

Decompression and checksum leave Python's lock to others, so that a chunk can be
decoded while the next ones are unpacked. What comes out is the same.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from mmap import mmap

from mcap.opcode import Opcode

from shipdrag_ros.bags.contents import FileSegment
from shipdrag_ros.bags.records import DamagedRecord, release, stated_bytes, unpack_chunk, walk

UnpackedSegments = Generator[bytes | DamagedRecord, None, None]
_WORTHWHILE = 8  # segments, below which a thread costs more than it saves
_THREADS = 3
_AHEAD_BYTES = 1 << 22  # unpacked, so that it is still in the cache of the processor


def unpacked(data: mmap, segments: Sequence[FileSegment]) -> UnpackedSegments:
    """
    Yield the records of each segment, in their order, or what is wrong with it.

    Parameters
    ----------
    data
        The file.
    segments
        From its contents.
    """
    threads = min(len(os.sched_getaffinity(0)) - 1, _THREADS)
    if threads < 1 or len(segments) < _WORTHWHILE:
        yield from (_try(data, segment) for segment in segments)
        return
    with ThreadPoolExecutor(threads, 'shipdrag-unpack') as pool:
        ahead: deque[tuple[int, Future[bytes | DamagedRecord]]] = deque()
        size = 0
        for segment in segments:
            more = stated_bytes(data, segment.offset, segment.end)
            while ahead and size + more > _AHEAD_BYTES:
                done, future = ahead.popleft()
                size -= done
                yield future.result()
            ahead.append((more, pool.submit(_try, data, segment)))
            size += more
        while ahead:
            yield ahead.popleft()[1].result()


def _try(data: mmap, segment: FileSegment) -> bytes | DamagedRecord:
    try:
        first = next(walk(data, segment.offset, segment.end))
        if first.opcode == Opcode.CHUNK:
            return unpack_chunk(data, first)[1]
    except DamagedRecord as damage:
        return DamagedRecord(str(damage))  # as it was caught, it holds the bytes of the chunk
    records = data[segment.offset : segment.end]
    release(data, segment.offset, segment.end)
    return records
