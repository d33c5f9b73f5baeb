# SPDX-License-Identifier: Apache-2.0
"""
The records of an MCAP file that may be cut off or damaged anywhere, and what is wrong.

A walk never ends at a damage: what does not fit is a place with a `DamageKind`, and
the walk goes on at the next record. A scan is a walk over a file that opens its chunks and
reads its records: what reads a bag without an index, checks it or saves it begins there.
Nothing is unpacked beyond a limit.
"""

from __future__ import annotations

import re
import struct
import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from io import BytesIO
from mmap import MADV_DONTNEED, mmap
from typing import Any, NamedTuple

import lz4.frame
import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk, Footer
from mcap.stream_reader import StreamReader

from shipdrag_ros.bags.message_index import EVERY_CHANNEL, Indexed, index_messages
from shipdrag_ros.samples import Int64

_LISTED = 10_000  # of a file that is damaged everywhere; the others are counted


class DamageKind(Enum):
    """Kinds of damage."""

    MISSING = 'missing'
    TRUNCATED = 'truncated'
    GARBAGE = 'garbage'
    """Bytes that are no record."""
    OPCODE = 'opcode'
    LENGTH = 'length'
    """A length that leads out of bounds, or not to the next record."""
    CONTENT = 'content'
    """Fields that do not fill their record."""
    CHECKSUM = 'checksum'
    COMPRESSION = 'compression'
    """Packed bytes that cannot be unpacked to their end."""
    SIZE = 'size'
    """Unpacked bytes that are more or fewer than stated."""
    TOO_LARGE = 'too_large'
    """More bytes than are unpacked."""
    REFERENCE = 'reference'
    """A channel or schema that is not there."""
    DUPLICATE = 'duplicate'
    MISPLACED = 'misplaced'
    """An index entry that points at something else."""
    DISAGREES = 'disagrees'
    """A statement that the data contradict."""


@dataclass(frozen=True)
class Damage:
    """
    One damage.

    Attributes
    ----------
    offset
        Place in the file [bytes]; of the chunk for what lies in one.
    record
        Kind of record, `chunk` for instance; also `magic`, `summary`, `file`, `unknown`.
    kind
        What is wrong with it.
    detail
        The values, or ''.
    file
        Name of the file where a source has several, or ''.
    """

    offset: int
    record: str
    kind: DamageKind
    detail: str = ''
    file: str = ''


@dataclass
class DamageList:
    """
    The damages of a file or several, of which the first are kept.

    Attributes
    ----------
    listed
        In order of discovery.
    count
        All of them.
    file
        Name of the file at hand, where there are several.
    """

    listed: list[Damage] = field(default_factory=list)
    count: int = 0
    file: str = ''

    def add(self, offset: int, record: str, kind: DamageKind, detail: str = '') -> None:
        """Take note of a damage."""
        self.count += 1
        if len(self.listed) < _LISTED:
            self.listed.append(Damage(offset, record, kind, detail, self.file))


MAGIC = b'\x89MCAP0\r\n'
Buffer = bytes | mmap

HEAD = struct.Struct('<BQ')
"""Opcode and length; the content follows."""
MESSAGE_HEAD = struct.Struct('<HIQQ')
"""Channel, sequence, log time [ns], publish time [ns]."""
TIME_LIMIT_NS = 1 << 63
"""No log time is as late."""
CHUNK_LIMIT_BYTES = 1 << 28
"""Unpacked; far above what any writer makes, far below what would take the memory away."""
GARBAGE = 0
"""Stands for an opcode where nothing is a record."""
IN_CHUNK = frozenset((Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE))
"""Kinds of records that stand in a chunk."""

