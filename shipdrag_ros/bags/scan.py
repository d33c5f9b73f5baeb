# SPDX-License-Identifier: Apache-2.0
"""
One pass over a file that may be damaged: its records in order, chunks with their messages.

What reads a bag without an index, checks it or saves it, begins here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Chunk

from shipdrag_ros.bags.message_index import EVERY_CHANNEL, Messages, index_messages
from shipdrag_ros.bags.records import (
    HEAD,
    IN_CHUNK,
    MAGIC,
    MESSAGE_HEAD,
    Buffer,
    DamageKind,
    DamageList,
    Place,
    place_at,
    unpack,
    walk,
)
from shipdrag_ros.samples import Int64


class OpenChunk(NamedTuple):
    """
    A chunk and what is in it.

    Attributes
    ----------
    place
        Of the chunk in the file.
    chunk, records, damage, verified
        As of `records.Unpacked`.
    messages
        Up to the first damage in the records.
    others
        Places in `records` that hold something else, up to the same.
    notes
        A sentence where the records are not whole.
    """

    place: Place
    chunk: Chunk | None
    records: bytes
    damage: DamageKind | None
    verified: bool
    messages: Messages
    others: tuple[Place, ...]
    notes: list[str]

    @property
    def sound(self) -> bool:
        """Whether neither the chunk nor where it ends is in doubt."""
        return self.damage is None and self.place.damage is None

    @property
    def times_ns(self) -> tuple[int, int] | None:
        """First and last log time [ns]; None without messages."""
        times_ns = self.messages.log_ns
        return (int(times_ns.min()), int(times_ns.max())) if len(times_ns) else None

    def entries(self) -> dict[int, Int64]:
        """
        Return what an index lists: log time [ns] and offset, (n, 2), by channel.
        """
        channel = self.messages.channel
        offsets = self.messages.start - (HEAD.size + MESSAGE_HEAD.size)
        listed = np.column_stack((self.messages.log_ns, offsets))
        return {number: listed[channel == number] for number in np.unique(channel).tolist()}

    def walk(self) -> Iterator[Place]:
        """
        Yield what lies in the records, behind damages too.
        """
        return walk(self.records, 0, len(self.records), IN_CHUNK)


def scan(
    data: Buffer, damages: DamageList, *, partly: bool = False
) -> Iterator[tuple[Place, OpenChunk | None]]:
    """
    Yield what lies in a file, without a gap, and of a chunk what is in it.

    Parameters
    ----------
    data
        The file.
    damages
        Where is noted what is damaged.
    partly
        Whether damaged chunks are unpacked as far as can be.
    """
    begin = len(MAGIC) if data[: len(MAGIC)] == MAGIC else 0
    if not begin:
        damages.add(0, 'magic', DamageKind.MISSING, f'{data[:8]!r}')
    for place in walk(data, begin, len(data)):
        if place.damage is not None:
            damages.add(place.offset, place.name, place.damage)
        if place.opcode != Opcode.CHUNK or place.start == place.offset:
            yield place, None
            continue
        chunk, records, damage, verified = unpack(data, place, partly=partly)
        # of a chunk that cannot be read it matters only to those who unpack what is left of it
        if damage not in (None, place.damage) and (partly or place.readable):
            damages.add(place.offset, place.name, damage)
        messages, others, notes = index_messages([records], [place.offset], EVERY_CHANNEL)
        inside = tuple(place_at(records, at) for at in others.tolist())
        yield place, OpenChunk(place, chunk, records, damage, verified, messages, inside, notes)
