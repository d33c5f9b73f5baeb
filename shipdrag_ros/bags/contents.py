# SPDX-License-Identifier: Apache-2.0
"""
What is in an MCAP file and where: as its summary says, or as a pass over it finds.

The pass needs no summary, and goes on behind a damaged record.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BytesIO
from operator import attrgetter
from typing import Any

from mcap import records as mcap
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader

from shipdrag_ros.bags import records
from shipdrag_ros.bags.records import MAGIC, Buffer, Damage, DamageKind, DamageList, OpenChunk

_SEGMENT_BYTES = 1 << 20
_NOT_USED = 'read from its beginning, without an index'


RECORDING = 'shipdrag_ros'
"""Name of the metadata record that says which recording a file is part of."""

DECLARED = (mcap.Schema, mcap.Channel)
INDEXES = {
    mcap.ChunkIndex: Opcode.CHUNK,
    mcap.AttachmentIndex: Opcode.ATTACHMENT,
    mcap.MetadataIndex: Opcode.METADATA,
}
"""What each index is about."""


def key_of(record: Any) -> tuple[type, int]:
    """Return what a record of a summary is about: its kind, and a number or a place."""
    for name in ('id', 'chunk_start_offset', 'offset', 'group_opcode'):
        if hasattr(record, name):
            return type(record), int(getattr(record, name))
    return type(record), 0


class FileSummary:
    """
    Declarations, indexes and counts; of two declarations that differ the better witnessed counts.

    Attributes
    ----------
    records
        Declarations by their number, indexes by the place of what they are about; None of
        a chunk that is known to be there and no more.
    counts
        Messages by channel.
    times_ns
        Log times, the first and the last [ns]; none without messages.
    """

    def __init__(self) -> None:
        self.records: dict[tuple[type, int], Any] = {}
        self.counts: Counter[int] = Counter()
        self.times_ns: tuple[int, ...] = ()
        self._verified: set[tuple[type, int]] = set()

    def of(self, *kinds: type) -> list[Any]:
        """Return the records of some kinds, in the order in which they were added."""
        return [record for (kind, _), record in self.records.items() if kind in kinds]

    def add(self, record: Any, *, verified: bool = False) -> bool:
        """
        Take note of a declaration or an index; return whether it agrees with what is known.

        Parameters
        ----------
        record
            Of a file.
        verified
            Whether a checksum vouches for it.
        """
        key = key_of(record)
        before = self.records.setdefault(key, record)
        better = verified and key not in self._verified
        if better:
            self.records[key] = record
            self._verified.add(key)
        return better or before == record

    def add_indexed(self, record: Any, at: int, length: int) -> Any:
        """
        Take note of a chunk, an attachment or metadata at a place [bytes]; return its index.

        That of a chunk is without its message indexes.
        """
        match record:
            case mcap.Chunk():
                index: Any = mcap.ChunkIndex(
                    chunk_length=length,
                    chunk_start_offset=at,
                    compression=record.compression,
                    compressed_size=len(record.data),
                    message_end_time=record.message_end_time,
                    message_index_length=0,
                    message_index_offsets={},
                    message_start_time=record.message_start_time,
                    uncompressed_size=record.uncompressed_size,
                )
            case mcap.Metadata():
                index = mcap.MetadataIndex(at, length, record.name)
            case _:
                times = record.log_time, record.create_time
                about = record.name, record.media_type
                index = mcap.AttachmentIndex(at, length, *times, len(record.data), *about)
        self.records[type(index), at] = index
        return index

    def count(self, counts: Mapping[int, int], first_ns: int, last_ns: int) -> None:
        """
        Count messages, of each channel so many, whose first and last log times are known [ns].
        """
        for channel, count in counts.items():
            self.counts[channel] += count
        first, last = self.times_ns or (first_ns, last_ns)
        self.times_ns = min(first, first_ns), max(last, last_ns)

    def statistics(self) -> mcap.Statistics:
        """Return what a summary says of the whole file."""
        kinds = Counter(kind for kind, _ in self.records)
        return mcap.Statistics(
            attachment_count=kinds[mcap.AttachmentIndex],
            channel_count=kinds[mcap.Channel],
            channel_message_counts=dict(self.counts),
            chunk_count=kinds[mcap.ChunkIndex],
            message_count=self.counts.total(),
            message_end_time=max(self.times_ns, default=0),
            message_start_time=min(self.times_ns, default=0),
            metadata_count=kinds[mcap.MetadataIndex],
            schema_count=kinds[mcap.Schema],
        )


@dataclass
class Contents:
    """
    What is in a file.

    Attributes
    ----------
    indexed
        Whether that was found by the index of the file.
    channels
        Topic and type by number in the file; a type in another encoding is another type.
    counts
        Messages of each channel.
    attachments
        Content by name; of several with a name, the last.
    metadata
        mcap.Metadata records by name.
    segments
        Where messages are, in the order of their first times: chunks, and consecutive
        messages outside of chunks, of which no channels are known.
    warnings
        What is wrong with the file, a sentence each.
    """

    indexed: bool = True
    channels: dict[int, tuple[str, str]] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, Mapping[str, str]] = field(default_factory=dict)
    segments: list[mcap.ChunkIndex] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def recording(self) -> Mapping[str, str]:
        """Version, id and part of the recording; nothing of another tool's."""
        return self.metadata.get(RECORDING, {})