# fields of each kind: numbers of bytes, and texts led by their length in 4 or 8 bytes
_SHORT, _LONG = -4, -8
_TO_END = (MESSAGE_HEAD.size,)  # then a payload, to the end of the record
_FIELDS: dict[int, tuple[int, ...]] = {
    Opcode.HEADER: (_SHORT, _SHORT),
    Opcode.FOOTER: (20,),
    Opcode.SCHEMA: (2, _SHORT, _SHORT, _SHORT),
    Opcode.CHANNEL: (4, _SHORT, _SHORT, _SHORT),
    Opcode.MESSAGE: _TO_END,
    Opcode.CHUNK: (28, _SHORT, _LONG),
    Opcode.MESSAGE_INDEX: (2, _SHORT),
    Opcode.CHUNK_INDEX: (32, _SHORT, 8, _SHORT, 16),
    Opcode.ATTACHMENT: (16, _SHORT, _SHORT, _LONG, 4),
    Opcode.ATTACHMENT_INDEX: (40, _SHORT, _SHORT),
    Opcode.STATISTICS: (42, _SHORT),
    Opcode.METADATA: (_SHORT, _SHORT),
    Opcode.METADATA_INDEX: (16, _SHORT),
    Opcode.SUMMARY_OFFSET: (17,),
    Opcode.DATA_END: (4,),
}
KINDS = frozenset(_FIELDS)
_PRIVATE = 0x80
_POSSIBLE_BYTES = 1 << 32
# a head: a known opcode, and a length below 2^32, as all but giants have
_SOUGHT = re.compile(rb'[\x01-\x0f](?=.{4}\0{4})', re.DOTALL)
_CHUNK_HEAD = struct.Struct('<QQQI')  # first and last log time, unpacked bytes, their checksum
_COMPRESSIONS = (b'\0\0\0\0', b'\4\0\0\0zstd', b'\3\0\0\0lz4')
_CRC_BYTES = 1 << 20
_RELEASE_BYTES = 1 << 24
_PIECE_BYTES = 256  # of a damaged chunk; so that little is lost at the damage
_UNPACKING_ERRORS = (zstandard.ZstdError, RuntimeError, MemoryError, ValueError, EOFError)
READ_ERRORS = (McapError, ValueError, struct.error, OverflowError, MemoryError)
"""What `mcap` raises on damaged records."""


class Place(NamedTuple):
    """
    Where a record lies: its kind, its offset, and the span of its content.

    With `damage` it is not as it should be; where it begins or ends, or of what kind it is,
    was then inferred. A content that cannot be found begins at the offset.
    """

    opcode: int
    offset: int
    start: int
    end: int
    damage: DamageKind | None = None

    @property
    def readable(self) -> bool:
        """Whether its content may be whole."""
        inferred = (None, DamageKind.OPCODE, DamageKind.LENGTH)
        return self.start > self.offset and self.damage in inferred and self.opcode in KINDS

    @property
    def span(self) -> tuple[int, int]:
        """Where the record begins, and how long it is [bytes]."""
        return self.offset, self.end - self.offset

    @property
    def name(self) -> str:
        """Kind of the record, as in the specification."""
        return Opcode(self.opcode).name.lower() if self.opcode in KINDS else 'unknown'


def walk(data: Buffer, start: int, end: int, kinds: frozenset[int] = KINDS) -> Iterator[Place]:
    """
    Yield what lies between two offsets, without a gap.

    Parameters
    ----------
    data
        A file, or an unpacked chunk.
    start, end
        Span to walk over [bytes].
    kinds
        Opcodes that may stand there.
    """
    at = start
    while at < end:
        place = _whole(data, at, end, kinds)
        if place is None or not _goes_on(data, place.end, end, kinds):
            place = _inferred(data, at, end, kinds, as_it_says=place)
        yield place
        at = place.end
        release(data, place.offset, at)


def place_at(data: Buffer, offset: int) -> Place:
    """Return the place of a record that is whole."""
    opcode, length = HEAD.unpack_from(data, offset)
    start = offset + HEAD.size
    return Place(opcode, offset, start, start + length)


def read(data: Buffer, place: Place) -> Any:
    """Return the record of `mcap.records` at a place; None where it does not fit."""
    record = BytesIO(
        HEAD.pack(place.opcode, place.end - place.start) + data[place.start : place.end]
    )
    try:
        return next(StreamReader(record, skip_magic=True, emit_chunks=True).records)
    except (*READ_ERRORS, StopIteration):
        return None


