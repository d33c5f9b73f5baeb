# SPDX-License-Identifier: Apache-2.0
"""
Salvage of a damaged bag: every whole message into a sound one.

Messages of a chunk that is cut off or has a wrong checksum, messages whose bounds are
inferred, and those of topics that are not known, go into a bag of their own, so that
nothing doubtful is taken for data. Sound chunks are copied as they are. A finished part
is made compact in the same way: its name holds a whole file at every moment.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema

from shipdrag_ros.bags.mcap_file import BagFiles, locate, mapped, unpack_file
from shipdrag_ros.bags.message_index import EVERY_CHANNEL, Indexed, index_messages
from shipdrag_ros.bags.records import (
    CHUNK_LIMIT_BYTES,
    GARBAGE,
    HEAD,
    IN_CHUNK,
    MAGIC,
    MESSAGE_HEAD,
    TIME_LIMIT_NS,
    Buffer,
    Damage,
    DamageKind,
    DamageList,
    Place,
    attachment_agrees,
    place_at,
    read,
    unpack,
    unpack_zstd,
    walk,
)
from shipdrag_ros.bags.writer import CHUNK_RANGE, RecordWriter, as_bytes, sync_directory
from shipdrag_ros.errors import BagError
from shipdrag_ros.progress import PartDone

_FOOTER_BYTES = HEAD.size + 20
_STATED = ((20, 8), (4, 4))  # before the last magic: start and checksum of the summary
_PART = '.part'


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
    bags = locate(source)
    if len(bags) > 1:
        raise BagError(
            f'{str(source)!r} holds {len(bags)} bags; recover each by itself: '
            f'{", ".join(bag.name for bag in bags)}'
        )
    with ExitStack() as made:
        sound = made.enter_context(_Salvaged(output))
        doubtful = made.enter_context(_Salvaged(output.with_suffix('.quarantine.mcap')))
        salvage = _Salvage(sound, doubtful, bags[0], progress)
        for file in bags[0].files:
            salvage.take(file)
        if not salvage.records:
            raise BagError(
                f'{str(source)!r} holds no record of MCAP, nothing can be saved; give a .mcap file'
            )
        sound.publish()
        if doubtful.used:
            doubtful.publish()
    damages = salvage.damages
    return Recovery(
        messages_recovered=sound.messages,
        messages_crc_suspect=doubtful.messages,
        bytes_read=salvage.bytes_read,
        bytes_lost=salvage.bytes_lost,
        damage=tuple(damages.listed),
        damage_count=damages.count,
        output=output,
        quarantine=doubtful.path if doubtful.used else None,
    )


@contextmanager
def opened(path: Path, damages: DamageList) -> Iterator[Buffer]:
    """
    Open a file that may be packed, damaged or empty.

    Parameters
    ----------
    path
        `.mcap`, or `.mcap.zstd` as rosbag2 compresses files.
    damages
        Where it is noted that it is empty, or its packing damaged.

    Raises
    ------
    BagError
        If it cannot be read.
    """
    with ExitStack() as stack:
        unpacked = None
        if path.suffix == '.zstd':
            unpacked = stack.enter_context(TemporaryFile(prefix='shipdrag_'))
            unpack_file(path, unpacked, lambda kind, text: damages.add(0, 'file', kind, text))
        data = stack.enter_context(mapped(path, unpacked))
        if not data:
            damages.add(0, 'file', DamageKind.TRUNCATED, 'it is empty')
        yield data


class DeclaredTopics:
    """
    The schemas and channels of a file; of two that differ the better witnessed one counts.

    Attributes
    ----------
    schemas, channels
        By their numbers in the file.
    """

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._verified: set[tuple[type, int]] = set()

    def add(self, record: Schema | Channel, *, verified: bool) -> bool:
        """
        Take note of one; return whether it agrees with what is known.

        Parameters
        ----------
        record
            From a file.
        verified
            Whether a checksum vouches for it.
        """
        known: dict[int, Any] = self.schemas if isinstance(record, Schema) else self.channels
        key = type(record), record.id
        before = known.setdefault(record.id, record)
        better = verified and key not in self._verified
        if better:
            known[record.id] = record
            self._verified.add(key)
        return before == record or better

    def add_all(self, data: Buffer) -> None:
        """
        Take note of those that stand outside of chunks, wherever they do.
        """
        end = len(data) - len(MAGIC)
        start, checksum = (int.from_bytes(data[end - at :][:n], 'little') for at, n in _STATED)
        verified = checksum and start < end and crc32(data[start : end - 4]) == checksum
        if end > _FOOTER_BYTES and verified:
            self._add_between(data, start, end, verified=True)
        self._add_between(data, 0, len(data), verified=False)

    def _add_between(self, data: Buffer, start: int, end: int, *, verified: bool) -> None:
        for place in walk(data, start, end):
            if place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and place.damage is None:
                record = read(data, place)
                if record is not None:
                    self.add(record, verified=verified)


class _Salvaged:
    """A bag that is there as a whole, or not at all; nothing is overwritten."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.profile = 'ros2'
        self.messages = 0
        self._writer: RecordWriter | None = None
        self.numbers: dict[int, int] = {}
        self._written: set[bytes] = set()
        self._part = path.with_name(f'.{path.name}{_PART}')
        if path.exists():
            raise BagError(f'{str(path)!r} exists; choose another name or remove it')

    @property
    def used(self) -> bool:
        """Whether anything was written."""
        return self._writer is not None

    @property
    def writer(self) -> RecordWriter:
        """Makes the file when it is first needed."""
        if self._writer is None:
            with suppress(OSError):
                self._part.unlink()  # of an attempt that was killed
            self._writer = RecordWriter(self._part, profile=self.profile)
        return self._writer

    def number(self, number: int, declared: DeclaredTopics) -> int:
        """Return the number here of a channel of the source, known or not."""
        if number not in self.numbers:
            channel = declared.channels.get(number)
            if channel is None:
                channel = Channel(number, f'/unknown_channel_{number}', 'cdr', {}, 0)
            schema = declared.schemas.get(channel.schema_id)
            self.numbers[number] = self.writer.declare(channel, schema)
        return self.numbers[number]

    def once(self, record: Attachment | Metadata) -> None:
        """Write an attachment or metadata; those of several parts are often the same."""
        key = as_bytes(record)
        if key in self._written:
            return
        self._written.add(key)
        self.writer.add(record)

    def publish(self) -> None:
        """Give the file its name."""
        self.writer.close()
        try:
            self.path.hardlink_to(self._part)  # which never replaces a file, as a rename does
        except FileExistsError:
            raise BagError(f'{str(self.path)!r} exists; choose another name') from None
        except OSError:  # a file system without such links
            self._part.rename(self.path)
        sync_directory(self.path.parent)

    def __enter__(self) -> _Salvaged:
        return self

    def __exit__(self, *error: object) -> None:
        if self._writer is not None:
            with suppress(BagError):
                self._writer.close()
            with suppress(OSError):
                self._part.unlink()


