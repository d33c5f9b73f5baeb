# SPDX-License-Identifier: Apache-2.0
"""
Salvage of a damaged bag: every whole message into a sound one.

Messages of a chunk that is cut off or has a wrong checksum, messages between
chunks, and what had to be inferred, go into a bag of their own, so that nothing
doubtful is taken for data.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode

from shipdrag_ros.bags.locate import BagFiles, locate
from shipdrag_ros.bags.records import (
    CHUNK_LIMIT_BYTES,
    MAGIC,
    MESSAGE_HEAD,
    UNPACKING_ERRORS,
    Buffer,
    attachment_agrees,
    unpack_zstd,
)
from shipdrag_ros.bags.salvage.damage import Damage, DamageKind, DamageList
from shipdrag_ros.bags.salvage.layout import KNOWN, name
from shipdrag_ros.bags.salvage.learnt import Learnt, Trust, read_footer
from shipdrag_ros.bags.salvage.salvaged_bag import SalvagedBag
from shipdrag_ros.bags.salvage.scan import GARBAGE, MAGIC_PLACE, ScannedRecord, Scanner, found_name
from shipdrag_ros.bags.salvage.unpack import opened, unpack_chunk_partly
from shipdrag_ros.bags.salvage.whole_chunk import read_whole
from shipdrag_ros.errors import BagError
from shipdrag_ros.progress import PartDone

# with one of these, or none, the record itself is whole
_WHOLE = (None, DamageKind.OPCODE, DamageKind.LENGTH)


@dataclass(frozen=True)
class Recovery:
    """
    What was saved, and what was lost.

    Attributes
    ----------
    messages_recovered
        Messages in `output`.
    messages_crc_suspect
        Messages in `quarantine`.
    bytes_read, bytes_lost
        Of the source, unpacked if it was packed as a whole; lost are those that
        gave nothing.
    damage
        What is wrong with the source, file by file in order of place.
    damage_count
        How much of it there is; `damage` lists the first.
    output
        The sound bag.
    quarantine
        The bag of what is doubtful; None without any.
    """

    messages_recovered: int
    messages_crc_suspect: int
    bytes_read: int
    bytes_lost: int
    damage: tuple[Damage, ...]
    damage_count: int
    output: Path
    quarantine: Path | None


def recover(
    source: Path, output: Path, *, progress: PartDone = lambda done, total: None
) -> Recovery:
    """
    Save every whole message of a bag.

    Parameters
    ----------
    source
        MCAP file or rosbag2 directory; the files of a directory are joined.
    output
        File to make; one that exists is never overwritten. What is doubtful
        goes beside it, into `NAME.quarantine.mcap`.
    progress
        Called with bytes done, and in all, of each file.

    Raises
    ------
    BagError
        If nothing in the source is of MCAP, or the output cannot be made.
    """
    bag = _only_bag(source)
    quarantine = output.with_suffix('.quarantine.mcap')
    for path in (output, quarantine):
        if path.exists():
            raise BagError(f'{str(path)!r} exists; choose another name or remove it')
    learnt = [Learnt() for _ in bag.files]
    while True:
        salvage = _Salvage(SalvagedBag(output), SalvagedBag(quarantine), bag, progress)
        try:
            for file, known in zip(bag.files, learnt, strict=True):
                known.missed.clear()
                salvage.take(file, known)
            if any(known.found_later() for known in learnt):
                continue  # messages came before their channel: once more, with what is known
            if not salvage.records:
                raise BagError(
                    f'{str(source)!r} holds no record of MCAP, nothing can be saved; '
                    'give a .mcap file'
                )
            salvage.sound.publish()
            if salvage.doubtful.used:
                salvage.doubtful.publish()
        finally:
            salvage.sound.discard()
            salvage.doubtful.discard()
        return Recovery(
            messages_recovered=salvage.sound.messages,
            messages_crc_suspect=salvage.doubtful.messages,
            bytes_read=salvage.size,
            bytes_lost=salvage.lost,
            damage=tuple(salvage.listed),
            damage_count=salvage.damage_count,
            output=output,
            quarantine=quarantine if salvage.doubtful.used else None,
        )


def _only_bag(source: Path) -> BagFiles:
    bags = locate(source)
    if len(bags) > 1:
        raise BagError(
            f'{str(source)!r} holds {len(bags)} bags; recover each by itself: '
            f'{", ".join(bag.name for bag in bags)}'
        )
    return bags[0]


class _Salvage:
    """One pass over the files of a bag."""

    def __init__(
        self,
        sound: SalvagedBag,
        doubtful: SalvagedBag,
        bag: BagFiles,
        progress: PartDone,
    ) -> None:
        self.sound = sound
        self.doubtful = doubtful
        self.listed: list[Damage] = []
        self.damage_count = 0
        self.size = 0
        self.lost = 0
        self.records = 0
        self._bag = bag
        self._progress = progress
        for warning in bag.warnings:
            self._note(DamageList([Damage(0, 'file', DamageKind.MISSING, warning)], 1))

    def take(self, file: Path, learnt: Learnt) -> None:
        """Write what can be saved of a file."""
        damages = DamageList(file=file.name if len(self._bag.files) > 1 else '')
        with opened(file, damages) as data:
            self.size += len(data)
            learnt.learn_summary(data)
            self.sound.begin(learnt)
            self.doubtful.begin(learnt)
            self._learnt = learnt
            self._damages = damages
            self._scanner = Scanner(set(learnt.channels))
            self._walk(data)
            self.sound.declare()
        self._note(damages)

    def _note(self, damages: DamageList) -> None:
        self.listed += sorted(damages.listed, key=lambda damage: damage.offset)
        self.damage_count += damages.count

    def _walk(self, data: Buffer) -> None:
        if data[: len(MAGIC)] != MAGIC:
            self._damages.add(0, 'magic', DamageKind.MISSING)
        chunked = False
        for found in self._scanner.walk(data, 0, len(data)):
            if found.opcode == MAGIC_PLACE:
                continue
            self.records += found.opcode != GARBAGE
            if found.opcode == Opcode.CHUNK:
                chunked = True
                self._progress(found.offset, len(data))
                self._chunk(data, found)
                continue
            if found.damage is not None:
                self._damages.add(found.offset, found_name(data, found), found.damage)
            if found.opcode == GARBAGE or found.damage not in _WHOLE:
                self.lost += found.end - found.offset
            else:
                # a message between chunks may be an index of one, with one bit flipped
                stray = chunked and found.opcode == Opcode.MESSAGE
                trust = Trust.DOUBTFUL if stray or found.damage is not None else Trust.READ
                self._record(data, found, trust, found.offset)
        if read_footer(data) is None:
            self._damages.add(len(data), 'footer', DamageKind.MISSING)

    def _chunk(self, data: Buffer, chunk: ScannedRecord) -> None:
        unpacked = unpack_chunk_partly(data, chunk.start, chunk.end)
        kind = chunk.damage or unpacked.damage
        if kind is not None:
            self._damages.add(chunk.offset, 'chunk', kind)
        trust = Trust.DOUBTFUL
        if unpacked.verified:
            trust = Trust.VERIFIED
        elif kind is None:
            trust = Trust.READ
        records = unpacked.records
        if kind is None and self._take_whole(records, trust):
            return
        used = 0
        for found in self._scanner.walk(records, 0, len(records), in_chunk=True):
            if found.damage is not None and trust is not Trust.DOUBTFUL:
                # elsewhere it is what the damage of the chunk has made
                self._damages.add(chunk.offset, found_name(records, found), found.damage)
            if found.opcode != GARBAGE and found.damage in _WHOLE:
                used += found.end - found.offset
                believed = trust if found.damage is None else Trust.DOUBTFUL
                self._record(records, found, believed, chunk.offset)
        packed = chunk.end - chunk.start - unpacked.unread
        self.lost += unpacked.unread + packed * (len(records) - used) // max(len(records), 1)

    def _take_whole(self, records: bytes, trust: Trust) -> bool:
        """Write all of a sound chunk at once; False where it has to be taken apart."""
        whole = None if self._bag.message_compression else read_whole(records)
        if whole is None:
            return False
        for found in whole.declarations:
            if not self._learnt.add(found.read(records), trust):
                return False
        if not self._learnt.channels.keys() >= set(np.unique(whole.channel).tolist()):
            return False
        for found in whole.declarations:
            self._scanner.noted(records, found)
        if len(whole.channel):
            self._scanner.noted(records, whole.last_message(records))
            self.sound.write_chunk(records, whole)
        return True

    def _record(self, data: Buffer, found: ScannedRecord, trust: Trust, offset: int) -> None:
        bag = self.doubtful if trust is Trust.DOUBTFUL else self.sound
        match found.opcode:
            case Opcode.MESSAGE:
                number, sequence, log_ns, publish_ns = MESSAGE_HEAD.unpack_from(data, found.start)
                if number not in self._learnt.channels:
                    if f'channel {number}' not in self._learnt.missed:
                        self._damages.add(offset, 'message', DamageKind.REFERENCE)
                    bag = self.doubtful
                payload = self._payload(data[found.start + MESSAGE_HEAD.size : found.end])
                if payload is None:
                    self._damages.add(offset, 'message', DamageKind.COMPRESSION)
                    self.lost += found.end - found.offset
                    return
                bag.write(number, payload, sequence=sequence, log_ns=log_ns, publish_ns=publish_ns)
            case Opcode.SCHEMA | Opcode.CHANNEL:
                if not self._learnt.add(found.read(data), trust):
                    self._damages.add(offset, name(found.opcode), DamageKind.DISAGREES)
            case Opcode.HEADER:
                self.sound.profile = self.doubtful.profile = found.read(data).profile
            case Opcode.ATTACHMENT:
                if not attachment_agrees(data, found.start, found.end):
                    self._damages.add(offset, 'attachment', DamageKind.CHECKSUM)
                    bag = self.doubtful
                bag.attach(found.read(data))
            case Opcode.METADATA:
                bag.describe(found.read(data))
            case kind if kind not in KNOWN:
                self.lost += found.end - found.offset

    def _payload(self, payload: bytes) -> bytes | None:
        """Unpack a message that is packed by itself; None if it is damaged."""
        if not self._bag.message_compression:
            return payload
        try:
            return unpack_zstd(payload, CHUNK_LIMIT_BYTES)
        except UNPACKING_ERRORS:
            return None