def footer_of(data: Buffer) -> Footer | None:
    """Return the footer of a file that was closed; None without a whole one."""
    end = len(data) - len(MAGIC)
    offset = end - HEAD.size - 20
    if offset < len(MAGIC) or data[end:] != MAGIC:
        return None
    footer = read(data, Place(data[offset], offset, offset + HEAD.size, end))
    return footer if isinstance(footer, Footer) else None


def agrees(data: Buffer, start: int, end: int, stated: int) -> bool:
    """Say whether a span of any size has the CRC-32 that is stated, if any."""
    value = 0
    for at in range(start, end if stated else start, _CRC_BYTES):
        value = crc32(data[at : min(at + _CRC_BYTES, end)], value)
        release(data, at, min(at + _CRC_BYTES, end))
    return value == stated


def summary_agrees(data: Buffer, footer: Footer) -> bool:
    """Say whether the summary of a closed file has the checksum that it states, if any."""
    # which covers the footer too, up to itself
    return agrees(data, footer.summary_start, len(data) - len(MAGIC) - 4, footer.summary_crc)


def attachment_agrees(data: Buffer, place: Place) -> bool:
    """Say whether an attachment has the checksum that it states, if any."""
    end = place.end - 4
    return agrees(data, place.start, end, int.from_bytes(data[end : place.end], 'little'))


def release(data: Buffer, start: int, end: int) -> None:
    """
    Give back the memory of a mapped file now and then, after a span was read.

    The system would do so when it is short, but until then it counts as ours.
    """
    if isinstance(data, mmap) and start // _RELEASE_BYTES != end // _RELEASE_BYTES:
        data.madvise(MADV_DONTNEED)


def _whole(data: Buffer, at: int, end: int, kinds: frozenset[int]) -> Place | None:
    """Return the record at an offset, if one begins there and its fields fill it."""
    if end - at < HEAD.size:
        return None
    opcode, length = HEAD.unpack_from(data, at)
    start = at + HEAD.size
    stop = start + length
    if stop > end:
        return None
    if opcode in kinds:
        sound = _fields_end(data, opcode, start, stop) == stop
    else:  # of a private one nothing is known but what follows
        follows = stop < end and data[stop] in kinds and _whole(data, stop, end, kinds) is not None
        sound = opcode >= _PRIVATE and (follows or data[stop:end] in (b'', MAGIC))
    return Place(opcode, at, start, stop) if sound else None


def _fields_end(data: Buffer, opcode: int, start: int, limit: int) -> int | None:
    """Return where the fields of a record end by themselves; None if that cannot be read."""
    at, fields = start, _FIELDS[opcode]
    if fields is _TO_END:
        return max(start + MESSAGE_HEAD.size, limit)
    for size in fields:
        if size > 0:
            at += size
        elif at - size > limit:
            return None
        else:
            at += int.from_bytes(data[at : at - size], 'little') - size
    return at


def _goes_on(data: Buffer, at: int, end: int, kinds: frozenset[int]) -> bool:
    """Say whether a record follows, perhaps cut off or with a damaged content, or the end."""
    closed = data[max(at, end - len(MAGIC)) : end] == MAGIC
    if end - at < HEAD.size:
        return at == end or closed or data[at] in kinds
    if _whole(data, at, end, kinds) is not None:
        return True
    opcode, length = HEAD.unpack_from(data, at)
    stop = at + HEAD.size + length
    if stop > end:
        return not closed and opcode in kinds and length < _POSSIBLE_BYTES
    return opcode != GARBAGE and _whole(data, stop, end, kinds) is not None


