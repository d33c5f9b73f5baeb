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
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from shipdrag_ros.bags.mcap_file import locate, not_mcap
from shipdrag_ros.bags.records import (
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
    has_end,
    read,
)
from shipdrag_ros.bags.recover import opened
from shipdrag_ros.bags.scan import OpenChunk, scan
from shipdrag_ros.bags.writer import chunk_index, index_of, statistics
from shipdrag_ros.errors import BagError
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import Int64

_NO_ENTRIES = np.empty((0, 2), np.int64)
_DECLARED = (Schema, Channel)
# of which the summary says all
_LISTED = {
    Schema: 'schema',
    Channel: 'channel',
    ChunkIndex: 'chunk_index',
    AttachmentIndex: 'attachment_index',
    MetadataIndex: 'metadata_index',
    Statistics: 'statistics',
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
        # what the summary should say, by kind and number or place; None where it is not known
        self._expected: dict[tuple[type, int], Any] = {}
        self._summary: list[tuple[Place, Any]] = []
        self._times_ns: tuple[int, ...] = ()  # first and last
        self._ended = 0
        self._chunk: ChunkIndex | None = None  # whose message indexes may follow
        self._entries: dict[int, Int64] = {}  # of it: log times [ns] and offsets, by channel
        self._said: set[str] = set()

    def gather(self, progress: PartDone) -> None:
        """Walk over the file."""
        data, damages = self._data, self._damages
        begin = len(MAGIC)
        if data[:begin] == MAGIC and data[begin : begin + 1] != bytes([Opcode.HEADER]):
            damages.add(begin, 'header', DamageKind.MISSING)
        if data[-len(MAGIC) :] != MAGIC:
            damages.add(len(data), 'magic', DamageKind.MISSING, 'not closed, or cut off')
        for place, chunk in scan(data, damages):
            if place.opcode != Opcode.MESSAGE_INDEX:
                self._close_chunk()
            if chunk is not None and place.readable:
                progress(place.offset, len(data))
                self._open_chunk(chunk)
            elif place.readable:
                self._record(data, place, place.offset)
            self.records += place.readable
        self._close_chunk()

    def _record(self, data: Buffer, place: Place, offset: int) -> None:
        if place.opcode == Opcode.MESSAGE:
            channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(data, place.start)
            self._count(channel, 1, offset)
            self._span(log_ns)
            return
        if place.opcode == Opcode.MESSAGE_INDEX:
            self._message_index(place)
            return
        record = read(data, place)
        match record:
            case None:
                self._damages.add(offset, place.name, DamageKind.CONTENT)
            case Schema() | Channel() if not self._ended:
                self._declaration(record, place, offset)
            case Attachment() | Metadata():
                if isinstance(record, Attachment) and not attachment_agrees(data, place):
                    self._damages.add(offset, place.name, DamageKind.CHECKSUM)
                index = index_of(record, offset, place.end - place.offset)
                self._expected[type(index), offset] = index
            case DataEnd():
                self._once(place, place.name)
                self._ended = self._ended or place.end
                if record.data_section_crc not in (0, checksum(data, 0, offset)):
                    self._damages.add(offset, place.name, DamageKind.CHECKSUM)
            case Header():
                self._once(place, place.name)
            case _:
                self._summary.append((place, record))

    def _declaration(self, record: Schema | Channel, place: Place, offset: int) -> None:
        if self._expected.setdefault((type(record), record.id), record) != record:
            self._damages.add(offset, place.name, DamageKind.DISAGREES, f'number {record.id}')
        if isinstance(record, Channel) and record.schema_id:
            self._refers(offset, place.name, Schema, record.schema_id)

    def _count(self, channel: int, messages: int, offset: int) -> None:
        self.counts[channel] += messages
        self._refers(offset, 'message', Channel, channel)

    def _span(self, *times_ns: int) -> None:
        times_ns = *self._times_ns, *times_ns
        self._times_ns = min(times_ns), max(times_ns)

    def _refers(self, offset: int, record: str, kind: type, number: int) -> None:
        """Say once what is not there; a thousand messages may refer to it."""
        target = f'{kind.__name__.lower()} {number}'
        if (kind, number) not in self._expected and target not in self._said:
            self._said.add(target)
            self._damages.add(offset, record, DamageKind.REFERENCE, f'{target} is not declared')

    def _once(self, place: Place, key: object) -> None:
        if f'{place.name} {key}' in self._said:
            self._damages.add(place.offset, place.name, DamageKind.DUPLICATE)
        self._said.add(f'{place.name} {key}')

    def _open_chunk(self, chunk: OpenChunk) -> None:
        offset = chunk.place.offset
        self._entries = {}
        self._expected[ChunkIndex, offset] = None  # of a damaged one nothing is known
        if chunk.damage is not None:
            return
        if chunk.notes or any(each.opcode not in IN_CHUNK for each in chunk.others):
            for each in chunk.walk():
                if each.damage is not None:
                    where = f'at byte {each.offset} of the unpacked chunk'
                    self._damages.add(offset, each.name, each.damage, where)
        for each in chunk.others:
            if each.opcode in IN_CHUNK:
                self._record(chunk.records, each, offset)
        self._entries = chunk.entries()
        for channel, of_channel in self._entries.items():
            self._count(channel, len(of_channel), offset)
        record, span = chunk.chunk, chunk.times_ns
        if record is None or chunk.place.damage is not None:
            return
        if not has_end(record):
            self._damages.add(offset, 'chunk', DamageKind.COMPRESSION)
        if span is not None:
            self._span(*span)
            stated = record.message_start_time, record.message_end_time
            if stated != span:
                text = f'times {stated}, in it are {span}'
                self._damages.add(offset, 'chunk', DamageKind.DISAGREES, text)
        self._chunk = chunk_index(record, offset, chunk.place.end - offset)
        self._expected[ChunkIndex, offset] = self._chunk

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
        add = self._damages.add
        if not self._ended:
            add(len(self._data), 'data_end', DamageKind.MISSING)
        footers = [(place, it) for place, it in self._summary if isinstance(it, Footer)]
        if not footers:
            add(len(self._data), 'footer', DamageKind.MISSING)
            return
        (place, footer), start = footers[0], footers[0][1].summary_start
        if start == 0:
            add(place.offset, 'summary', DamageKind.MISSING)
            return
        if footer.summary_crc not in (0, checksum(self._data, start, place.end - 4)):
            add(place.offset, 'summary', DamageKind.CHECKSUM)
        if start != self._ended:
            text = f'it begins at {self._ended}, not {start}'
            add(place.offset, 'summary', DamageKind.MISPLACED, text)
        stated = {(type(record), _key(record)) for _, record in self._summary}
        self._expect_totals(stated)
        for place, record in self._summary:
            self._once(place, _key(record))
            self._compare(place, record)
        kinds = {kind for kind, _ in stated}
        for kind, name in _LISTED.items():
            if kind in _DECLARED and kind not in kinds:
                continue  # none at all is a choice of the writer
            here = {key for key in self._expected.keys() - stated if key[0] is kind}
            for _, key in sorted(here, key=itemgetter(1)):
                text = '' if kind is Statistics else f'of {key}'
                at = self._ended if kind in (*_DECLARED, Statistics) else key
                add(at, name, DamageKind.MISSING, text)

    def _expect_totals(self, stated: set[tuple[type, int]]) -> None:
        """Expect what the summary says of all records, and of itself."""
        # a topic without messages may be declared in the summary alone
        declared = {key for key in stated if key[0] in _DECLARED}
        kinds = Counter(kind for kind, _ in self._expected.keys() | declared)
        self._expected[Statistics, 0] = statistics(kinds, self.counts, self._times_ns)
        begin: dict[int, int] = {}
        for place, _ in self._summary:
            first = begin.setdefault(place.opcode, place.offset)
            self._expected[SummaryOffset, place.opcode] = SummaryOffset(
                place.opcode, first, place.end - first
            )

    def _compare(self, place: Place, stated: Any) -> None:
        key = type(stated), _key(stated)
        if isinstance(stated, Footer) or (key not in self._expected and key[0] in _DECLARED):
            return
        actual = self._expected.get(key, ())
        kind, text = DamageKind.DISAGREES, f'{stated}, in the data {actual}'
        if isinstance(stated, Statistics):
            counts = {number: n for number, n in stated.channel_message_counts.items() if n}
            stated = replace(
                stated, channel_message_counts=counts or actual.channel_message_counts
            )
            text = f'{stated}, in the data {actual}'
        elif isinstance(stated, SummaryOffset):
            kind, text = DamageKind.MISPLACED, ''
            actual = actual if stated.group_length else None
        elif actual == ():
            kind, text = DamageKind.MISPLACED, f'nothing of that kind is at byte {key[1]}'
        if actual not in (None, stated):  # of a damaged chunk nothing is known
            self._damages.add(place.offset, place.name, kind, text)


def _key(record: Any) -> int:
    """Return what a record of the summary is about: a number, or a place."""
    for name in ('id', 'chunk_start_offset', 'offset', 'group_opcode'):
        if hasattr(record, name):
            return int(getattr(record, name))
    return 0


def _sorted(entries: Int64) -> Int64:
    return entries[np.lexsort(entries.T)]
