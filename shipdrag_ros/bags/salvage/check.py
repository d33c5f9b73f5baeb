# SPDX-License-Identifier: Apache-2.0
"""
Is a bag sound: every byte accounted for, every checksum right, every statement true.

One pass over the data gathers what is there; then what the summary states is
held against it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode

from shipdrag_ros.bags.locate import locate
from shipdrag_ros.bags.records import (
    MAGIC,
    MESSAGE_HEAD,
    Buffer,
    attachment_agrees,
    checksum,
    chunk_fields,
)
from shipdrag_ros.bags.salvage.damage import Damage, DamageKind, DamageList
from shipdrag_ros.bags.salvage.layout import KNOWN, name
from shipdrag_ros.bags.salvage.scan import GARBAGE, MAGIC_PLACE, ScannedRecord, Scanner, found_name
from shipdrag_ros.bags.salvage.statements import ChunkFacts, DataContents, hold_against
from shipdrag_ros.bags.salvage.unpack import Unpacked, opened, unpack_chunk_partly
from shipdrag_ros.bags.salvage.whole_chunk import WholeChunk, read_whole
from shipdrag_ros.errors import BagError
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import Int64

_INDEX_HEAD = struct.Struct('<HI')  # channel, bytes of the entries
_NO_ENTRIES = np.empty((0, 2), np.int64)
_InChunk = dict[int, Int64]  # log times [ns] and offsets, (n, 2), by channel


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
    found = []
    for bag in [bag for path in paths for bag in locate(path)]:
        found += [_check_file(file, progress) for file in bag.files]
        found += [
            FileCheck(Path(bag.name), 0, 0, (Damage(0, 'file', DamageKind.MISSING, warning),), 1)
            for warning in bag.warnings
        ]
    return found


def _check_file(path: Path, progress: PartDone) -> FileCheck:
    damages = DamageList()
    with opened(path, damages) as data:
        if not data:
            return FileCheck(path, 0, 0, tuple(damages.listed), damages.count)
        walk = _FilePass(data, damages)
        walk.run(progress)
        if not walk.records and data[: len(MAGIC)] != MAGIC:
            raise BagError(
                f'{str(path)!r} is no MCAP file, it begins with {data[:8]!r}; '
                'give a .mcap file or a rosbag2 directory'
            )
        hold_against(data, walk.facts, damages)
        return FileCheck(
            path=path,
            size_bytes=len(data),
            messages=walk.facts.counts.total(),
            damage=tuple(sorted(damages.listed, key=lambda damage: damage.offset)),
            damage_count=damages.count,
        )


class _FilePass:
    """One pass over a file."""

    def __init__(self, data: Buffer, damages: DamageList) -> None:
        self.facts = DataContents()
        self.records = 0
        self._data = data
        self._damages = damages
        self._scanner = Scanner()
        self._chunk: ChunkFacts | None = None
        self._in_chunk: _InChunk = {}
        self._indexed: set[int] = set()
        self._said: set[str] = set()

    def run(self, progress: PartDone) -> None:
        """Gather what is there."""
        data = self._data
        damages = self._damages
        if data[: len(MAGIC)] != MAGIC:
            damages.add(0, 'magic', DamageKind.MISSING, f'{data[:8]!r}')
        elif data[len(MAGIC) : len(MAGIC) + 1] != bytes([Opcode.HEADER]):
            damages.add(len(MAGIC), 'header', DamageKind.MISSING)
        if data[-len(MAGIC) :] != MAGIC:
            damages.add(len(data), 'magic', DamageKind.MISSING, 'not closed, or cut off')
        for found in self._scanner.walk(data, 0, len(data)):
            if found.opcode == MAGIC_PLACE:
                if 0 < found.offset < len(data) - len(MAGIC):
                    damages.add(found.offset, 'magic', DamageKind.MISPLACED)
                continue
            if self._chunk is not None and found.opcode != Opcode.MESSAGE_INDEX:
                self._close_chunk()
            if found.damage is not None:
                damages.add(found.offset, found_name(data, found), found.damage)
            if found.opcode == GARBAGE or found.damage is DamageKind.CONTENT:
                continue
            self.records += 1
            if found.opcode == Opcode.CHUNK:
                progress(found.offset, len(data))
                self._open_chunk(found)
            else:
                self._record(data, found, found.offset)
        if self._chunk is not None:
            self._close_chunk()

    def _record(self, data: Buffer, found: ScannedRecord, offset: int) -> None:
        facts = self.facts
        match found.opcode:
            case Opcode.MESSAGE:
                channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(data, found.start)
                self._messages(channel, [log_ns], offset)
            case Opcode.MESSAGE_INDEX:
                self._message_index(found)
            case Opcode.SCHEMA | Opcode.CHANNEL if data is not self._data or not facts.ended:
                self._declaration(found.read(data), found.opcode, offset)
            case Opcode.ATTACHMENT:
                facts.attachments[offset] = found.end - found.offset
                if not attachment_agrees(data, found.start, found.end):
                    self._damages.add(offset, 'attachment', DamageKind.CHECKSUM)
            case Opcode.METADATA:
                facts.metadata[offset] = found.end - found.offset
            case Opcode.DATA_END:
                self._once(found)
                facts.ended = facts.ended or found.end
                stated_end = found.read(data).data_section_crc
                if stated_end and stated_end != checksum(data, 0, offset):
                    self._damages.add(offset, 'data_end', DamageKind.CHECKSUM)
            case Opcode.HEADER | Opcode.FOOTER | Opcode.STATISTICS:
                self._once(found)
                facts.summary.append(found)
            case _ if found.opcode in KNOWN:
                facts.summary.append(found)

    def _once(self, found: ScannedRecord) -> None:
        kind = name(found.opcode)
        if kind in self._said:
            self._damages.add(found.offset, kind, DamageKind.DUPLICATE)
        self._said.add(kind)

    def _messages(self, channel: int, log_ns: list[int], offset: int) -> None:
        self.facts.count(channel, log_ns)
        if channel not in self.facts.channels:
            self._reference(offset, 'message', f'channel {channel}')

    def _declaration(self, record: Any, opcode: int, offset: int) -> None:
        known = self.facts.schemas if opcode == Opcode.SCHEMA else self.facts.channels
        if known.setdefault(record.id, record) != record:
            self._damages.add(offset, name(opcode), DamageKind.DISAGREES, f'number {record.id}')
        if opcode == Opcode.CHANNEL and record.schema_id not in (0, *self.facts.schemas):
            self._reference(offset, 'channel', f'schema {record.schema_id}')

    def _reference(self, offset: int, record: str, target: str) -> None:
        """Say once what is not there; a thousand messages may refer to it."""
        if target not in self._said:
            self._said.add(target)
            self._damages.add(offset, record, DamageKind.REFERENCE, f'{target} is not declared')

    def _open_chunk(self, found: ScannedRecord) -> None:
        data = self._data
        unpacked = unpack_chunk_partly(data, found.start, found.end)
        if unpacked.damage is not None and unpacked.damage is not found.damage:
            self._damages.add(found.offset, 'chunk', unpacked.damage)
        whole = read_whole(unpacked.records) if unpacked.damage is None else None
        if whole is None:
            self._in_chunk = self._walk_chunk(found, unpacked)
        else:
            self._in_chunk = self._take_chunk(found, unpacked.records, whole)
        self._indexed = set()
        if unpacked.damage is not None or found.damage is not None:
            self.facts.chunks[found.offset] = ChunkFacts(0, (0, 0), '', 0, 0, sound=False)
            return
        times = [entries[:, 0] for entries in self._in_chunk.values()]
        span = (int(min(map(np.min, times))), int(max(map(np.max, times)))) if times else (0, 0)
        head = data[found.start : found.start + 16]
        stated = int.from_bytes(head[:8], 'little'), int.from_bytes(head[8:], 'little')
        if times and stated != span:
            self._damages.add(
                found.offset, 'chunk', DamageKind.DISAGREES, f'times {stated}, in it are {span}'
            )
        size, _, compression, _, packed = chunk_fields(data, found.start, found.end)
        self._chunk = ChunkFacts(found.end - found.offset, stated, compression, packed, size)
        self.facts.chunks[found.offset] = self._chunk

    def _take_chunk(self, chunk: ScannedRecord, records: bytes, whole: WholeChunk) -> _InChunk:
        """Take note of all of a chunk at once."""
        for found in whole.declarations:
            self._record(records, self._scanner.noted(records, found), chunk.offset)
        in_chunk: _InChunk = {}
        for channel in np.unique(whole.channel).tolist():
            in_chunk[channel] = whole.entries[whole.channel == channel]
            self._messages(channel, in_chunk[channel][:, 0].tolist(), chunk.offset)
        return in_chunk

    def _walk_chunk(self, chunk: ScannedRecord, unpacked: Unpacked) -> _InChunk:
        """Take note of one record after the other, of what is left of a chunk."""
        records = unpacked.records
        in_chunk: dict[int, list[tuple[int, int]]] = {}
        for found in self._scanner.walk(records, 0, len(records), in_chunk=True):
            if found.damage is not None and (unpacked.damage is None or unpacked.verified):
                detail = f'at byte {found.offset} of the unpacked chunk'
                self._damages.add(chunk.offset, found_name(records, found), found.damage, detail)
            if found.opcode == GARBAGE or found.damage is DamageKind.CONTENT:
                continue
            self._record(records, found, chunk.offset)
            if found.opcode == Opcode.MESSAGE:
                channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(records, found.start)
                in_chunk.setdefault(channel, []).append((log_ns, found.offset))
        return {channel: np.array(entries) for channel, entries in in_chunk.items()}

    def _message_index(self, found: ScannedRecord) -> None:
        if self._chunk is None:
            return
        channel, length = _INDEX_HEAD.unpack_from(self._data, found.start)
        start = found.start + _INDEX_HEAD.size
        stated = np.frombuffer(self._data[start : start + length], '<i8').reshape(-1, 2)
        self._chunk.indexes[found.offset] = channel
        self._chunk.index_bytes += found.end - found.offset
        if channel in self._indexed:
            self._damages.add(found.offset, 'message_index', DamageKind.DUPLICATE)
        self._indexed.add(channel)
        actual = self._in_chunk.get(channel, _NO_ENTRIES)
        if not np.array_equal(_sorted(stated), _sorted(actual)):
            self._damages.add(
                found.offset, 'message_index', DamageKind.MISPLACED, f'channel {channel}'
            )

    def _close_chunk(self) -> None:
        missing = set(self._in_chunk) - self._indexed
        if self._indexed and missing:
            self._damages.add(
                min(self._chunk.indexes) if self._chunk else 0,
                'message_index',
                DamageKind.MISSING,
                f'channels {sorted(missing)}',
            )
        self._chunk = None


def _sorted(entries: Int64) -> Int64:
    return entries[np.lexsort(entries.T)]
