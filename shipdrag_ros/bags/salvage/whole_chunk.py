# SPDX-License-Identifier: Apache-2.0
"""
What is in a chunk, found in compiled code where no record of it is amiss.

The scanner, which finds its way through damaged ones, looks at one after the
other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from shipdrag_ros.bags.message_index import CHANNELS, Messages, index_messages
from shipdrag_ros.bags.records import HEAD, MESSAGE_HEAD
from shipdrag_ros.bags.salvage.layout import fills
from shipdrag_ros.bags.salvage.scan import ScannedRecord
from shipdrag_ros.samples import Int64

_ALL = np.ones(CHANNELS, np.uint8)


class WholeChunk(NamedTuple):
    """
    Records of an unpacked chunk.

    Attributes
    ----------
    channel : (n,) uint16
        Of each message.
    entries : (n, 2) int64
        Log time [ns] and offset of each message, as message indexes have them.
    declarations
        Schemas and channels.
    """

    channel: NDArray[np.uint16]
    entries: Int64
    declarations: tuple[ScannedRecord, ...]

    def last_message(self, records: bytes) -> ScannedRecord:
        """
        Return the last message, of which there must be one.
        """
        at = int(self.entries[-1, 1])
        start = at + HEAD.size
        return ScannedRecord(Opcode.MESSAGE, at, start, start + HEAD.unpack_from(records, at)[1])


def read_whole(records: bytes) -> WholeChunk | None:
    """
    Find the records of an unpacked chunk; None where one is not as it should be.
    """
    messages, others, damage = index_messages([records], [0], _ALL)
    declarations = []
    for at in others.tolist():
        opcode, length = HEAD.unpack_from(records, at)
        start = at + HEAD.size
        declarations.append(ScannedRecord(opcode, at, start, start + length))
    if damage or not all(_is_in_place(records, each, messages) for each in declarations):
        return None
    offsets = messages.start - (HEAD.size + MESSAGE_HEAD.size)
    entries = np.column_stack((messages.log_ns, offsets))
    return WholeChunk(messages.channel, entries, tuple(declarations))


def _is_in_place(records: bytes, found: ScannedRecord, messages: Messages) -> bool:
    """Say whether a record is a schema, or a channel before its messages."""
    if found.opcode not in (Opcode.SCHEMA, Opcode.CHANNEL):
        return False
    if not fills(records, found.opcode, found.start, found.end):
        return False
    number = int.from_bytes(records[found.start : found.start + 2], 'little')
    of_channel = messages.start[messages.channel == number]
    return found.opcode == Opcode.SCHEMA or not (of_channel < found.offset).any()
