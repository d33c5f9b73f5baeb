# SPDX-License-Identifier: Apache-2.0
"""
The records of an MCAP file, read with every length checked.

A file may be cut off or damaged anywhere: whatever does not fit is a
`DamagedRecord` and never another exception.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from mmap import mmap
from typing import Any, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Footer,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

MAGIC = b'\x89MCAP0\r\n'
Buffer = bytes | mmap

# an opcode and a length, then the content
HEAD = struct.Struct('<BQ')
FOOTER_BYTES = HEAD.size + 20 + len(MAGIC)
_MESSAGE_HEAD = struct.Struct('<HIQQ')
_CHUNK_HEAD = struct.Struct('<QQQI')
_UINT32 = struct.Struct('<I')
_UINT64 = struct.Struct('<Q')
_TIME_LIMIT_NS = 1 << 63
# far above what any writer makes, far below what would take the memory away
_CHUNK_LIMIT_BYTES = 1 << 28

_PARSERS: dict[int, Any] = {
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT: Attachment,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA: Metadata,
    Opcode.METADATA_INDEX: MetadataIndex,
}


class DamagedRecord(Exception):
    """Bytes that are not what they should be."""


class Place(NamedTuple):
    """Where a record lies: its kind, its offset, and the span of its content."""

    opcode: int
    offset: int
    start: int
    end: int


def walk(data: Buffer, start: int, end: int) -> Iterator[Place]:
    """
    Yield the records between two offsets.

    Raises
    ------
    DamagedRecord
        At the first that is cut off, or is none.
    """
    at = start
    while at < end:
        if at + HEAD.size > end:
            raise DamagedRecord(f'the record at byte {at} is cut off')
        opcode, length = HEAD.unpack_from(data, at)
        content = at + HEAD.size
        if opcode == 0:
            raise DamagedRecord(f'no record at byte {at}')
        if length > end - content:
            raise DamagedRecord(f'the record at byte {at} is cut off')
        yield Place(opcode, at, content, content + length)
        at = content + length


def parse(data: Buffer, place: Place) -> Any:
    """
    Return the record of `mcap.records` at a place.

    Raises
    ------
    DamagedRecord
        If its content does not fit, or its checksum does not.
    """
    content = data[place.start : place.end]
    try:
        record = _PARSERS[place.opcode].read(ReadDataStream(BytesIO(content)))
    except (McapError, ValueError, struct.error, MemoryError, OverflowError) as error:
        raise DamagedRecord(f'the record at byte {place.offset} is damaged') from error
    if place.opcode == Opcode.ATTACHMENT:
        (checksum,) = _UINT32.unpack(content[-4:])
        if checksum and checksum != zlib.crc32(content[:-4]):
            raise DamagedRecord(f'the attachment {record.name!r} has a wrong checksum')
    return record


def unpack_chunk(data: Buffer, place: Place) -> tuple[str, bytes]:
    """
    Return compression and records of a chunk, their checksum tested.

    Raises
    ------
    DamagedRecord
        If the chunk is not as it was written.
    """
    try:
        _, _, size, checksum = _CHUNK_HEAD.unpack_from(data, place.start)
        at = place.start + _CHUNK_HEAD.size
        (length,) = _UINT32.unpack_from(data, at)
        at += _UINT32.size
        name_end = min(at + length, place.end)
        compression = data[at:name_end].decode()
        (length,) = _UINT64.unpack_from(data, name_end)
        at = name_end + _UINT64.size
        records = _decompress(compression, data[at : min(at + length, place.end)], size)
    except (struct.error, ValueError, RuntimeError, MemoryError, zstandard.ZstdError) as error:
        raise DamagedRecord(f'the chunk at byte {place.offset} is damaged: {error}') from error
    if checksum and zlib.crc32(records) != checksum:
        raise DamagedRecord(f'the chunk at byte {place.offset} has a wrong checksum')
    return compression, records


def _decompress(compression: str, packed: bytes, size: int) -> bytes:
    if size > _CHUNK_LIMIT_BYTES:
        raise ValueError(f'{size} bytes are too many')
    if compression == '':
        records = packed
    elif compression == 'zstd':
        records = unpack_zstd(packed, size)
    elif compression == 'lz4':
        records = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size)
    else:
        raise ValueError(f'unknown compression {compression!r}')
    if len(records) != size:
        raise ValueError('sizes disagree')
    return records


def message_head(data: Buffer, place: Place) -> tuple[int, int]:
    """
    Return channel and log time [ns] of the message at a place.

    Raises
    ------
    DamagedRecord
        If it is too short or its time is none.
    """
    if place.end - place.start < _MESSAGE_HEAD.size:
        raise DamagedRecord(f'the message at byte {place.offset} is too short')
    channel, _, log_ns, _ = _MESSAGE_HEAD.unpack_from(data, place.start)
    if log_ns >= _TIME_LIMIT_NS:
        raise DamagedRecord(f'the message at byte {place.offset} has no possible log time')
    return channel, log_ns


def unpack_zstd(packed: bytes, limit_bytes: int) -> bytes:
    """
    Unpack one zstd frame of at most so many bytes.

    Raises
    ------
    zstandard.ZstdError, ValueError
        If it is damaged or unpacks to more.
    """
    # the library trusts the size that a frame states, and asks for that memory
    if zstandard.frame_content_size(packed) > limit_bytes:
        raise ValueError(f'it unpacks to more than {limit_bytes} bytes')
    return zstandard.ZstdDecompressor().decompress(packed, max_output_size=limit_bytes)
