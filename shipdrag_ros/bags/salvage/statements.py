# SPDX-License-Identifier: Apache-2.0
"""
What the summary of a file states, held against what is in its data.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

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

from shipdrag_ros.bags.records import FOOTER_BYTES, Buffer
from shipdrag_ros.bags.salvage.damage import DamageKind, DamageList
from shipdrag_ros.bags.salvage.layout import name
from shipdrag_ros.bags.salvage.learnt import read_footer, summary_checksum
from shipdrag_ros.bags.salvage.scan import ScannedRecord


@dataclass
class ChunkFacts:
    """
    A chunk as it is.

    Attributes
    ----------
    length
        Of the whole record [bytes].
    times
        First and last log time [ns].
    compression, packed, size
        How it is packed, and bytes packed and unpacked.
    sound
        Whether it is as it was written.
    indexes
        Channels of the message indexes behind it, by offset.
    index_bytes
        Length of these.
    """

    length: int
    times: tuple[int, int]
    compression: str
    packed: int
    size: int
    sound: bool = True
    indexes: dict[int, int] = field(default_factory=dict)
    index_bytes: int = 0


@dataclass
class DataContents:
    """
    What is in the data of a file.

    Attributes
    ----------
    schemas, channels
        Declared in the data, by number.
    counts
        Messages by channel.
    first_ns, last_ns
        Log times [ns].
    chunks, attachments, metadata
        By offset: what a chunk is, and the lengths of the records.
    ended
        Where the data section ends [bytes], 0 where nothing says it.
    summary
        Records that state something, as found.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    first_ns: int = 0
    last_ns: int = 0
    chunks: dict[int, ChunkFacts] = field(default_factory=dict)
    attachments: dict[int, int] = field(default_factory=dict)
    metadata: dict[int, int] = field(default_factory=dict)
    ended: int = 0
    summary: list[ScannedRecord] = field(default_factory=list)

    def count(self, channel: int, log_ns: list[int]) -> None:
        """
        Take note of messages of a channel, by their log times [ns].
        """
        first_ns = min(log_ns)
        self.first_ns = min(first_ns, self.first_ns) if self.counts else first_ns
        self.last_ns = max(*log_ns, self.last_ns)
        self.counts[channel] += len(log_ns)


def hold_against(data: Buffer, facts: DataContents, damages: DamageList) -> None:
    """
    Note what the end of a file states wrongly, or leaves out.
    """
    footer = read_footer(data)
    if not facts.ended:
        damages.add(len(data), 'data_end', DamageKind.MISSING)
    if footer is None:
        damages.add(len(data), 'footer', DamageKind.MISSING)
    records = [(found, found.read(data)) for found in facts.summary]
    stated = [each for each in records if not isinstance(each[1], Footer)]
    after = [found.offset for found, _ in stated if facts.ended and found.offset >= facts.ended]
    if not after:
        damages.add(facts.ended or len(data), 'summary', DamageKind.MISSING)
    if footer is not None:
        _footer(data, facts, footer, after, damages)
    if not after:
        return
    _Statements(facts, stated, damages).run()


def _footer(
    data: Buffer, facts: DataContents, footer: Footer, after: list[int], damages: DamageList
) -> None:
    at = len(data) - FOOTER_BYTES
    begin = min(after, default=0)
    if footer.summary_start != begin and facts.ended:
        damages.add(
            at, 'footer', DamageKind.MISPLACED, f'summary at {footer.summary_start}, not {begin}'
        )
    if (
        footer.summary_crc
        and 0 < footer.summary_start < at
        and summary_checksum(data, footer) != footer.summary_crc
    ):
        damages.add(footer.summary_start, 'summary', DamageKind.CHECKSUM)
    offsets = [
        found.offset
        for found in facts.summary
        if found.opcode == Opcode.SUMMARY_OFFSET and found.damage is None
    ]
    # a writer without anything to offer may still state where it would be
    if footer.summary_offset_start not in (0, *offsets[:1], *([] if offsets else [at])):
        damages.add(
            at,
            'footer',
            DamageKind.MISPLACED,
            f'summary offsets at {footer.summary_offset_start}',
        )


