# SPDX-License-Identifier: Apache-2.0
"""
What is in an MCAP file and where: from its index, or from a walk through it.

Both give the same `Contents`; the walk costs a pass over the file, needs no
index, and goes on behind a damaged chunk.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from shipdrag_ros.bags.message_index import CHANNELS, index_messages
from shipdrag_ros.bags.records import (
    FOOTER_BYTES,
    MAGIC,
    TIME_LIMIT_NS,
    Buffer,
    DamagedRecord,
    Place,
    message_head,
    parse,
    release,
    unpack_chunk,
    walk,
)

_SEGMENT_BYTES = 1 << 20
_FOOTER_CHECKSUM_BYTES = 4


class FileChannel(NamedTuple):
    """A channel of a file; the encoding is 'cdr' where ROS 2 wrote it."""

    topic: str
    type: str
    encoding: str


class FileSegment(NamedTuple):
    """
    A chunk, or consecutive messages outside chunks.

    Sorts by the earliest log time [ns], then by place [bytes]. `channels` are those
    in it, empty where that is not known.
    """

    start_ns: int
    offset: int
    end: int
    end_ns: int
    channels: frozenset[int] = frozenset()


@dataclass
class Contents:
    """
    What is in a file.

    Attributes
    ----------
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
        Where messages are.
    warnings
        What is wrong with the file, a sentence each.
    """

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
            case Schema():
                self._schemas[record.id] = record.name
            case Channel():
                self.channels[record.id] = FileChannel(
                    record.topic,
                    _full_name(self._schemas.get(record.schema_id, '')),
                    record.message_encoding,
                )
            case Attachment():
                self.attachments[record.name] = record.data
            case Metadata():
                self.metadata[record.name] = record.metadata


def read_index(data: Buffer) -> Contents | None:
    """
    Return the contents by the summary of a file.

    None where the summary does not say all, as the format allows.

    Raises
    ------
    DamagedRecord
        If the file has no end, or its summary is damaged.
    """
    footer_at = len(data) - FOOTER_BYTES
    if footer_at < len(MAGIC) or data[-len(MAGIC) :] != MAGIC:
        raise DamagedRecord('the file was not closed, or it is cut off')
    place = _record_at(data, footer_at, len(data) - len(MAGIC))
    if place.opcode != Opcode.FOOTER:
        raise DamagedRecord('the footer is damaged')
    footer = parse(data, place)
    if footer.summary_start == 0:
        return None
    # the checksum covers the footer too, up to itself
    summary = data[footer.summary_start : place.end - _FOOTER_CHECKSUM_BYTES]
    if footer.summary_crc not in (0, crc32(summary)):
        raise DamagedRecord('the index has a wrong checksum')

    found: dict[int, list[Any]] = {}
    for place in walk(data, footer.summary_start, footer_at):
        if place.opcode in _SUMMARY:
            found.setdefault(place.opcode, []).append(parse(data, place))
    if not _indexes_all(found):
        return None
    contents = Contents()
    for record in found.get(Opcode.SCHEMA, []) + found.get(Opcode.CHANNEL, []):
        contents.add(record)
    for index_opcode, opcode in _INDEXED.items():
        for index in found.get(index_opcode, []):
            place = _record_at(data, index.offset, footer_at)
            if place.opcode != opcode:
                raise DamagedRecord(f'record at byte {place.offset} is not what the index says')
            contents.add(parse(data, place))
    end = 0
    for chunk in sorted(found.get(Opcode.CHUNK_INDEX, []), key=attrgetter('chunk_start_offset')):
        start = chunk.chunk_start_offset
        place = _record_at(data, start, footer_at)
        late = max(chunk.message_start_time, chunk.message_end_time) >= TIME_LIMIT_NS
        if place.opcode != Opcode.CHUNK or start < end or late:
            raise DamagedRecord(f'record at byte {start} is not what the index says')
        end = place.end
        contents.compressions.add(chunk.compression)
        contents.segments.append(
            FileSegment(
                chunk.message_start_time,
                start,
                end,
                chunk.message_end_time,
                frozenset(chunk.message_index_offsets),
            )
        )
    contents.counts.update(found[Opcode.STATISTICS][0].channel_message_counts)
    return contents


_INDEXED = {
    Opcode.ATTACHMENT_INDEX: Opcode.ATTACHMENT,
    Opcode.METADATA_INDEX: Opcode.METADATA,
}
_SUMMARY = {
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.STATISTICS,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
}


def _indexes_all(summary: Mapping[int, list[Any]]) -> bool:
    """Say whether everything that the statistics count is indexed."""
    if Opcode.STATISTICS not in summary:
        return False
    statistics = summary[Opcode.STATISTICS][0]
    expected = {
        Opcode.SCHEMA: statistics.schema_count,
        Opcode.CHANNEL: statistics.channel_count,
        Opcode.CHUNK_INDEX: statistics.chunk_count,
        Opcode.ATTACHMENT_INDEX: statistics.attachment_count,
        Opcode.METADATA_INDEX: statistics.metadata_count,
    }
    # messages outside chunks have no index
    unchunked = statistics.chunk_count == 0 and statistics.message_count > 0
    return not unchunked and all(
        len(summary.get(opcode, [])) == count for opcode, count in expected.items()
    )


def _record_at(data: Buffer, offset: int, limit: int) -> Place:
    for place in walk(data, offset, limit):
        return place
    raise DamagedRecord(f'the index points to byte {offset}, outside of the data')


def scan(data: Buffer) -> Contents:
    """
    Return the contents by a walk from the beginning of a file.

    What is damaged is left out and stated in `warnings`.
    """
    contents = Contents()
    loose = _LooseMessages(contents)
    try:
        for place in walk(data, len(MAGIC), len(data)):
            if place.opcode == Opcode.DATA_END:
                break
            try:
                if place.opcode == Opcode.MESSAGE:
                    loose.add(data, place)
                    continue
                loose.close()
                if place.opcode == Opcode.CHUNK:
                    _scan_chunk(data, place, contents)
                elif place.opcode in _DECLARATIONS:
                    contents.add(parse(data, place))
            except DamagedRecord as damage:
                loose.close()  # so that no segment holds what is damaged
                contents.warnings.append(f'{damage}: left out')
    except DamagedRecord as damage:
        contents.warnings.append(f'{damage}: only what lies before is used')
    loose.close()
    strangers = sum(
        n for channel, n in contents.counts.items() if channel not in contents.channels
    )
    if strangers:
        contents.warnings.append(f'{strangers} messages of topics that are not declared: left out')
    return contents


_DECLARATIONS = {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT, Opcode.METADATA}


_EVERY_CHANNEL = np.ones(CHANNELS, np.uint8)


def _scan_chunk(data: Buffer, chunk: Place, contents: Contents) -> None:
    compression, unpacked = unpack_chunk(data, chunk)
    contents.compressions.add(compression)
    messages, others, damage = index_messages([unpacked], [chunk.offset], _EVERY_CHANNEL)
    kinds = np.frombuffer(unpacked, np.uint8)[others]
    for offset in others[np.isin(kinds, list(_DECLARATIONS))]:
        place = next(walk(unpacked, int(offset), len(unpacked)))
        contents.add(parse(unpacked, place))
    counts = np.bincount(messages.channel)
    channels = np.flatnonzero(counts)
    contents.counts.update(dict(zip(channels.tolist(), counts[channels].tolist(), strict=True)))
    if len(messages):
        first, last = int(messages.log_ns.min()), int(messages.log_ns.max())
        contents.segments.append(
            FileSegment(first, chunk.offset, chunk.end, last, frozenset(channels.tolist()))
        )
    contents.warnings += damage


class _LooseMessages:
    """Gathers messages outside chunks into segments of a bounded size."""

    def __init__(self, contents: Contents) -> None:
        self._contents = contents
        self._times: list[int] = []
        self._offset = 0
        self._end = 0

    def add(self, data: Buffer, place: Place) -> None:
        channel, log_ns = message_head(data, place)
        if not self._times:
            self._offset = place.offset
        self._contents.counts[channel] += 1
        self._times.append(log_ns)
        self._end = place.end
        if self._end - self._offset > _SEGMENT_BYTES:
            offset = self._offset
            self.close()
            release(data, offset, self._end)

    def close(self) -> None:
        if self._times:
            self._contents.segments.append(
                FileSegment(min(self._times), self._offset, self._end, max(self._times))
            )
            self._times = []


def _full_name(type_name: str) -> str:
    """Return the name as ROS 2 has it; some tools leave `msg` out."""
    package, _, name = type_name.partition('/')
    return f'{package}/msg/{name}' if name and '/' not in name else type_name