class _BadIndexError(Exception):
    """Why an index cannot be used."""


def contents_of(data: Buffer) -> Contents:
    """Return what is in a file; what is wrong with it is stated in `warnings`."""
    found = Contents()
    summary = None
    try:
        summary = _stated(data)
    except _BadIndexError as error:
        found.warnings.append(f'{error}: {_NOT_USED}')
    if summary is None:
        found.indexed = False
        summary = _walked(data, found.warnings)
    found.counts = summary.counts
    names = {schema.id: _full_name(schema.name) for schema in summary.of(mcap.Schema)}
    for each in summary.of(mcap.Channel):
        topic = each.topic if each.topic.startswith('/') else f'/{each.topic}'
        other = '' if each.message_encoding == 'cdr' else f' ({each.message_encoding})'
        found.channels[each.id] = topic, names.get(each.schema_id, '') + other
    for each in summary.of(mcap.AttachmentIndex, mcap.MetadataIndex):
        match records.read(data, records.place_at(data, each.offset)):
            case mcap.Attachment() as it:
                found.attachments[it.name] = it.data
            case mcap.Metadata() as it:
                found.metadata[it.name] = it.metadata
    place = attrgetter('message_start_time', 'chunk_start_offset')
    found.segments = sorted(summary.of(mcap.ChunkIndex), key=place)
    return found


def _stated(data: Buffer) -> FileSummary | None:
    """Return what the summary says; None where it does not say all, as the format allows."""
    if data[-len(MAGIC) :] != MAGIC or len(data) < 2 * len(MAGIC):
        raise _BadIndexError('the file was not closed, or it is cut off')
    footer = records.footer_of(data)
    if footer is None:
        raise _BadIndexError('the footer is damaged')
    if footer.summary_start == 0:
        return None
    if not records.summary_agrees(data, footer):
        raise _BadIndexError('the index has a wrong checksum')
    summary = FileSummary()
    stream = BytesIO(data[footer.summary_start :])
    try:
        for record in StreamReader(stream, skip_magic=True, emit_chunks=True).records:
            if not summary.add(record) and isinstance(record, (*DECLARED, *INDEXES)):
                raise _misplaced(key_of(record)[1])
    except records.READ_ERRORS as error:
        raise _BadIndexError(f'the index is damaged ({error})') from error
    for stated in summary.of(mcap.Statistics):
        summary.counts.update(stated.channel_message_counts)
        listed = summary.statistics()
        # messages outside chunks have no index
        counted = {name for name in vars(stated) if name.endswith('_count')} - {'message_count'}
        if stated.message_count and not stated.chunk_count:
            return None
        if any(getattr(listed, name) != getattr(stated, name) for name in counted):
            return None
        _follow(data, summary)
        return summary
    return None


def _follow(data: Buffer, summary: FileSummary) -> None:
    """Look whether everything is where the index says, nothing in another."""
    end = 0
    for it in sorted(summary.of(*INDEXES), key=lambda index: key_of(index)[1]):
        offset, last_ns, length = key_of(it)[1], 0, getattr(it, 'length', 0)
        if isinstance(it, mcap.ChunkIndex):
            last_ns, length = max(it.message_start_time, it.message_end_time), it.chunk_length
        place = next(records.walk(data, offset, len(data)), None)
        begin, end = end, offset + length
        expected = records.Place(INDEXES[type(it)], offset, offset + records.HEAD.size, end)
        if offset < begin or place != expected or last_ns >= records.TIME_LIMIT_NS:
            raise _misplaced(offset)
        if place.opcode == Opcode.ATTACHMENT and not records.attachment_agrees(data, place):
            raise _BadIndexError(f'the attachment at byte {offset} has a wrong checksum')