class _Statements:
    def __init__(
        self, facts: DataContents, records: list[tuple[ScannedRecord, Any]], damages: DamageList
    ) -> None:
        self._facts = facts
        self._records = records
        self._damages = damages
        self._seen: dict[int, set[int]] = {}
        self._groups: dict[int, list[ScannedRecord]] = {}

    def run(self) -> None:
        """Hold each record against the facts, then say what no record states."""
        for found, record in self._records:
            if found.opcode != Opcode.HEADER:
                self._groups.setdefault(found.opcode, []).append(found)
            match record:
                case Schema():
                    self._declaration(found, record, self._facts.schemas)
                case Channel():
                    self._declaration(found, record, self._facts.channels)
                case ChunkIndex():
                    self._chunk(found, record)
                case AttachmentIndex():
                    self._place(found, record, self._facts.attachments)
                case MetadataIndex():
                    self._place(found, record, self._facts.metadata)
        for found, record in self._records:
            match record:
                case Statistics():
                    self._statistics(found, record)
                case SummaryOffset():
                    self._summary_offset(found, record)
        self._complete()

    def _declaration(
        self, found: ScannedRecord, record: Schema | Channel, known: dict[int, Any]
    ) -> None:
        self._once(found, record.id)
        if known.get(record.id, record) != record:
            self._wrong(found, DamageKind.DISAGREES, f'number {record.id} differs in the data')

    def _chunk(self, found: ScannedRecord, index: ChunkIndex) -> None:
        self._once(found, index.chunk_start_offset)
        facts = self._facts.chunks.get(index.chunk_start_offset)
        if facts is None:
            self._wrong(found, DamageKind.MISPLACED, f'no chunk at {index.chunk_start_offset}')
            return
        if not facts.sound:  # what is stated of it would only repeat that
            return
        stated = (
            index.chunk_length,
            (index.message_start_time, index.message_end_time),
            index.compression,
            index.compressed_size,
            index.uncompressed_size,
        )
        actual = facts.length, facts.times, facts.compression, facts.packed, facts.size
        if stated != actual:
            self._wrong(found, DamageKind.DISAGREES, f'{stated}, the chunk is {actual}')
        wanted = {offset: channel for channel, offset in index.message_index_offsets.items()}
        if wanted != facts.indexes or index.message_index_length != facts.index_bytes:
            self._wrong(found, DamageKind.MISPLACED, 'message indexes')

    def _place(
        self, found: ScannedRecord, index: AttachmentIndex | MetadataIndex, known: dict[int, int]
    ) -> None:
        self._once(found, index.offset)
        if known.get(index.offset) != index.length:
            self._wrong(
                found, DamageKind.MISPLACED, f'{index.name!r} is not at byte {index.offset}'
            )

    def _statistics(self, found: ScannedRecord, stated: Statistics) -> None:
        facts = self._facts
        # a topic without messages may be stated in the summary alone
        schemas = set(facts.schemas) | self._seen.get(Opcode.SCHEMA, set())
        channels = set(facts.channels) | self._seen.get(Opcode.CHANNEL, set())
        pairs = {
            'messages': (stated.message_count, facts.counts.total()),
            'schemas': (stated.schema_count, len(schemas)),
            'channels': (stated.channel_count, len(channels)),
            'attachments': (stated.attachment_count, len(facts.attachments)),
            'metadata': (stated.metadata_count, len(facts.metadata)),
            'chunks': (stated.chunk_count, len(facts.chunks)),
            'first time': (stated.message_start_time, facts.first_ns),
            'last time': (stated.message_end_time, facts.last_ns),
        }
        counts = Counter({k: n for k, n in stated.channel_message_counts.items() if n})
        wrong = [
            f'{what} {said}, are {true}' for what, (said, true) in pairs.items() if said != true
        ]
        if counts and counts != facts.counts:
            wrong.append('messages of the channels')
        if wrong:
            self._wrong(found, DamageKind.DISAGREES, '; '.join(wrong))

    def _summary_offset(self, found: ScannedRecord, stated: SummaryOffset) -> None:
        group = self._groups.get(stated.group_opcode, [])
        if not group and stated.group_length == 0:
            return
        actual = (group[0].offset, group[-1].end - group[0].offset) if group else (0, 0)
        if (stated.group_start, stated.group_length) != actual:
            self._wrong(found, DamageKind.MISPLACED, f'group of {name(stated.group_opcode)}')

    def _complete(self) -> None:
        facts = self._facts
        if Opcode.STATISTICS not in self._groups:
            self._damages.add(facts.ended, 'statistics', DamageKind.MISSING)
        for opcode, present in (
            (Opcode.CHUNK_INDEX, facts.chunks),
            (Opcode.ATTACHMENT_INDEX, facts.attachments),
            (Opcode.METADATA_INDEX, facts.metadata),
        ):
            for offset in sorted(set(present) - self._seen.get(opcode, set())):
                self._damages.add(
                    offset, name(opcode), DamageKind.MISSING, f'for the record at byte {offset}'
                )
        for opcode, declared in (
            (Opcode.SCHEMA, facts.schemas),
            (Opcode.CHANNEL, facts.channels),
        ):
            seen = self._seen.get(opcode, set())
            missing = sorted(set(declared) - seen)
            if seen and missing:  # none at all is a choice of the writer
                self._damages.add(
                    facts.ended, name(opcode), DamageKind.MISSING, f'{missing} in the summary'
                )

    def _once(self, found: ScannedRecord, key: int) -> None:
        seen = self._seen.setdefault(found.opcode, set())
        if key in seen:
            self._wrong(found, DamageKind.DUPLICATE, '')
        seen.add(key)

    def _wrong(self, found: ScannedRecord, kind: DamageKind, detail: str) -> None:
        self._damages.add(found.offset, name(found.opcode), kind, detail)
