# SPDX-License-Identifier: Apache-2.0
"""
A walk over damaged records that does not end at the first damage.

Where the bytes are no record, the next place is sought at which a record is
plausible by itself: its fields fill it, its channel is known, its time is near.
A record is held back until something plausible follows, for a length that was
damaged shows only there.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from mcap.opcode import Opcode

from shipdrag_ros.bags.records import (
    HEAD,
    MAGIC,
    MESSAGE_HEAD,
    Buffer,
    attachment_agrees,
    read_record,
    release,
)
from shipdrag_ros.bags.salvage.damage import DamageKind
from shipdrag_ros.bags.salvage.layout import KNOWN, fields_end, fills, fits, name

MAGIC_PLACE = -1
"""Stands for an opcode where the magic bytes are."""
GARBAGE = 0
"""Stands for an opcode where nothing is a record."""

# a head: a known opcode, and a length below 2^32, as all but giants have
_HEAD = re.compile(rb'[\x01-\x0f](?=.{4}\0{4})', re.DOTALL)
_PRIVATE = 0x80
_POSSIBLE_BYTES = 1 << 40
_VOUCHED_TIMES = 4  # of its size; overlapping records, made on purpose, would cost its square
_SOUGHT_BYTES = 1 << 20  # but for those with a body; so that chance costs little
_NEAR_NS = 3600 * 10**9
_CHAIN = 3
# these carry a name, which no chance makes
_NAMED = frozenset((Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT, Opcode.CHUNK))
_WITH_BODY = frozenset((Opcode.MESSAGE, Opcode.CHUNK, Opcode.ATTACHMENT))
_IN_CHUNK = frozenset((Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE))


class ScannedRecord(NamedTuple):
    """
    A record, or what is left of one.

    Without `damage` it is as it should be, by its lengths. With it, the content
    is what can be said: of kind OPCODE or LENGTH it is whole, and what
    it is was inferred from its neighbours.
    """

    opcode: int
    offset: int
    start: int
    end: int
    damage: DamageKind | None = None

    def read(self, data: Buffer) -> Any:
        """
        Return it as a record of `mcap.records`.
        """
        return read_record(data, self.opcode, self.start, self.end)


def found_name(data: Buffer, found: ScannedRecord) -> str:
    """
    Name the kind of a record, by its opcode where that may be right.
    """
    if found.opcode == GARBAGE and found.damage is not DamageKind.GARBAGE:
        return name(data[found.offset])
    return name(found.opcode)


@dataclass
class Scanner:
    """
    Walks over a file, and over the unpacked chunks in it.

    Attributes
    ----------
    channels
        Numbers of the channels met; to be filled with what is known before.
    """

    channels: set[int] = field(default_factory=set)
    _log_ns: int | None = None
    _to_vouch: int = 0  # bytes that may still be read only to vouch for a length

    def walk(
        self, data: Buffer, start: int, end: int, *, in_chunk: bool = False
    ) -> Iterator[ScannedRecord]:
        """
        Yield what is found between two offsets, without a gap.

        Parameters
        ----------
        data
            A file, or an unpacked chunk.
        start, end
            Span to walk over [bytes].
        in_chunk
            Only kinds that may stand in a chunk are taken for records.
        """
        kinds = _IN_CHUNK if in_chunk else KNOWN
        self._to_vouch += _VOUCHED_TIMES * (end - start)
        at = start
        held: ScannedRecord | None = None
        while at < end:
            here = self._at(data, at, end, kinds)
            if here is None:
                held, here = self._damaged(data, at, end, kinds, held)
            if held is not None:
                yield self.noted(data, held)
                release(data, held.offset, held.end)
            held, at = here, here.end
        if held is not None:
            yield self.noted(data, held)

    def noted(self, data: Buffer, found: ScannedRecord) -> ScannedRecord:
        """
        Remember what separates a later record from chance; returns the record.
        """
        if found.damage is None:
            if found.opcode == Opcode.MESSAGE:
                self._log_ns = MESSAGE_HEAD.unpack_from(data, found.start)[2]
            elif found.opcode == Opcode.CHANNEL:
                self.channels.add(int.from_bytes(data[found.start : found.start + 2], 'little'))
        return found

    def _at(self, data: Buffer, at: int, end: int, kinds: frozenset[int]) -> ScannedRecord | None:
        """Return the record at an offset, if one begins there and fits."""
        if end - at < HEAD.size:
            return _magic(data, at, end)
        opcode, length = HEAD.unpack_from(data, at)
        start = at + HEAD.size
        if length > end - start:
            return _magic(data, at, end)
        stop = start + length
        fitting = fits(data, opcode, start, stop) if opcode in kinds else opcode >= _PRIVATE
        if fitting and (
            opcode == Opcode.MESSAGE
            or fills(data, opcode, start, stop)
            or not self._mended_opcodes(data, opcode, start, stop, kinds)
        ):
            return ScannedRecord(opcode, at, start, stop)
        return _magic(data, at, end)

    def _damaged(
        self, data: Buffer, at: int, end: int, kinds: frozenset[int], held: ScannedRecord | None
    ) -> tuple[ScannedRecord | None, ScannedRecord]:
        """
        Say what is at an offset where no record fits.

        Returns the record before, None where that one is the damaged one, and what the
        damaged bytes are.
        """
        for known_by in self._within_bounds, self._by_own_fields:
            here = known_by(data, at, end, kinds)
            if here is not None:
                return held, here
        if held is not None and self._is_unwitnessed(data, held):
            # its length may lead too far, or not far enough
            sought = self._sought_in(data, held.offset, end, kinds)
            after = self._resync(data, held.offset + 1, at, end, sought)
            if after is not None:
                return None, self._span(data, held.offset, after, end, kinds)
        after = self._resync(data, at + 1, end, end, self._sought_in(data, at, end, kinds))
        if (
            held is not None
            and after is not None
            and _one_bit(held.end - held.start ^ after - held.start)
            and self._is_unwitnessed(data, held)
            and not self._is_chunk(data, at, end)
        ):
            return None, self._span(data, held.offset, after, end, kinds)
        return held, self._span(data, at, end if after is None else after, end, kinds)

    def _is_unwitnessed(self, data: Buffer, held: ScannedRecord) -> bool:
        """Say whether nothing vouches for the length of a record that nothing follows."""
        if held.damage is not None:
            return False
        if held.opcode != Opcode.ATTACHMENT or self._to_vouch < 0:
            return True
        self._to_vouch -= held.end - held.start
        return not attachment_agrees(data, held.start, held.end)

    def _sought_in(self, data: Buffer, at: int, end: int, kinds: frozenset[int]) -> frozenset[int]:
        """Return the kinds that may follow a record; what is in a chunk does not."""
        return kinds - _IN_CHUNK if self._is_chunk(data, at, end) else kinds

    def _is_chunk(self, data: Buffer, at: int, end: int) -> bool:
        return data[at] == Opcode.CHUNK and self._has_compression(data, at + HEAD.size, end)

    def _within_bounds(
        self, data: Buffer, at: int, end: int, kinds: frozenset[int]
    ) -> ScannedRecord | None:
        """Return the record whose length is right while something else is not."""
        if end - at < HEAD.size:
            return None
        opcode, length = HEAD.unpack_from(data, at)
        start = at + HEAD.size
        stop = start + length
        if opcode == 0 or stop > end:
            return None
        if stop < end and self._at(data, stop, end, kinds) is None:
            return None
        mended = self._mended_opcodes(data, opcode, start, stop, kinds)
        if mended:
            return ScannedRecord(mended[0], at, start, stop, DamageKind.OPCODE)
        kind = DamageKind.CONTENT if opcode in kinds else DamageKind.OPCODE
        return ScannedRecord(opcode if opcode in kinds else GARBAGE, at, start, stop, kind)

    def _by_own_fields(
        self, data: Buffer, at: int, end: int, kinds: frozenset[int]
    ) -> ScannedRecord | None:
        """Return the record whose length is wrong, and whose fields show where it ends."""
        opcode = data[at]
        if opcode not in kinds & _NAMED or (
            opcode == Opcode.CHUNK and not self._is_chunk(data, at, end)
        ):
            return None
        start = at + HEAD.size
        stop = fields_end(data, opcode, start, end)
        if stop is None or stop > end or not self._is_followed(data, stop, end, kinds):
            return None
        return ScannedRecord(opcode, at, start, stop, DamageKind.LENGTH)

    def _span(
        self, data: Buffer, at: int, after: int, end: int, kinds: frozenset[int]
    ) -> ScannedRecord:
        """Say what the bytes up to the next record are."""
        start = at + HEAD.size
        if start > after:
            return ScannedRecord(GARBAGE, at, at, after, _end_or(DamageKind.GARBAGE, after == end))
        opcode, length = HEAD.unpack_from(data, at)
        cut = length > end - start
        if opcode in kinds:
            if _one_bit(after - start ^ length) and fills(data, opcode, start, after):
                return ScannedRecord(opcode, at, start, after, DamageKind.LENGTH)
            if self._is_chunk(data, at, end):
                kind = _end_or(DamageKind.LENGTH, length < _POSSIBLE_BYTES)
                return ScannedRecord(opcode, at, start, after, kind)
            stop = fields_end(data, opcode, start, min(start + length, end))
            if opcode != Opcode.MESSAGE and stop is not None and start < stop <= after:
                # the record ends where its fields do; what follows is looked at next
                return ScannedRecord(opcode, at, start, stop, DamageKind.LENGTH)
            if cut:
                kind = _end_or(DamageKind.LENGTH, after == end and length < _POSSIBLE_BYTES)
                return ScannedRecord(GARBAGE, at, start, after, kind)
            return ScannedRecord(GARBAGE, at, start, after, DamageKind.CONTENT)
        return ScannedRecord(GARBAGE, at, at, after, DamageKind.GARBAGE)

    def _mended_opcodes(
        self, data: Buffer, opcode: int, start: int, stop: int, kinds: frozenset[int]
    ) -> list[int]:
        """Return the kinds, one bit away, that fill the span."""
        near = [opcode ^ 1 << bit for bit in range(8)]
        return [
            each
            for each in near
            if each in kinds
            and fills(data, each, start, stop)
            and (each != Opcode.MESSAGE or self._is_expected(data, start))
        ]

    def _resync(
        self, data: Buffer, begin: int, limit: int, end: int, kinds: frozenset[int]
    ) -> int | None:
        """Return the first place where a record is plausible by itself."""
        for match in _HEAD.finditer(data, begin, min(limit + HEAD.size, end)):
            at = match.start()
            if at >= limit:
                break
            if data[at] in kinds and self._is_plausible(data, at, end, kinds):
                return at
        ending = data.find(MAGIC, max(begin, end - len(MAGIC)), end)
        return ending if begin <= ending < limit else None

    def _is_plausible(self, data: Buffer, at: int, end: int, kinds: frozenset[int]) -> bool:
        opcode, length = HEAD.unpack_from(data, at)
        start = at + HEAD.size
        stop = start + length
        if stop > end:  # a chunk that is cut off still has its two lengths
            return (
                opcode == Opcode.CHUNK
                and self._has_compression(data, start, end)
                and fields_end(data, opcode, start, end) == stop
            )
        if length > _SOUGHT_BYTES and opcode not in _WITH_BODY:
            return False
        if not fills(data, opcode, start, stop):
            return False
        if opcode == Opcode.MESSAGE:
            if self._is_expected(data, start):
                return True
            known = not self.channels or self._channel(data, start) in self.channels
            return known and self._is_followed(data, stop, end, kinds)
        if opcode == Opcode.CHUNK:
            return self._has_compression(data, start, end)
        return opcode in _NAMED or self._is_followed(data, stop, end, kinds)

    def _is_followed(self, data: Buffer, at: int, end: int, kinds: frozenset[int]) -> bool:
        for _ in range(_CHAIN):
            if at >= end:
                return True
            following = self._at(data, at, end, kinds)
            if following is None:
                return False
            at = following.end
        return True

    def _is_expected(self, data: Buffer, start: int) -> bool:
        """Say whether a message is on a known channel and near the last one."""
        channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(data, start)
        near = self._log_ns is not None and abs(log_ns - self._log_ns) < _NEAR_NS
        return near and channel in self.channels

    def _channel(self, data: Buffer, start: int) -> int:
        return int(MESSAGE_HEAD.unpack_from(data, start)[0])

    def _has_compression(self, data: Buffer, start: int, end: int) -> bool:
        name = data[start + 28 : min(start + 36, end)]
        return name in (b'\x04\0\0\0zstd', b'\x03\0\0\0lz4' + name[7:]) or name[:4] == bytes(4)


def _magic(data: Buffer, at: int, end: int) -> ScannedRecord | None:
    if data[at : min(at + len(MAGIC), end)] == MAGIC:
        return ScannedRecord(MAGIC_PLACE, at, at, at + len(MAGIC))
    return None


def _one_bit(difference: int) -> bool:
    return difference.bit_count() == 1


def _end_or(kind: DamageKind, at_end: bool) -> DamageKind:
    return DamageKind.TRUNCATED if at_end else kind
