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
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import zstandard
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema

from shipdrag_ros.bags.mcap_file import BagFiles, locate, mapped, unpacked_file
from shipdrag_ros.bags.records import (
    CHUNK_LIMIT_BYTES,
    GARBAGE,
    HEAD,
    MAGIC,
    MESSAGE_HEAD,
    TIME_LIMIT_NS,
    Buffer,
    Damage,
    DamageKind,
    DamageList,
    Place,
    attachment_agrees,
    footer_of,
    has_end,
    read,
    summary_agrees,
    unpack_zstd,
    walk,
)
from shipdrag_ros.bags.scan import OpenChunk, scan
from shipdrag_ros.bags.writer import CHUNK_RANGE, RecordWriter, as_bytes, sync_directory
from shipdrag_ros.errors import BagError
from shipdrag_ros.progress import PartDone

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
    unpacked = unpacked_file(path, lambda kind, text: damages.add(0, 'file', kind, text))
    with unpacked or nullcontext(), mapped(path, unpacked) as data:
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
        footer = footer_of(data)
        begin = len(data)
        if footer is not None and footer.summary_crc and summary_agrees(data, footer):
            begin = footer.summary_start
        for place in walk(data, 0, len(data)):
            if place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and place.damage is None:
                record = read(data, place)
                if record is not None:
                    self.add(record, verified=place.offset >= begin)


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
        chunked = False
        for place, chunk in scan(data, self.damages, partly=True):
            if chunk is not None:
                chunked = True
                self._progress(place.offset, len(data))
                self._chunk(chunk)
            elif place.readable:
                # a message between chunks may be part of a damaged one
                stray = chunked and place.opcode == Opcode.MESSAGE
                self._record(data, place, place.offset, sound=not stray and place.damage is None)
            elif place.damage is not None or place.opcode != GARBAGE:
                self.bytes_lost += place.end - place.offset

    def _chunk(self, chunk: OpenChunk) -> None:
        records, offset, verified = chunk.records, chunk.place.offset, chunk.verified
        sound = verified or chunk.sound
        if sound and not chunk.notes:
            for place in chunk.others:
                self._record(records, place, offset, sound=True, verified=verified)
            as_it_is = verified and chunk.damage is None and not self._bag.message_compression
            if as_it_is and self._copy(chunk):
                return
            messages = chunk.messages
            starts = (messages.start - MESSAGE_HEAD.size).tolist()
            for start, end in zip(starts, messages.end.tolist(), strict=True):
                self._message(records[start:end], offset, self._sound)
            return
        used = 0
        for place in chunk.walk():
            if place.damage is not None and sound:
                # elsewhere it is what the damage of the chunk has made
                self.damages.add(offset, place.name, place.damage)
            if place.readable:
                used += place.end - place.offset
                believed = sound and place.damage is None
                self._record(records, place, offset, sound=believed, verified=verified)
        packed = chunk.place.end - chunk.place.start
        self.bytes_lost += packed * (len(records) - used) // len(records) if records else packed

    def _copy(self, chunk: OpenChunk) -> bool:
        """Write a chunk as it is, if it needs no other numbers and is worth it; say whether."""
        record, times_ns = chunk.chunk, chunk.times_ns
        if record is None or times_ns is None or not has_end(record):
            return False
        if not record.compression and len(record.data) < CHUNK_RANGE[0]:  # a small one
            return False
        entries = chunk.entries()
        if not self._declared.channels.keys() >= entries.keys():
            return False
        inside = [read(chunk.records, place) for place in chunk.others]
        for number in {*entries, *(it.id for it in inside if isinstance(it, Channel))}:
            if self._sound.number(number, self._declared) != number:
                return False
        if not all(self._sound.writer.says(it) for it in inside):
            return False
        first, last = times_ns
        self._sound.writer.add_chunk(
            replace(record, message_start_time=first, message_end_time=last), entries
        )
        self._sound.messages += len(chunk.messages)
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