def _misplaced(offset: int) -> _BadIndexError:
    return _BadIndexError(f'the record at byte {offset} is not what the index says')


def _walked(data: Buffer, warnings: list[str]) -> FileSummary:
    """Return what is there; what is damaged is left out and stated."""
    summary, damages = FileSummary(), DamageList()
    loose: mcap.ChunkIndex | None = None
    chunked = damaged = False
    for place, item, sound in records.scan(data, damages):
        chunked = chunked or isinstance(item, OpenChunk)
        damaged = damaged or place.damage is not None
        loose_message = place.opcode == Opcode.MESSAGE and not (chunked and damaged)
        if place.damage is not None or not (sound or loose_message):
            continue
        if place.opcode == Opcode.DATA_END:
            break
        if loose_message:
            channel, _, log_ns, _ = records.MESSAGE_HEAD.unpack_from(data, place.start)
            if log_ns < records.TIME_LIMIT_NS:
                summary.counts[channel] += 1
                loose = _with_message(loose, place, log_ns, summary)
            else:
                warnings.append(
                    f'the message at byte {place.offset} has no possible log time: left out'
                )
        elif isinstance(item, OpenChunk):
            if item.damage is None:
                _add_chunk(item, summary)
            warnings += item.indexed.damage
        elif isinstance(item, DECLARED):
            summary.add(item)
        elif isinstance(item, mcap.Attachment | mcap.Metadata):
            summary.add_indexed(item, *place.span)
    first = {each.offset: each for each in reversed(damages.listed)}  # of each place
    warnings += map(left_out, reversed(first.values()))
    known = {channel.id for channel in summary.of(mcap.Channel)}
    strangers = sum(n for number, n in summary.counts.items() if number not in known)
    if strangers:
        warnings.append(f'{strangers} messages of topics that are not declared: left out')
    return summary


def _add_chunk(opened: OpenChunk, summary: FileSummary) -> None:
    found, times_ns = opened.indexed, opened.times_ns
    for at in found.others.tolist():
        record = records.read(opened.records, records.place_at(opened.records, at))
        if isinstance(record, DECLARED):
            summary.add(record, verified=opened.verified)
    if times_ns is not None:
        index = summary.add_indexed(opened.chunk, *opened.place.span)
        index.message_start_time, index.message_end_time = times_ns
        counts = Counter(found.messages.channel.tolist())
        index.message_index_offsets = dict.fromkeys(counts, 0)
        summary.counts.update(counts)


def _with_message(
    last: mcap.ChunkIndex | None, place: records.Place, log_ns: int, summary: FileSummary
) -> mcap.ChunkIndex:
    """Lengthen the last segment by a message outside of chunks, or begin one."""
    follows = last is not None and last.chunk_start_offset + last.chunk_length == place.offset
    if last is None or not follows or last.chunk_length >= _SEGMENT_BYTES:
        last = summary.add_indexed(mcap.Chunk('', b'', log_ns, log_ns, 0, 0), place.offset, 0)
    last.uncompressed_size = last.chunk_length = place.end - last.chunk_start_offset
    last.message_start_time = min(last.message_start_time, log_ns)
    last.message_end_time = max(last.message_end_time, log_ns)
    return last


def opened_segment(data: Buffer, segment: mcap.ChunkIndex) -> OpenChunk:
    """Return the records of a segment."""
    place = records.place_at(data, segment.chunk_start_offset)
    if place.opcode == Opcode.CHUNK:
        return records.unpack(data, place)
    place = place._replace(end=place.offset + segment.chunk_length)
    records.release(data, place.offset, place.end)
    return OpenChunk(place, records=data[place.offset : place.end])


def left_out(damage: Damage) -> str:
    """Return the sentence of a warning."""
    if damage.record == 'attachment' and damage.kind is DamageKind.CHECKSUM:
        return f'the attachment {damage.detail} has a wrong checksum: left out'
    name = damage.record.replace('unknown', 'record')
    return f'the {name} at byte {damage.offset} is damaged ({damage.kind.value}): left out'


def _full_name(type_name: str) -> str:
    """Return the name as ROS 2 has it; some tools leave `msg` out."""
    package, _, name = type_name.partition('/')
    return f'{package}/msg/{name}' if name and '/' not in name else type_name
