# SPDX-License-Identifier: Apache-2.0
"""
Schemas and channels of a damaged file, from whatever in it declares them.

A writer repeats them in the summary; what a checksum vouches for is believed
before what none does.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema

from shipdrag_ros.bags.records import (
    FOOTER_BYTES,
    HEAD,
    MAGIC,
    Buffer,
    checksum,
    read_record,
)
from shipdrag_ros.bags.salvage.layout import fits
from shipdrag_ros.bags.salvage.scan import Scanner

_CHECKSUM_BYTES = 4


def read_footer(data: Buffer) -> Footer | None:
    """
    Return the footer of a file; None where there is none at its end.
    """
    at = len(data) - FOOTER_BYTES
    start, end = at + HEAD.size, len(data) - len(MAGIC)
    if at < 0 or data[end:] != MAGIC or not fits(data, Opcode.FOOTER, start, end):
        return None
    if HEAD.unpack_from(data, at) != (Opcode.FOOTER, end - start):
        return None
    return read_record(data, Opcode.FOOTER, start, end)


def summary_checksum(data: Buffer, footer: Footer) -> int:
    """
    Return the CRC-32 of a summary, which covers the footer up to the stated one.
    """
    return checksum(data, footer.summary_start, len(data) - len(MAGIC) - _CHECKSUM_BYTES)


class Trust(IntEnum):
    """How far a declaration is believed."""

    DOUBTFUL = 0
    READ = 1
    VERIFIED = 2


@dataclass
class Learnt:
    """
    What is known of schemas and channels.

    Attributes
    ----------
    channels, schemas
        By number.
    missed
        What was asked for in vain, `channel 3` for instance.
    """

    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    missed: set[str] = field(default_factory=set)
    _trust: dict[tuple[type, int], Trust] = field(default_factory=dict)

    def learn_summary(self, data: Buffer) -> None:
        """
        Learn what the summary of a file repeats, if its checksum is right.
        """
        footer = read_footer(data)
        if footer is None or not 0 < footer.summary_start < len(data) or not footer.summary_crc:
            return
        if summary_checksum(data, footer) != footer.summary_crc:
            return
        for found in Scanner().walk(data, footer.summary_start, len(data) - FOOTER_BYTES):
            if found.damage is None and found.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self.add(found.read(data), Trust.VERIFIED)

    def add(self, record: Schema | Channel, trust: Trust) -> bool:
        """
        Learn a declaration; False where one believed as much or more differs.
        """
        known: dict[int, Any] = self.schemas if isinstance(record, Schema) else self.channels
        key = type(record), record.id
        before = self._trust.get(key)
        agrees = before is None or known[record.id] == record
        if before is None or (trust > before and not agrees):
            known[record.id] = record
        if before is None or trust > before:
            self._trust[key] = trust
        return agrees or before is None or trust > before

    def channel(self, number: int) -> Channel | None:
        """
        Return a channel; None, and note that it is missed, where none is known.
        """
        channel = self.channels.get(number)
        if channel is None:
            self.missed.add(f'channel {number}')
        return channel

    def schema(self, number: int) -> Schema | None:
        """
        Return a schema; None, and note that it is missed, where none is known.
        """
        schema = self.schemas.get(number)
        if schema is None:
            self.missed.add(f'schema {number}')
        return schema

    def found_later(self) -> bool:
        """
        Say whether something that was missed is known now.
        """
        known = {f'channel {number}' for number in self.channels}
        known |= {f'schema {number}' for number in self.schemas}
        return bool(self.missed & known)
