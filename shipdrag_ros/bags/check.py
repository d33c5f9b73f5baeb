# SPDX-License-Identifier: Apache-2.0
"""
Is a bag sound: every byte accounted for, every checksum right, every statement true.

One pass over the data makes the index that there should be; then what the summary
states is compared with it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Footer,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from shipdrag_ros.bags.mcap_file import locate, not_mcap
from shipdrag_ros.bags.message_index import EVERY_CHANNEL, index_messages
from shipdrag_ros.bags.records import (
    HEAD,
    IN_CHUNK,
    MAGIC,
    MESSAGE_HEAD,
    Buffer,
    Damage,
    DamageKind,
    DamageList,
    Place,
    attachment_agrees,
    checksum,
    read,
    unpack,
    walk,
)
from shipdrag_ros.bags.recover import opened
from shipdrag_ros.errors import BagError
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import Int64

_NO_ENTRIES = np.empty((0, 2), np.int64)
_INDEXED = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.METADATA_INDEX: MetadataIndex,
}


@dataclass(frozen=True)
class FileCheck:
    """
    What is wrong with a file.

    Attributes
    ----------
    path
        The file.
    size_bytes
        Its size, unpacked if it is packed as a whole.
    messages
        Whole messages in it.
    damage
        What is wrong, in order of place.
    damage_count
        How much of it there is; `damage` lists the first.
    """

    path: Path
    size_bytes: int
    messages: int
    damage: tuple[Damage, ...]
    damage_count: int

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong."""
        return self.damage_count == 0


def check(
    paths: Iterable[Path], *, progress: PartDone = lambda done, total: None
) -> list[FileCheck]:
    """
    Check the files of bags.

    Parameters
    ----------
    paths
        MCAP files and rosbag2 directories.
    progress
        Called with bytes done, and in all, of each file.

    Raises
    ------
    BagError
        If one cannot be read, or is not of MCAP at all.
    """
    checked = []
    for bag in [bag for path in paths for bag in locate(path)]:
        checked += [_check_file(file, progress) for file in bag.files]
        checked += [
            FileCheck(Path(bag.name), 0, 0, (Damage(0, 'file', DamageKind.MISSING, warning),), 1)
            for warning in bag.warnings
        ]
    return checked


def _check_file(path: Path, progress: PartDone) -> FileCheck:
    damages = DamageList()
    with opened(path, damages) as data:
        facts = _Facts(data, damages)
        if data:
            facts.gather(progress)
            if not facts.records and data[: len(MAGIC)] != MAGIC:
                raise BagError(not_mcap(path, data[:16]))
            facts.compare()
        damage = tuple(sorted(damages.listed, key=lambda damage: damage.offset))
        return FileCheck(path, len(data), facts.counts.total(), damage, damages.count)