def _inferred(
    data: Buffer, at: int, end: int, kinds: frozenset[int], *, as_it_says: Place | None
) -> Place:
    """Say what lies where no record does, or one behind which none follows: it may be damaged."""
    if end - at < HEAD.size:
        ending = data[at:end] == MAGIC
        return Place(GARBAGE, at, at, end, None if ending else DamageKind.TRUNCATED)
    opcode, length = HEAD.unpack_from(data, at)
    start = at + HEAD.size
    stop = start + length
    known = opcode in kinds
    if as_it_says is None:
        if known and opcode != Opcode.MESSAGE:
            filled = _fields_end(data, opcode, start, end)
            if filled is not None and filled <= end and _goes_on(data, filled, end, kinds):
                return Place(opcode, at, start, filled, DamageKind.LENGTH)
        if stop <= end and _goes_on(data, stop, end, kinds):
            # its length is right, and something else is not
            near = (opcode ^ 1 << bit for bit in range(8))
            mended = [
                it for it in near if it in kinds and _fields_end(data, it, start, stop) == stop
            ]
            if known and Opcode.MESSAGE in mended:  # which anything fills
                mended.remove(Opcode.MESSAGE)
            kind = DamageKind.OPCODE if mended or not known else DamageKind.CONTENT
            return Place([*mended, opcode if known else GARBAGE][0], at, start, stop, kind)
    chunk = opcode == Opcode.CHUNK in kinds and _is_chunk(data, start)
    after = _next(data, at + 1, end, kinds - IN_CHUNK if chunk else kinds)
    if as_it_says is not None and after >= stop:
        # the fields of others end where the record does; a message may be longer by a flipped bit
        flipped = length ^ (after - start)
        longer = opcode == Opcode.MESSAGE and flipped.bit_count() == 1
        return as_it_says._replace(damage=DamageKind.LENGTH) if longer else as_it_says
    if not known and as_it_says is None:
        return Place(GARBAGE, at, at, after, DamageKind.GARBAGE)
    cut_off = after == end < stop < start + _POSSIBLE_BYTES
    kind = DamageKind.TRUNCATED if cut_off else DamageKind.LENGTH
    # part of a chunk may be unpacked
    return Place(opcode, at, start if chunk and start < after else at, after, kind)


def _next(data: Buffer, begin: int, end: int, kinds: frozenset[int]) -> int:
    """Return the first place where something is a record without doubt, or the end."""
    for match in _SOUGHT.finditer(data, begin, end):
        at = match.start()
        place = _whole(data, at, end, kinds)
        if place is None:
            # a chunk that is cut off still has its two lengths
            start = at + HEAD.size
            if data[at] == Opcode.CHUNK in kinds and start < end and _is_chunk(data, start):
                stop = start + HEAD.unpack_from(data, at)[1]
                if _fields_end(data, Opcode.CHUNK, start, end) == stop:
                    return at
        elif place.opcode == Opcode.CHUNK:
            if _is_chunk(data, place.start):
                return at
        elif _goes_on(data, place.end, end, kinds):
            return at
    ending = end - len(MAGIC)
    return ending if begin <= ending and data[ending:end] == MAGIC else end


def _is_chunk(data: Buffer, start: int) -> bool:
    """Say whether a compression that is known is named where that of a chunk stands."""
    name = start + _CHUNK_HEAD.size
    return data[name : name + 8].startswith(_COMPRESSIONS)


class FoundRecord(NamedTuple):
    """
    What lies at a place of a file.

    Attributes
    ----------
    place
        Where.
    item
        A chunk or a record of `mcap.records`; None of a message and its index, which are
        not read here, and of what cannot be read.
    sound
        Whether it is beyond doubt: neither it nor its bounds are damaged, or its checksum
        vouches for it.
    """

    place: Place
    item: Any
    sound: bool


