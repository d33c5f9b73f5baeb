# SPDX-License-Identifier: Apache-2.0
"""
Salvage of a damaged bag: every whole message into a sound one.

Messages of a chunk that is cut off or has a wrong checksum, and what had to be
inferred, go into a bag of their own, so that nothing doubtful is taken for
data.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode

from shipdrag_ros.bags.damage import Damage, DamageKind, DamageList
from shipdrag_ros.bags.layout import KNOWN, name
from shipdrag_ros.bags.learnt import Learnt, Trust, read_footer
from shipdrag_ros.bags.locate import locate
from shipdrag_ros.bags.records import MAGIC, MESSAGE_HEAD, Buffer, attachment_agrees
from shipdrag_ros.bags.salvaged_bag import SalvagedBag
from shipdrag_ros.bags.scan import GARBAGE, MAGIC_PLACE, Found, Scanner, found_name
from shipdrag_ros.bags.unpack import opened, unpack_chunk_partly
from shipdrag_ros.errors import BagError

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
        What is wrong with the source, in order of place.
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
    source: Path, output: Path, *, progress: Callable[[int, int], None] = lambda done, total: None
) -> Recovery:
    """
    Save every whole message of a bag.

    Parameters
    ----------
    source
        MCAP file, or a rosbag2 directory of one file.
    output
        File to make; one that exists is never overwritten. What is doubtful
        goes beside it, into `NAME.quarantine.mcap`.
    progress
        Told bytes done, and in all.

    Raises
    ------
    BagError
        If nothing in the source is of MCAP, or the output cannot be made.
    """
    file = _only_file(source)
    quarantine = output.with_suffix('.quarantine.mcap')
    for path in (output, quarantine):
        if path.exists():
            raise BagError(f'{str(path)!r} exists; choose another name or remove it')
    packing = DamageList()
    with opened(file, packing) as data:
        learnt = Learnt()
        learnt.learn_summary(data)
        while True:
            learnt.missed.clear()
            damages = DamageList(list(packing.listed), packing.count)
            salvage = _Salvage(
                data,
                learnt,
                SalvagedBag(output, learnt),
                SalvagedBag(quarantine, learnt),
                damages,
            )
            try:
                salvage.run(progress)
                if learnt.found_later():
                    continue  # messages came before their channel: once more, with what is known
                if not salvage.records:
                    raise BagError(
                        f'{str(file)!r} holds no record of MCAP, nothing can be saved; '
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
                bytes_read=len(data),
                bytes_lost=salvage.lost,
                damage=tuple(sorted(damages.listed, key=lambda damage: damage.offset)),
                damage_count=damages.count,
                output=output,
                quarantine=quarantine if salvage.doubtful.used else None,
            )


def _only_file(source: Path) -> Path:
    if source.is_file():
        return source
    files = [file for bag in locate(source) for file in bag.files]
    if len(files) > 1:
        raise BagError(
            f'{str(source)!r} has {len(files)} files; recover each by itself: '
            f'{", ".join(map(str, files))}'
        )
    return files[0]


class _Salvage:
    """One pass over a file."""

    def __init__(
        self,
        data: Buffer,
        learnt: Learnt,
        sound: SalvagedBag,
        doubtful: SalvagedBag,
        damages: DamageList,
    ) -> None:
        self.sound = sound
        self.doubtful = doubtful
        self.lost = 0
        self.records = 0
        self._data = data
        self._learnt = learnt
        self._damages = damages
        self._scanner = Scanner(set(learnt.channels))

    def run(self, progress: Callable[[int, int], None]) -> None:
        """Write what can be saved."""
        data = self._data
        if data[: len(MAGIC)] != MAGIC:
            self._damages.add(0, 'magic', DamageKind.MISSING)
        for found in self._scanner.walk(data, 0, len(data)):
            if found.opcode == MAGIC_PLACE:
                continue
            self.records += found.opcode != GARBAGE
            if found.opcode == Opcode.CHUNK:
                progress(found.offset, len(data))
                self._chunk(found)
                continue
            if found.damage is not None:
                self._damages.add(found.offset, found_name(data, found), found.damage)
            if found.opcode == GARBAGE or found.damage not in _WHOLE:
                self.lost += found.end - found.offset
            else:
                trust = Trust.READ if found.damage is None else Trust.DOUBTFUL
                self._record(data, found, trust, found.offset)
        if read_footer(data) is None:
            self._damages.add(len(data), 'footer', DamageKind.MISSING)

    def _chunk(self, chunk: Found) -> None:
        unpacked = unpack_chunk_partly(self._data, chunk.start, chunk.end)
        kind = chunk.damage or unpacked.damage
        if kind is not None:
            self._damages.add(chunk.offset, 'chunk', kind)
        self.lost += unpacked.unread
        trust = Trust.DOUBTFUL
        if unpacked.verified:
            trust = Trust.VERIFIED
        elif kind is None:
            trust = Trust.READ
        records = unpacked.records
        for found in self._scanner.walk(records, 0, len(records), in_chunk=True):
            whole = found.opcode != GARBAGE and found.damage in _WHOLE
            if found.damage is not None and trust is not Trust.DOUBTFUL:
                # elsewhere it is what the damage of the chunk has made
                self._damages.add(chunk.offset, found_name(records, found), found.damage)
            if whole:
                believed = trust if found.damage is None else Trust.DOUBTFUL
                self._record(records, found, believed, chunk.offset)

    def _record(self, data: Buffer, found: Found, trust: Trust, offset: int) -> None:
        bag = self.doubtful if trust is Trust.DOUBTFUL else self.sound
        match found.opcode:
            case Opcode.MESSAGE:
                number, sequence, log_ns, publish_ns = MESSAGE_HEAD.unpack_from(data, found.start)
                if number not in self._learnt.channels:
                    if f'channel {number}' not in self._learnt.missed:
                        self._damages.add(offset, 'message', DamageKind.REFERENCE)
                    bag = self.doubtful
                bag.write(
                    number,
                    bytes(data[found.start + MESSAGE_HEAD.size : found.end]),
                    sequence=sequence,
                    log_ns=log_ns,
                    publish_ns=publish_ns,
                )
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