class _Facts:
    """What is in the data of a file, and what its summary states."""

    def __init__(self, data: Buffer, damages: DamageList) -> None:
        self.counts: Counter[int] = Counter()
        self.records = 0
        self._data = data
        self._damages = damages
        self._expected: dict[type, dict[int, Any]] = {kind: {} for kind in _INDEXED.values()}
        self._first_ns: int | None = None
        self._last_ns = 0
        self._summary: list[tuple[Place, Any]] = []
        self._ended = 0
        self._chunk: ChunkIndex | None = None  # whose message indexes may follow
        self._entries: dict[int, Int64] = {}  # of it: log times [ns] and offsets, by channel
        self._said: set[str] = set()

    def gather(self, progress: PartDone) -> None:
        """Walk over the file."""
        data, damages = self._data, self._damages
        begin = len(MAGIC) if data[: len(MAGIC)] == MAGIC else 0
        if not begin:
            damages.add(0, 'magic', DamageKind.MISSING, f'{data[:8]!r}')
        elif data[begin : begin + 1] != bytes([Opcode.HEADER]):
            damages.add(begin, 'header', DamageKind.MISSING)
        if data[-len(MAGIC) :] != MAGIC:
            damages.add(len(data), 'magic', DamageKind.MISSING, 'not closed, or cut off')
        for place in walk(data, begin, len(data)):
            if place.damage is not None:
                damages.add(place.offset, place.name, place.damage)
            if place.opcode != Opcode.MESSAGE_INDEX:
                self._close_chunk()
            if place.opcode == Opcode.CHUNK and place.readable:
                progress(place.offset, len(data))
                self._open_chunk(place)
            elif place.readable:
                self._record(data, place, place.offset)
            self.records += place.readable
        self._close_chunk()

    def _record(self, data: Buffer, place: Place, offset: int) -> None:
        if place.opcode == Opcode.MESSAGE:
            channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(data, place.start)
            self._count(channel, 1, offset)
            self._span(log_ns, log_ns)
            return
        if place.opcode == Opcode.MESSAGE_INDEX:
            self._message_index(place)
            return
        record = read(data, place)
        length = place.end - place.offset
        match place.opcode:
            case _ if record is None:
                self._damages.add(offset, place.name, DamageKind.CONTENT)
            case Opcode.SCHEMA | Opcode.CHANNEL if not self._ended:
                self._declaration(record, place, offset)
            case Opcode.ATTACHMENT:
                if not attachment_agrees(data, place):
                    self._damages.add(offset, 'attachment', DamageKind.CHECKSUM)
                times = record.log_time, record.create_time
                self._expected[AttachmentIndex][offset] = AttachmentIndex(
                    offset, length, *times, len(record.data), record.name, record.media_type
                )
            case Opcode.METADATA:
                self._expected[MetadataIndex][offset] = MetadataIndex(offset, length, record.name)
            case Opcode.DATA_END:
                self._once(place, place.name)
                self._ended = self._ended or place.end
                if record.data_section_crc not in (0, checksum(data, 0, offset)):
                    self._damages.add(offset, 'data_end', DamageKind.CHECKSUM)
            case Opcode.HEADER:
                self._once(place, place.name)
            case _:
                self._summary.append((place, record))

    def _declaration(self, record: Schema | Channel, place: Place, offset: int) -> None:
        known = self._expected[type(record)]
        if known.setdefault(record.id, record) != record:
            self._damages.add(offset, place.name, DamageKind.DISAGREES, f'number {record.id}')
        if isinstance(record, Channel) and record.schema_id not in (0, *self._expected[Schema]):
            self._refers(offset, place.name, f'schema {record.schema_id}')

    def _count(self, channel: int, messages: int, offset: int) -> None:
        self.counts[channel] += messages
        if channel not in self._expected[Channel]:
            self._refers(offset, 'message', f'channel {channel}')

    def _span(self, first_ns: int, last_ns: int) -> None:
        self._first_ns = first_ns if self._first_ns is None else min(first_ns, self._first_ns)
        self._last_ns = max(last_ns, self._last_ns)

    def _refers(self, offset: int, record: str, target: str) -> None:
        """Say once what is not there; a thousand messages may refer to it."""
        if target not in self._said:
            self._said.add(target)
            self._damages.add(offset, record, DamageKind.REFERENCE, f'{target} is not declared')

    def _once(self, place: Place, key: object) -> None:
        if f'{place.name} {key}' in self._said:
            self._damages.add(place.offset, place.name, DamageKind.DUPLICATE)
        self._said.add(f'{place.name} {key}')

    def _open_chunk(self, place: Place) -> None:
        unpacked = unpack(self._data, place)
        damage = unpacked.damage
        if damage is not None and damage is not place.damage:
            self._damages.add(place.offset, 'chunk', damage)
        records = unpacked.records if damage is None else b''
        messages, others, notes = index_messages([records], [place.offset], EVERY_CHANNEL)
        kinds = np.frombuffer(records, np.uint8)[others]
        if notes or not np.isin(kinds, list(IN_CHUNK)).all():
            for inner in walk(records, 0, len(records), IN_CHUNK):
                if inner.damage is not None:
                    where = f'at byte {inner.offset} of the unpacked chunk'
                    self._damages.add(place.offset, inner.name, inner.damage, where)
        for at in others[np.isin(kinds, list(IN_CHUNK))].tolist():
            start = at + HEAD.size
            end = start + HEAD.unpack_from(records, at)[1]
            self._record(records, Place(records[at], at, start, end), place.offset)
        offsets = messages.start - (HEAD.size + MESSAGE_HEAD.size)
        entries = np.column_stack((messages.log_ns, offsets))
        self._entries = {
            channel: entries[messages.channel == channel]
            for channel in np.unique(messages.channel).tolist()
        }
        for channel, of_channel in self._entries.items():
            self._count(channel, len(of_channel), place.offset)
        self._index_chunk(place, messages.log_ns, sound=damage is None and place.damage is None)

    def _index_chunk(self, place: Place, log_ns: Int64, *, sound: bool) -> None:
        """Make the index that the chunk should have; None where it is damaged itself."""
        self._expected[ChunkIndex][place.offset] = None
        if not sound:
            return
        chunk = read(self._data, place)
        span = (int(log_ns.min()), int(log_ns.max())) if len(log_ns) else (0, 0)
        stated = chunk.message_start_time, chunk.message_end_time
        if len(log_ns):
            self._span(*span)
            if stated != span:
                text = f'times {stated}, in it are {span}'
                self._damages.add(place.offset, 'chunk', DamageKind.DISAGREES, text)
        self._chunk = self._expected[ChunkIndex][place.offset] = ChunkIndex(
            chunk_length=place.end - place.offset,
            chunk_start_offset=place.offset,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            message_end_time=stated[1],
            message_index_length=0,
            message_index_offsets={},
            message_start_time=stated[0],
            uncompressed_size=chunk.uncompressed_size,
        )

    def _message_index(self, place: Place) -> None:
        if self._chunk is None:
            return
        channel = int.from_bytes(self._data[place.start : place.start + 2], 'little')
        listed = np.frombuffer(self._data[place.start + 6 : place.end], np.uint8)
        if channel in self._chunk.message_index_offsets:
            self._damages.add(place.offset, 'message_index', DamageKind.DUPLICATE)
        self._chunk.message_index_offsets[channel] = place.offset
        self._chunk.message_index_length += place.end - place.offset
        actual = self._entries.get(channel, _NO_ENTRIES)
        stated = listed[: len(listed) // 16 * 16].view(np.int64).reshape(-1, 2)
        if not np.array_equal(_sorted(stated), _sorted(actual)):
            text = f'channel {channel}'
            self._damages.add(place.offset, 'message_index', DamageKind.MISPLACED, text)

    def _close_chunk(self) -> None:
        chunk, self._chunk = self._chunk, None
        if chunk is None or not chunk.message_index_offsets:
            return
        missing = sorted(set(self._entries) - set(chunk.message_index_offsets))
        if missing:
            text = f'channels {missing}'
            offset = chunk.chunk_start_offset + chunk.chunk_length
            self._damages.add(offset, 'message_index', DamageKind.MISSING, text)

    def compare(self) -> None:
        """Compare the summary with what is there."""
        if not self._ended:
            self._damages.add(len(self._data), 'data_end', DamageKind.MISSING)
        place, footer = next(
            (it for it in self._summary if isinstance(it[1], Footer)), (None, None)
        )
        if place is None or footer is None:
            self._damages.add(len(self._data), 'footer', DamageKind.MISSING)
            return
        if footer.summary_start == 0:
            self._damages.add(place.offset, 'summary', DamageKind.MISSING)
            return
        if footer.summary_crc not in (
            0,
            checksum(self._data, footer.summary_start, place.end - 4),
        ):
            self._damages.add(place.offset, 'summary', DamageKind.CHECKSUM)
        if footer.summary_start != self._ended:
            text = f'it begins at {self._ended}, not {footer.summary_start}'
            self._damages.add(place.offset, 'summary', DamageKind.MISPLACED, text)
        groups: dict[int, tuple[int, int]] = {}
        stated: dict[type, set[int]] = {kind: set() for kind in self._expected}
        for place, record in self._summary:
            begin, _ = groups.setdefault(place.opcode, (place.offset, 0))
            groups[place.opcode] = begin, place.end - begin
            self._once(place, _key(record))
            if type(record) in stated:
                stated[type(record)].add(_key(record))
                self._compare(place, record)
        for place, record in self._summary:
            if isinstance(record, Statistics):
                self._statistics(place, record, stated)
            elif isinstance(record, SummaryOffset) and record.group_length:
                group = record.group_start, record.group_length
                if groups.get(record.group_opcode) != group:
                    self._damages.add(place.offset, place.name, DamageKind.MISPLACED)
        self._missing(stated, said_statistics=Opcode.STATISTICS in groups)

    def _compare(self, place: Place, stated: Any) -> None:
        known = self._expected[type(stated)]
        # a topic without messages may be declared in the summary alone
        actual = known.get(_key(stated), stated if isinstance(stated, Schema | Channel) else ())
        if actual == ():
            text = f'nothing of that kind is at byte {_key(stated)}'
            self._damages.add(place.offset, place.name, DamageKind.MISPLACED, text)
        elif actual not in (None, stated):  # of a damaged chunk nothing is known
            text = f'{stated}, in the data {actual}'
            self._damages.add(place.offset, place.name, DamageKind.DISAGREES, text)

    def _statistics(self, place: Place, stated: Statistics, said: dict[type, set[int]]) -> None:
        here = {kind: len(said[kind] | set(known)) for kind, known in self._expected.items()}
        actual = Statistics(
            attachment_count=len(self._expected[AttachmentIndex]),
            channel_count=here[Channel],
            channel_message_counts=dict(self.counts),
            chunk_count=len(self._expected[ChunkIndex]),
            message_count=self.counts.total(),
            message_end_time=self._last_ns,
            message_start_time=self._first_ns or 0,
            metadata_count=len(self._expected[MetadataIndex]),
            schema_count=here[Schema],
        )
        by_channel = {number: n for number, n in stated.channel_message_counts.items() if n}
        stated = replace(
            stated, channel_message_counts=by_channel or actual.channel_message_counts
        )
        if stated != actual:
            text = f'{stated}, in the data {actual}'
            self._damages.add(place.offset, place.name, DamageKind.DISAGREES, text)

    def _missing(self, stated: dict[type, set[int]], *, said_statistics: bool) -> None:
        if not said_statistics:
            self._damages.add(self._ended, 'statistics', DamageKind.MISSING)
        for opcode, kind in _INDEXED.items():
            missing = sorted(set(self._expected[kind]) - stated[kind])
            if kind in (Schema, Channel):
                # none at all is a choice of the writer
                missing, where = missing if stated[kind] else [], [self._ended] * len(missing)
            else:
                where = missing
            for offset, key in zip(where, missing, strict=False):
                text = f'of {key}'
                self._damages.add(offset, Opcode(opcode).name.lower(), DamageKind.MISSING, text)


def _key(record: Any) -> int:
    """Return what a record of the summary is about: a number, or a place."""
    for name in ('id', 'chunk_start_offset', 'offset', 'group_opcode'):
        if hasattr(record, name):
            return int(getattr(record, name))
    return 0


def _sorted(entries: Int64) -> Int64:
    return entries[np.lexsort(entries.T)]