@dataclass
class OpenChunk:
    """
    A chunk and what came out of it.

    Attributes
    ----------
    place
        Of the chunk in the file.
    chunk
        As it stands there, packed; None where it cannot be read.
    records
        Unpacked, as far as it goes.
    damage
        What is wrong with it.
    verified
        Whether its own checksum vouches for the records.
    ended
        Whether the packed bytes end as they should; else other readers refuse it.
    indexed
        What a scan found in the records, up to the first damage in them.
    """

    place: Place
    chunk: Chunk | None = None
    records: bytes = b''
    damage: DamageKind | None = None
    verified: bool = False
    ended: bool = True
    indexed: Indexed = field(init=False)

    @property
    def times_ns(self) -> tuple[int, int] | None:
        """First and last log time [ns]; None without messages."""
        times_ns = self.indexed.messages.log_ns
        return (int(times_ns.min()), int(times_ns.max())) if len(times_ns) else None

    def entries(self) -> dict[int, Int64]:
        """Return what an index lists: log time [ns] and offset, (n, 2), by channel."""
        messages, channel = self.indexed.messages, self.indexed.messages.channel
        offsets = messages.start - (HEAD.size + MESSAGE_HEAD.size)
        listed = np.column_stack((messages.log_ns, offsets))
        return {number: listed[channel == number] for number in np.unique(channel).tolist()}

    @property
    def whole(self) -> bool:
        """Whether the records are what may stand in a chunk, up to their end."""
        others = self.indexed.others.tolist()
        return not self.indexed.damage and all(self.records[at] in IN_CHUNK for at in others)

    def scan(self, damages: DamageList, *, sound: bool) -> Iterator[FoundRecord]:
        """
        Yield what lies in the records; where they are whole, all but the messages.

        Parameters
        ----------
        damages
            Where is noted what is damaged.
        sound
            Whether the chunk is; else what is damaged in it is the doing of its own damage.
        """
        data, offset = self.records, self.place.offset
        others = (place_at(data, at) for at in self.indexed.others.tolist())
        for place in others if sound and self.whole else walk(data, 0, len(data), IN_CHUNK):
            if place.damage is not None and sound:
                where = f'at byte {place.offset} of the unpacked chunk'
                damages.add(offset, place.name, place.damage, where)
            item = None
            if place.readable and place.opcode != Opcode.MESSAGE:
                item, _ = read_noting(data, place, offset, damages)
            yield FoundRecord(place, item, sound and place.damage is None)


def scan(data: Buffer, damages: DamageList, *, partly: bool = False) -> Iterator[FoundRecord]:
    """
    Yield what lies in a file, without a gap.

    Parameters
    ----------
    data
        The file.
    damages
        Where is noted what is damaged.
    partly
        Whether damaged chunks are unpacked as far as can be.
    """
    begin = len(MAGIC) if data[: len(MAGIC)] == MAGIC else 0
    if not begin:
        damages.add(0, 'magic', DamageKind.MISSING, f'{data[:8]!r}')
    chunked = False
    for place in walk(data, begin, len(data)):
        offset, sound, item = place.offset, place.damage is None, None
        if place.damage is not None:
            damages.add(offset, place.name, place.damage)
        if place.opcode == Opcode.CHUNK and place.start > offset:
            item, chunked = unpack(data, place, partly=partly), True
            item.indexed = index_messages([item.records], [offset], EVERY_CHANNEL)
            # of a chunk that cannot be read it matters only to those who unpack what is left of it
            if item.damage not in (None, place.damage) and (partly or place.readable):
                damages.add(offset, place.name, item.damage)
            sound = item.verified or (sound and item.damage is None)
        elif place.opcode == Opcode.MESSAGE:
            sound = sound and not chunked  # between chunks it may be part of a damaged one
        elif place.readable and place.opcode != Opcode.MESSAGE_INDEX:
            item, agrees = read_noting(data, place, offset, damages)
            sound = sound and agrees
        yield FoundRecord(place, item, sound)


def read_noting(data: Buffer, place: Place, offset: int, damages: DamageList) -> tuple[Any, bool]:
    """
    Read a record and note what is wrong with it; return it and whether nothing is.

    Parameters
    ----------
    data, place
        Where it lies, in a file or a chunk.
    offset
        What is noted as its place in the file [bytes].
    damages
        Where it is noted.
    """
    record = read(data, place)
    if record is None:
        damages.add(offset, place.name, DamageKind.CONTENT)
    elif isinstance(record, Attachment) and not attachment_agrees(data, place):
        damages.add(offset, place.name, DamageKind.CHECKSUM, repr(record.name))
        return record, False
    return record, record is not None


_of_thread = threading.local()  # a decoder takes longer to make than a chunk to unpack