class _Salvage:
    """One pass over the files of a bag."""

    def __init__(
        self, sound: _Salvaged, doubtful: _Salvaged, bag: BagFiles, progress: PartDone
    ) -> None:
        self.damages = DamageList()
        self.bytes_read = 0
        self.bytes_lost = 0
        self.records = 0
        self._sound = sound
        self._doubtful = doubtful
        self._bag = bag
        self._progress = progress
        self._declared = DeclaredTopics()
        for warning in bag.warnings:
            self.damages.add(0, 'file', DamageKind.MISSING, warning)

    def take(self, file: Path) -> None:
        """Write what can be saved of a file."""
        self.damages.file = file.name if len(self._bag.files) > 1 else ''
        self._declared = DeclaredTopics()
        with opened(file, self.damages) as data:
            self.bytes_read += len(data)
            self._declared.add_all(data)
            self._forget()
            self._walk(data)
            if self._sound.used:
                for number in self._declared.channels:  # also those without a message
                    self._sound.number(number, self._declared)
            if data[-len(MAGIC) :] != MAGIC:
                self.damages.add(len(data), 'footer', DamageKind.MISSING)

    def _forget(self) -> None:
        self._sound.numbers.clear()
        self._doubtful.numbers.clear()

    def _walk(self, data: Buffer) -> None:
        begin = len(MAGIC) if data[: len(MAGIC)] == MAGIC else 0
        if not begin:
            self.damages.add(0, 'magic', DamageKind.MISSING)
        chunked = False
        for place in walk(data, begin, len(data)):
            if place.damage is not None:
                self.damages.add(place.offset, place.name, place.damage)
            if place.opcode == Opcode.CHUNK and place.start > place.offset:
                chunked = True
                self._progress(place.offset, len(data))
                self._chunk(data, place)
            elif place.readable:
                # a message between chunks may be part of a damaged one
                stray = chunked and place.opcode == Opcode.MESSAGE
                self._record(data, place, place.offset, sound=not stray and place.damage is None)
            elif place.damage is not None or place.opcode != GARBAGE:
                self.bytes_lost += place.end - place.offset

    def _chunk(self, data: Buffer, chunk: Place) -> None:
        records, damage, verified, _ = unpack(data, chunk, partly=True)
        if damage not in (None, chunk.damage):
            self.damages.add(chunk.offset, 'chunk', damage)
        sound = verified or (damage is None and chunk.damage is None)
        indexed = index_messages([records], [0], EVERY_CHANNEL)
        messages, others, notes = indexed
        if sound and not notes:
            for at in others.tolist():
                place = place_at(records, at)
                self._record(records, place, chunk.offset, sound=True, verified=verified)
            as_it_is = verified and damage is None and not self._bag.message_compression
            if as_it_is and self._copy(data, chunk, records, indexed):
                return
            starts = (messages.start - MESSAGE_HEAD.size).tolist()
            for start, end in zip(starts, messages.end.tolist(), strict=True):
                self._message(records[start:end], chunk.offset, self._sound)
            return
        used = 0
        for place in walk(records, 0, len(records), IN_CHUNK):
            if place.damage is not None and sound:
                # elsewhere it is what the damage of the chunk has made
                self.damages.add(chunk.offset, place.name, place.damage)
            if place.readable:
                used += place.end - place.offset
                believed = sound and place.damage is None
                self._record(records, place, chunk.offset, sound=believed, verified=verified)
        packed = chunk.end - chunk.start
        self.bytes_lost += packed * (len(records) - used) // len(records) if records else packed

    def _copy(self, data: Buffer, chunk: Place, records: bytes, indexed: Indexed) -> bool:
        """Write a chunk as it is, if it needs no other numbers and is worth it; say whether."""
        messages, others, _ = indexed
        record, declared = read(data, chunk), self._declared.channels
        numbers = np.unique(messages.channel).tolist()
        small = not record.compression and len(record.data) < CHUNK_RANGE[0]
        if small or not numbers or not declared.keys() >= set(numbers):
            return False
        inside = [read(records, place_at(records, at)) for at in others.tolist()]
        for number in {*numbers, *(it.id for it in inside if isinstance(it, Channel))}:
            if self._sound.number(number, self._declared) != number:
                return False
        if not all(self._sound.writer.says(it) for it in inside):
            return False
        offsets = messages.start - (HEAD.size + MESSAGE_HEAD.size)
        entries = np.column_stack((messages.log_ns, offsets)).astype('<u8')
        first, last = int(messages.log_ns.min()), int(messages.log_ns.max())
        self._sound.writer.add_chunk(
            replace(record, message_start_time=first, message_end_time=last),
            {number: entries[messages.channel == number].ravel() for number in numbers},
        )
        self._sound.messages += len(messages)
        return True

    def _record(
        self, data: Buffer, place: Place, offset: int, *, sound: bool, verified: bool = False
    ) -> None:
        self.records += 1
        bag = self._sound if sound else self._doubtful
        if place.opcode == Opcode.MESSAGE:
            self._message(data[place.start : place.end], offset, bag)
            return
        record = read(data, place)
        match record:
            case Schema() | Channel():
                if not self._declared.add(record, verified=verified) and sound:
                    self.damages.add(offset, place.name, DamageKind.DISAGREES)
                self._forget()
            case Header():
                self._sound.profile = self._doubtful.profile = record.profile
            case Attachment():
                if not attachment_agrees(data, place):
                    self.damages.add(offset, place.name, DamageKind.CHECKSUM)
                    bag = self._doubtful
                bag.once(record)
            case Metadata():
                bag.once(record)
            case None:
                self.damages.add(offset, place.name, DamageKind.CONTENT)

    def _message(self, content: bytes, offset: int, bag: _Salvaged) -> None:
        channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(content)
        if log_ns >= TIME_LIMIT_NS:  # no reader takes it
            self.damages.add(offset, 'message', DamageKind.CONTENT, f'log time {log_ns}')
            self.bytes_lost += HEAD.size + len(content)
            return
        if channel not in self._declared.channels:
            bag = self._doubtful
            if channel not in bag.numbers:  # said once; a thousand messages may be of it
                self.damages.add(offset, 'message', DamageKind.REFERENCE, f'channel {channel}')
        if self._bag.message_compression:
            try:
                payload = unpack_zstd(content[MESSAGE_HEAD.size :], CHUNK_LIMIT_BYTES)
            except (zstandard.ZstdError, ValueError, MemoryError):
                self.damages.add(offset, 'message', DamageKind.COMPRESSION)
                self.bytes_lost += HEAD.size + len(content)
                return
            content = content[: MESSAGE_HEAD.size] + payload
        number = bag.numbers.get(channel) or bag.number(channel, self._declared)
        bag.writer.add_content(number, content, log_ns=log_ns)
        bag.messages += 1


SUFFIX = '.compacting'


def compact(path: Path, *, messages: int) -> None:
    """
    Rewrite a file that is no longer written into compressed chunks with an index.

    Parameters
    ----------
    path
        From `LiveFile`; afterwards the same messages.
    messages
        How many there are.

    Raises
    ------
    BagError
        If that is impossible; the file is then as it was.
    """
    compacted = path.with_name(path.name + SUFFIX)
    made = [compacted]
    try:
        compacted.unlink(missing_ok=True)  # from an attempt that failed
        written = recover(path, compacted)
        made += [written.quarantine] if written.quarantine else []
        if written.messages_recovered != messages or written.quarantine:
            raise BagError(
                f'{str(path)!r} cannot be compacted: it holds {written.messages_recovered} sound '
                f'messages, {messages} were written'
            )
        compacted.replace(path)
        sync_directory(path.parent)
    except OSError as error:
        raise BagError(f'{str(path)!r} cannot be compacted: {error}') from error
    finally:
        for each in made:
            with suppress(OSError):
                each.unlink()
