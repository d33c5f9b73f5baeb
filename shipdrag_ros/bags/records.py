# SPDX-License-Identifier: Apache-2.0
"""
The records of an MCAP file, read with every length checked.

A file may be cut off or damaged anywhere: whatever does not fit is a
`DamagedRecord` and never another exception.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterator
from io import BytesIO
from mmap import MADV_DONTNEED, mmap
from typing import Any, NamedTuple

import lz4.frame
import zstandard
from isal.isal_zlib import crc32
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC = b'\x89MCAP0\r\n'
Buffer = bytes | mmap

# an opcode and a length, then the content
HEAD = struct.Struct('<BQ')
_RELEASE_BYTES = 1 << 24
FOOTER_BYTES = HEAD.size + 20 + len(MAGIC)
MESSAGE_HEAD = struct.Struct('<HIQQ')
"""Channel, sequence, log time [ns], publish time [ns]."""
TIME_LIMIT_NS = 1 << 63
"""No log time is as late."""
CHUNK_LIMIT_BYTES = 1 << 28
"""Unpacked; far above what any writer makes, far below what would take the memory away."""
_CHUNK_HEAD = struct.Struct('<QQQI')  # first and last log time, unpacked bytes, their checksum
_UINT32 = struct.Struct('<I')
_UINT64 = struct.Struct('<Q')
_PIECE_BYTES = 1 << 20

_RECORDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.MESSAGE_INDEX: MessageIndex,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT: Attachment,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA: Metadata,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.SUMMARY_OFFSET: SummaryOffset,
    Opcode.DATA_END: DataEnd,
}


UNPACKING_ERRORS = (zstandard.ZstdError, RuntimeError, MemoryError, ValueError, EOFError)
"""What the libraries raise on damaged bytes."""


class _OfThread(threading.local):
    """What takes longer to make than a chunk to unpack, and serves one thread."""

    def __init__(self) -> None:
        self.zstd = zstandard.ZstdDecompressor()


_of_thread = _OfThread()


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
    try:
        record = read_record(data, place.opcode, place.start, place.end)
    except (McapError, ValueError, struct.error, MemoryError, OverflowError) as error:
        raise DamagedRecord(f'the record at byte {place.offset} is damaged') from error
    if place.opcode == Opcode.ATTACHMENT and not attachment_agrees(data, place.start, place.end):
        raise DamagedRecord(f'the attachment {record.name!r} has a wrong checksum')
    return record


def read_record(data: Buffer, opcode: int, start: int, end: int) -> Any:
    """
    Return the record of `mcap.records` whose fields are known to fit.
    """
    return _RECORDS[opcode].read(ReadDataStream(BytesIO(data[start:end])))


def attachment_agrees(data: Buffer, start: int, end: int) -> bool:
    """
    Say whether an attachment has the checksum that it states, if any.
    """
    stated = int.from_bytes(data[end - _UINT32.size : end], 'little')
    return stated in (0, checksum(data, start, end - _UINT32.size))


def checksum(data: Buffer, start: int, end: int) -> int:
    """
    Return the CRC-32 of a span of any size.
    """
    value = 0
    for at in range(start, end, _PIECE_BYTES):
        piece_end = min(at + _PIECE_BYTES, end)
        value = crc32(data[at:piece_end], value)
        release(data, at, piece_end)
    return value


def unpack_chunk(data: Buffer, place: Place) -> tuple[str, bytes]:
    """
    Return compression and records of a chunk, their checksum tested.

    Raises
    ------
    DamagedRecord
        If the chunk is not as it was written.
    """
    try:
        size, stated, compression, at, length = chunk_fields(data, place.start, place.end)
        packed = data[at : min(at + length, place.end)]
        release(data, place.offset, place.end)
        records = decompress(compression, packed, size)
    except UNPACKING_ERRORS as error:
        raise DamagedRecord(f'the chunk at byte {place.offset} is damaged: {error}') from error
    if stated and crc32(records) != stated:
        raise DamagedRecord(f'the chunk at byte {place.offset} has a wrong checksum')
    return compression, records


def stated_bytes(data: Buffer, start: int, end: int) -> int:
    """
    Return how many bytes a record takes at most, packed or unpacked as it says itself.

    Parameters
    ----------
    data
        The file.
    start, end
        Where the record lies, or consecutive ones of which the first is no chunk.
    """
    if end - start < HEAD.size + _CHUNK_HEAD.size or data[start] != Opcode.CHUNK:
        return end - start
    return max(end - start, int(_CHUNK_HEAD.unpack_from(data, start + HEAD.size)[2]))


def chunk_fields(data: Buffer, start: int, end: int) -> tuple[int, int, str, int, int]:
    """
    Return unpacked size, checksum, compression, and where its bytes lie.

    Of the content of a chunk; start and length of the packed bytes are as
    stated, be they there or not.

    Raises
    ------
    ValueError
        If the head is damaged.
    """
    try:
        _, _, size, stated = _CHUNK_HEAD.unpack_from(data, start)
        at = start + _CHUNK_HEAD.size
        (length,) = _UINT32.unpack_from(data, at)
        at += _UINT32.size
        name_end = min(at + length, end)
        compression = data[at:name_end].decode()
        (packed,) = _UINT64.unpack_from(data, name_end)
    except struct.error as error:
        raise ValueError(str(error)) from None
    return size, stated, compression, name_end + _UINT64.size, packed


def decompress(compression: str, packed: bytes, size: int) -> bytes:
    """
    Unpack what has a stated size.

    Raises
    ------
    One of UNPACKING_ERRORS
        If it is damaged, or of another size.
    """
    if size > CHUNK_LIMIT_BYTES:
        raise ValueError(f'{size} bytes are too many')
    if compression == '':
        records = packed
    elif compression == 'zstd':
        records = unpack_zstd(packed, size)
    elif compression == 'lz4':
        # one byte more is asked for, as what is not asked for is dropped in silence
        records = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
    else:
        raise ValueError(f'unknown compression {compression!r}')
    if len(records) != size:
        raise ValueError('sizes disagree')
    return records


def release(data: Buffer, start: int, end: int) -> None:
    """
    Give back the memory of a mapped file now and then, after a span was read.

    The system would do so when it is short, but until then it counts as ours.
    """
    if isinstance(data, mmap) and start // _RELEASE_BYTES != end // _RELEASE_BYTES:
        data.madvise(MADV_DONTNEED)


def message_head(data: Buffer, place: Place) -> tuple[int, int]:
    """
    Return channel and log time [ns] of the message at a place.

    Raises
    ------
    DamagedRecord
        If it is too short or its time is none.
    """
    if place.end - place.start < MESSAGE_HEAD.size:
        raise DamagedRecord(f'the message at byte {place.offset} is too short')
    channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(data, place.start)
    if log_ns >= TIME_LIMIT_NS:
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
    return _of_thread.zstd.decompress(packed, max_output_size=limit_bytes)