def unpack(data: Buffer, place: Place, *, partly: bool = False) -> OpenChunk:
    """
    Unpack a chunk that is whole; of another one nothing that can be relied on.

    Parameters
    ----------
    data, place
    partly
        As much of it as can be, up to `CHUNK_LIMIT_BYTES`.
    """
    if place.start + _CHUNK_HEAD.size + 12 > place.end or not _is_chunk(data, place.start):
        return OpenChunk(place, damage=DamageKind.CONTENT)
    chunk, cut_off = _chunk_at(data, place.start, place.end)
    release(data, place.offset, place.end)
    found = OpenChunk(place, chunk)
    if chunk.uncompressed_size > CHUNK_LIMIT_BYTES:
        found.damage = DamageKind.TOO_LARGE
    else:
        try:
            found.records, found.ended = _decompress(chunk)
            if len(found.records) != chunk.uncompressed_size:
                found.damage = DamageKind.SIZE
        except _UNPACKING_ERRORS:
            found.damage = DamageKind.COMPRESSION
    if partly and found.damage is not None:
        found.records = _decompress_partly(chunk)
    if len(found.records) > CHUNK_LIMIT_BYTES:
        return OpenChunk(place, chunk, damage=DamageKind.TOO_LARGE)
    stated = chunk.uncompressed_crc
    found.verified = stated != 0 and crc32(found.records) == stated
    if cut_off and found.damage in (None, DamageKind.COMPRESSION):
        found.damage = DamageKind.TRUNCATED
    if stated and not found.verified:
        found.damage = found.damage or DamageKind.CHECKSUM
    return found


def _chunk_at(data: Buffer, start: int, end: int) -> tuple[Chunk, bool]:
    """Return a chunk as far as it is there, and whether it is cut off; faster than `read`."""
    first_ns, last_ns, size, stated = _CHUNK_HEAD.unpack_from(data, start)
    at = start + _CHUNK_HEAD.size
    name_end = at + 4 + int.from_bytes(data[at : at + 4], 'little')
    begin = name_end + 8
    stop = begin + int.from_bytes(data[name_end:begin], 'little')
    compression, packed = data[at + 4 : name_end].decode(), data[begin : min(stop, end)]
    return Chunk(compression, packed, last_ns, first_ns, stated, size), stop > end


def unpack_zstd(packed: bytes, limit_bytes: int) -> bytes:
    """
    Unpack one zstd frame of at most so many bytes.

    Raises
    ------
    zstandard.ZstdError, ValueError
        If it is damaged or unpacks to more.
    """
    # the library trusts the size that a frame states, and takes that memory
    if zstandard.frame_content_size(packed) > limit_bytes:
        raise ValueError(f'it unpacks to more than {limit_bytes} bytes')
    if not hasattr(_of_thread, 'zstd'):
        _of_thread.zstd = zstandard.ZstdDecompressor()
    return bytes(_of_thread.zstd.decompress(packed, max_output_size=limit_bytes))


def _decompress(chunk: Chunk) -> tuple[bytes, bool]:
    """Return what is in a chunk, and whether its packed bytes end as they should."""
    if chunk.compression == 'zstd':
        return unpack_zstd(chunk.data, chunk.uncompressed_size), True
    if chunk.compression == 'lz4':
        # one byte more than stated, so that a larger one is not cut off in silence
        decoder = lz4.frame.LZ4FrameDecompressor()
        records = decoder.decompress(chunk.data, max_length=chunk.uncompressed_size + 1)
        return bytes(records), bool(decoder.eof)
    return bytes(chunk.data), True


def _decompress_partly(chunk: Chunk) -> bytes:
    """Unpack piece by piece, up to the damage or beyond the limit."""
    if not chunk.compression:
        return bytes(chunk.data[: CHUNK_LIMIT_BYTES + 1])
    zstd = zstandard.ZstdDecompressor(max_window_size=CHUNK_LIMIT_BYTES)
    packed = chunk.compression == 'zstd'
    decoder: Any = zstd.decompressobj() if packed else lz4.frame.LZ4FrameDecompressor()
    out: list[bytes] = []
    size = 0
    with suppress(*_UNPACKING_ERRORS):
        for at in range(0, len(chunk.data), _PIECE_BYTES):
            if decoder.eof or size > CHUNK_LIMIT_BYTES:
                break
            out.append(decoder.decompress(chunk.data[at : at + _PIECE_BYTES]))
            size += len(out[-1])
    return b''.join(out)
