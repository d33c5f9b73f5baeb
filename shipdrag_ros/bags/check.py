# SPDX-License-Identifier: Apache-2.0
"""
Is a bag sound: every byte accounted for, every checksum right, every statement true.

One pass over the data makes the index that there should be; then what the summary
states is compared with it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap import records as mcap
from mcap.opcode import Opcode

from shipdrag_ros.bags import records
from shipdrag_ros.bags.contents import DECLARED, INDEXES, FileSummary, key_of
from shipdrag_ros.bags.mcap_file import locate, not_mcap
from shipdrag_ros.bags.records import MAGIC, Buffer, Damage, DamageKind, DamageList, OpenChunk
from shipdrag_ros.bags.recover import opened
from shipdrag_ros.display import printable
from shipdrag_ros.errors import BagError
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import Int64


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
        return FileCheck(path, len(data), facts.messages, damage, damages.count)


class _Facts:
    """What is in the data of a file, and what its summary states."""

    def __init__(self, data: Buffer, damages: DamageList) -> None:
        self.records = 0
        self._data = data
        self._damages = damages
        self._add = damages.add
        self._expected = FileSummary()
        self._summary: list[tuple[records.Place, Any]] = []
        self._ended = 0
        self._chunk: mcap.ChunkIndex | None = None  # whose message indexes may follow
        self._entries: dict[int, Int64] = {}  # of it: log times [ns] and offsets, by channel
        self._said: set[object] = set()

    @property
    def messages(self) -> int:
        """Whole messages in it."""
        return self._expected.counts.total()

    def gather(self, progress: PartDone) -> None:
        """Walk over the file."""
        data, begin = self._data, len(MAGIC)
        if data[:begin] == MAGIC and data[begin : begin + 1] != bytes([Opcode.HEADER]):
            self._add(begin, 'header', DamageKind.MISSING)
        if data[-begin:] != MAGIC:
            self._add(len(data), 'magic', DamageKind.MISSING, 'not closed, or cut off')
        for place, item, _ in records.scan(data, self._damages):
            if place.opcode != Opcode.MESSAGE_INDEX:
                self._close_chunk()
            if not place.readable:
                continue
            self.records += 1
            if isinstance(item, OpenChunk):
                progress(place.offset, len(data))
                self._open_chunk(item)
            elif place.opcode == Opcode.MESSAGE:
                channel, _, log_ns, _ = records.MESSAGE_HEAD.unpack_from(data, place.start)
                self._count({channel: 1}, place.offset, (log_ns, log_ns))
            elif place.opcode == Opcode.MESSAGE_INDEX:
                self._message_index(place)
            else:
                self._item(item, place, place.offset)
        self._close_chunk()

    def _item(self, item: Any, place: records.Place, offset: int) -> None:
        """Take note of a record, in a file or in a chunk that lies at the offset."""
        match item:
            case mcap.Schema() | mcap.Channel() if not self._ended:
                if not self._expected.add(item):
                    self._add(offset, place.name, DamageKind.DISAGREES, f'number {item.id}')
                if isinstance(item, mcap.Channel) and item.schema_id:
                    self._refers(offset, place.name, mcap.Schema, item.schema_id)
            case mcap.Attachment() | mcap.Metadata():
                self._expected.add_indexed(item, *place.span)
            case mcap.DataEnd():
                self._once(place)
                self._ended = self._ended or place.end
                if not records.agrees(self._data, 0, offset, item.data_section_crc):
                    self._add(offset, place.name, DamageKind.CHECKSUM)
            case mcap.Header():
                self._once(place)
            case None:
                pass
            case _:
                self._summary.append((place, item))

    def _count(self, counts: dict[int, int], offset: int, times_ns: tuple[int, int]) -> None:
        self._expected.count(counts, *times_ns)
        for channel in counts:
            self._refers(offset, 'message', mcap.Channel, channel)

    def _refers(self, offset: int, record: str, kind: type, number: int) -> None:
        """Say once what is not there; a thousand messages may refer to it."""
        key = kind, number
        if key not in self._expected.records and key not in self._said:
            self._said.add(key)
            text = f'{kind.__name__.lower()} {number} is not declared'
            self._add(offset, record, DamageKind.REFERENCE, text)

    def _once(self, place: records.Place, key: object = None) -> None:
        if (place.name, key) in self._said:
            self._add(place.offset, place.name, DamageKind.DUPLICATE)
        self._said.add((place.name, key))

    def _open_chunk(self, chunk: OpenChunk) -> None:
        offset = chunk.place.offset
        self._entries = {}
        self._expected.records[mcap.ChunkIndex, offset] = None  # of a damaged one nothing is known
        if chunk.damage is not None:
            return
        for place, item, _ in chunk.scan(self._damages, sound=True):
            self._item(item, place, offset)
        self._entries, times_ns = chunk.entries(), chunk.times_ns
        if times_ns is not None:
            self._count({it: len(each) for it, each in self._entries.items()}, offset, times_ns)
        if chunk.chunk is None or chunk.place.damage is not None:
            return
        if not chunk.ended:
            self._add(offset, 'chunk', DamageKind.COMPRESSION)
        self._chunk = self._expected.add_indexed(chunk.chunk, *chunk.place.span)
        stated = chunk.chunk.message_start_time, chunk.chunk.message_end_time
        if times_ns not in (None, stated):
            text = 'times {} to {} ns, in it are {} to {} ns'.format(*stated, *times_ns)
            self._add(offset, 'chunk', DamageKind.DISAGREES, text)

    def _message_index(self, place: records.Place) -> None:
        if self._chunk is None:
            return
        offset = place.offset
        channel = int.from_bytes(self._data[place.start : place.start + 2], 'little')
        if channel in self._chunk.message_index_offsets:
            self._add(offset, place.name, DamageKind.DUPLICATE)
        self._chunk.message_index_offsets[channel] = offset
        self._chunk.message_index_length += place.end - offset
        listed = self._data[place.start + 6 : place.end]
        stated = np.frombuffer(listed, np.int64, len(listed) // 16 * 2).reshape(-1, 2)
        actual = self._entries.get(channel, stated[:0])
        one, other = (each[np.lexsort(each.T)] for each in (stated, actual))
        if not np.array_equal(one, other):
            self._add(offset, place.name, DamageKind.MISPLACED, f'channel {channel}')

    def _close_chunk(self) -> None:
        chunk, self._chunk = self._chunk, None
        if chunk is not None and chunk.message_index_offsets:
            missing = sorted(set(self._entries) - set(chunk.message_index_offsets))
            if missing:
                offset = chunk.chunk_start_offset + chunk.chunk_length
                text = f'of channels {", ".join(map(str, missing))}'
                self._add(offset, 'message_index', DamageKind.MISSING, text)

    def compare(self) -> None:
        """Compare the summary with what is there."""
        add, expected, end = self._add, self._expected, len(self._data)
        if not self._ended:
            add(end, 'data_end', DamageKind.MISSING)
        footers = [(place, it) for place, it in self._summary if isinstance(it, mcap.Footer)]
        if not footers:
            add(end, 'footer', DamageKind.MISSING)
            return
        (place, footer), start = footers[0], footers[0][1].summary_start
        if start == 0:
            add(place.offset, 'summary', DamageKind.MISSING)
            return
        if not records.agrees(self._data, start, place.end - 4, footer.summary_crc):
            add(place.offset, 'summary', DamageKind.CHECKSUM)
        if start != self._ended:
            text = f'it begins at {self._ended}, not {start}'
            add(place.offset, 'summary', DamageKind.MISPLACED, text)
        stated = {key_of(record) for _, record in self._summary}
        self._expect_totals()
        for place, record in self._summary:
            self._once(place, key_of(record)[1])
            self._compare(place, record)
        kinds = {kind for kind, _ in stated}  # no declaration at all is a choice of the writer
        for kind in (*(it for it in DECLARED if it in kinds), *INDEXES, mcap.Statistics):
            for key in sorted(at for it, at in expected.records.keys() - stated if it is kind):
                text = '' if kind is mcap.Statistics else f'of {key}'
                add(key if kind in INDEXES else self._ended, _name(kind), DamageKind.MISSING, text)

    def _expect_totals(self) -> None:
        """Expect what the summary says of all records, and of itself."""
        begin: dict[int, int] = {}
        for place, record in self._summary:
            if isinstance(record, DECLARED):  # a topic without messages may be declared here alone
                self._expected.add(record)
            first = begin.setdefault(place.opcode, place.offset)
            offset = mcap.SummaryOffset(place.opcode, first, place.end - first)
            self._expected.records[key_of(offset)] = offset
        self._expected.add(self._expected.statistics())

    def _compare(self, place: records.Place, stated: Any) -> None:
        key = key_of(stated)
        actual = self._expected.records.get(key, ())
        kind, text = DamageKind.DISAGREES, None
        match stated:
            case mcap.Footer():
                return
            case mcap.Statistics():
                counts = {number: n for number, n in stated.channel_message_counts.items() if n}
                counts = counts or actual.channel_message_counts
                stated = replace(stated, channel_message_counts=counts)
            case mcap.SummaryOffset():
                kind, text = DamageKind.MISPLACED, ''
                actual = actual if stated.group_length else None
            case _ if actual == ():
                kind, text = DamageKind.MISPLACED, f'nothing of that kind is at byte {key[1]}'
        if actual not in (None, stated):  # of a damaged chunk nothing is known
            differs = _difference(stated, actual) if text is None else text
            self._add(place.offset, place.name, kind, differs)


def _difference(stated: Any, actual: Any) -> str:
    """Say in which parts two records of a kind differ, and how."""
    said = []
    for each in fields(stated):
        one, other = getattr(stated, each.name), getattr(actual, each.name)
        name = each.name.replace('_', ' ')
        if one != other and isinstance(one, dict):
            numbers = sorted({key for key, _ in one.items() ^ other.items()})
            said.append(f'{name} of {", ".join(map(str, numbers))}')
        elif one != other:
            shown = name if isinstance(one, bytes) else f'{name} {one}, in the data {other}'
            said.append(shown)
    return printable('; '.join(said))


def _name(kind: type) -> str:
    """Return the name of a kind of records, as in the specification."""
    return re.sub('(?<!^)(?=[A-Z])', '_', kind.__name__).lower()
