# SPDX-License-Identifier: Apache-2.0
"""
What is in an MCAP file and where: from its index, or from a walk through it.

Both give the same `Contents`; the walk costs a pass over the file, needs no
index, and goes on behind a damaged record.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BytesIO
from operator import attrgetter
from typing import Any, NamedTuple

from mcap import records as mcap_records
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader

from shipdrag_ros.bags.records import (
    MAGIC,
    MESSAGE_HEAD,
    READ_ERRORS,
    TIME_LIMIT_NS,
    Buffer,
    DamageKind,
    DamageList,
    Place,
    attachment_agrees,
    footer_of,
    read,
    summary_agrees,
    walk,
)
from shipdrag_ros.bags.scan import OpenChunk, scan

_SEGMENT_BYTES = 1 << 20
_NOT_USED = 'read from its beginning, without an index'


class FileChannel(NamedTuple):
    """A channel of a file; the encoding is 'cdr' where ROS 2 wrote it."""

    topic: str
    type: str
    encoding: str


class FileSegment(NamedTuple):
    """
    A chunk, or consecutive messages outside chunks.

    Sorts by the earliest log time [ns], then by place [bytes]. `size` is that of its
    records [bytes]; `channels` are those in it, empty where that is not known.
    """

    start_ns: int
    offset: int
    end: int
    end_ns: int
    size: int
    channels: frozenset[int] = frozenset()


@dataclass
class Contents:
    """
    What is in a file.

    Attributes
    ----------
    indexed
        Whether that was found by the index of the file.
    channels
        By their number in the file.
    counts
        Messages of each channel.
    attachments
        Content by name; of several with a name, the last.
    metadata
        Metadata records by name.
    compressions
        Of the chunks, '' for none.
    segments
        Where messages are, in the order of their first times.
    warnings
        What is wrong with the file, a sentence each.
    """

    indexed: bool = True
    channels: dict[int, FileChannel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, Mapping[str, str]] = field(default_factory=dict)
    compressions: set[str] = field(default_factory=set)
    segments: list[FileSegment] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    _schemas: dict[int, str] = field(default_factory=dict)

    def add(self, record: Any) -> None:
        """
        Take note of a schema, a channel, an attachment or metadata.
        """
        match record:
            case mcap_records.Schema():
                self._schemas[record.id] = record.name
            case mcap_records.Channel():
                self.channels[record.id] = FileChannel(
                    record.topic,
                    _full_name(self._schemas.get(record.schema_id, '')),
                    record.message_encoding,
                )
            case mcap_records.Attachment():
                self.attachments[record.name] = record.data
            case mcap_records.Metadata():
                self.metadata[record.name] = record.metadata


class _BadIndexError(Exception):
    """Why an index cannot be used."""


def contents_of(data: Buffer) -> Contents:
    """
    Return what is in a file; what is wrong with it is stated in `warnings`.
    """
    warnings = []
    try:
        contents = _by_index(data) or _by_walk(data)
    except _BadIndexError as error:
        warnings = [f'{error}: {_NOT_USED}']
        contents = _by_walk(data)
    contents.warnings[:0] = warnings
    contents.segments.sort()
    return contents


def _by_index(data: Buffer) -> Contents | None:
    """Return what the summary says; None where it does not say all, as the format allows."""
    if data[-len(MAGIC) :] != MAGIC or len(data) < 2 * len(MAGIC):
        raise _BadIndexError('the file was not closed, or it is cut off')
    footer = footer_of(data)
    if footer is None:
        raise _BadIndexError('the footer is damaged')
    if footer.summary_start == 0:
        return None
    if not summary_agrees(data, footer):
        raise _BadIndexError('the index has a wrong checksum')
    summary: dict[type, list[Any]] = {}
    try:
        reader = StreamReader(
            BytesIO(data[footer.summary_start :]), skip_magic=True, emit_chunks=True
        )
        for record in reader.records:
            summary.setdefault(type(record), []).append(record)
    except READ_ERRORS as error:
        raise _BadIndexError(f'the index is damaged ({error})') from error
    if not _says_all(summary):
        return None
    contents = Contents()
    for record in summary.get(mcap_records.Schema, []) + summary.get(mcap_records.Channel, []):
        contents.add(record)
    for kind, opcode in _INDEXED.items():
        for index in summary.get(kind, []):
            contents.add(_indexed(data, index.offset, opcode))
    at = 0
    for chunk in sorted(
        summary.get(mcap_records.ChunkIndex, []), key=attrgetter('chunk_start_offset')
    ):
        contents.segments.append(_segment(data, chunk, at))
        contents.compressions.add(chunk.compression)
        at = contents.segments[-1].end
    contents.counts.update(summary[mcap_records.Statistics][0].channel_message_counts)
    return contents


_INDEXED = {
    mcap_records.AttachmentIndex: Opcode.ATTACHMENT,
    mcap_records.MetadataIndex: Opcode.METADATA,
}


def _says_all(summary: Mapping[type, list[Any]]) -> bool:
    """Say whether everything that the statistics count is indexed."""
    if mcap_records.Statistics not in summary:
        return False
    statistics = summary[mcap_records.Statistics][0]
    counts = {
        mcap_records.Schema: statistics.schema_count,
        mcap_records.Channel: statistics.channel_count,
        mcap_records.ChunkIndex: statistics.chunk_count,
        mcap_records.AttachmentIndex: statistics.attachment_count,
        mcap_records.MetadataIndex: statistics.metadata_count,
    }
    # messages outside chunks have no index
    unchunked = statistics.chunk_count == 0 and statistics.message_count > 0
    return not unchunked and all(len(summary.get(it, [])) == n for it, n in counts.items())


def _place(data: Buffer, offset: int, opcode: int) -> Place:
    for place in walk(data, offset, len(data)):
        if place.opcode == opcode and place.damage is None:
            return place
        break
    raise _BadIndexError(f'the record at byte {offset} is not what the index says')


def _indexed(data: Buffer, offset: int, opcode: int) -> Any:
    place = _place(data, offset, opcode)
    if opcode == Opcode.ATTACHMENT and not attachment_agrees(data, place):
        raise _BadIndexError(f'the attachment at byte {offset} has a wrong checksum')
    return read(data, place)


def _segment(data: Buffer, chunk: mcap_records.ChunkIndex, least: int) -> FileSegment:
    offset, end = chunk.chunk_start_offset, chunk.chunk_start_offset + chunk.chunk_length
    late = max(chunk.message_start_time, chunk.message_end_time) >= TIME_LIMIT_NS
    if late or offset < least or _place(data, offset, Opcode.CHUNK).end != end:
        raise _BadIndexError(f'the record at byte {offset} is not what the index says')
    channels = frozenset(chunk.message_index_offsets)
    return FileSegment(
        chunk.message_start_time,
        offset,
        end,
        chunk.message_end_time,
        chunk.uncompressed_size,
        channels,
    )


def _by_walk(data: Buffer) -> Contents:
    """Return what is there; what is damaged is left out and stated in `warnings`."""
    contents = Contents(indexed=False)
    damages = DamageList()
    stray = False  # a message that is found in or behind a damaged chunk may be part of anything
    for place, chunk in scan(data, damages):
        stray = stray or (place.damage is not None and bool(contents.compressions))
        if place.damage is not None:
            continue
        if place.opcode == Opcode.DATA_END:
            break
        if chunk is not None:
            _add_chunk(chunk, contents)
        elif place.opcode == Opcode.MESSAGE and not stray:
            _add_message(data, place, contents)
        elif place.opcode == Opcode.ATTACHMENT and not attachment_agrees(data, place):
            contents.warnings.append(
                f'the attachment {getattr(read(data, place), "name", "")!r} has a wrong checksum: '
                'left out'
            )
        elif place.opcode in _DECLARATIONS:
            contents.add(read(data, place))
    first = {each.offset: each for each in reversed(damages.listed)}  # of each place
    contents.warnings += (
        left_out(each.record, each.offset, each.kind) for each in reversed(first.values())
    )
    strangers = sum(n for number, n in contents.counts.items() if number not in contents.channels)
    if strangers:
        contents.warnings.append(f'{strangers} messages of topics that are not declared: left out')
    return contents


_DECLARATIONS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT, Opcode.METADATA)


def _add_message(data: Buffer, place: Place, contents: Contents) -> None:
    """Lengthen the last segment by a message outside of chunks, or begin one."""
    channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(data, place.start)
    if log_ns >= TIME_LIMIT_NS:
        contents.warnings.append(
            f'the message at byte {place.offset} has no possible log time: left out'
        )
        return
    contents.counts[channel] += 1
    segment = FileSegment(log_ns, place.offset, place.end, log_ns, place.end - place.offset)
    last = contents.segments[-1] if contents.segments else segment
    if last.end == place.offset < last.offset + _SEGMENT_BYTES and not last.channels:
        contents.segments.pop()
        first_ns, end_ns = min(last.start_ns, log_ns), max(last.end_ns, log_ns)
        size = place.end - last.offset
        segment = FileSegment(first_ns, last.offset, place.end, end_ns, size)
    contents.segments.append(segment)


def _add_chunk(chunk: OpenChunk, contents: Contents) -> None:
    if chunk.chunk is None or chunk.damage is not None:
        return
    contents.compressions.add(chunk.chunk.compression)
    for place in chunk.others:
        if place.opcode in _DECLARATIONS:
            contents.add(read(chunk.records, place))
    counts = Counter(chunk.messages.channel.tolist())
    contents.counts.update(counts)
    times_ns = chunk.times_ns
    if times_ns is not None:
        first, last = times_ns
        _, offset, _, end, _ = chunk.place
        size = len(chunk.records)
        contents.segments.append(FileSegment(first, offset, end, last, size, frozenset(counts)))
    contents.warnings += chunk.notes


def left_out(record: str, offset: int, why: DamageKind) -> str:
    """
    Return the sentence of a warning.
    """
    name = record.replace('unknown', 'record')
    return f'the {name} at byte {offset} is damaged ({why.value}): left out'


def _full_name(type_name: str) -> str:
    """Return the name as ROS 2 has it; some tools leave `msg` out."""
    package, _, name = type_name.partition('/')
    return f'{package}/msg/{name}' if name and '/' not in name else type_name
