# SPDX-License-Identifier: Apache-2.0
"""
Salvage of a damaged bag: every whole message into a sound one.

Messages of a chunk that is cut off or has a wrong checksum, messages whose bounds are
inferred, and those of topics that are not known, go into a bag of their own, so that
nothing doubtful is taken for data. Sound chunks are copied as they are. A finished part
is made compact in the same way: its name holds a whole file at every moment.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import zstandard
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema

from shipdrag_ros.bags import records, writer
from shipdrag_ros.bags.contents import FileSummary
from shipdrag_ros.bags.mcap_file import BagFiles, locate, mapped, unpacked_file
from shipdrag_ros.bags.records import MAGIC, Buffer, Damage, DamageKind, DamageList, OpenChunk
from shipdrag_ros.bags.writer import RecordWriter, as_bytes, sync_directory
from shipdrag_ros.errors import BagError, disk_errors
from shipdrag_ros.progress import PartDone


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
    source: Path,
    output: Path,
    *,
    attachments: Mapping[str, str] = MappingProxyType({}),
    progress: PartDone = lambda done, total: None,
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
    attachments
        Text by name, in place of those of the source.
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
    with _salvaged(bags[0], output, progress, attachments) as salvage:
        sound, doubtful, damages = salvage.sound, salvage.doubtful, salvage.damages
        if not salvage.records:
            raise BagError(
                f'{str(source)!r} holds no record of MCAP, nothing can be saved; give a .mcap file'
            )
        for name, text in attachments.items():
            sound.writer.add(writer.attachment(name, text))
        sound.publish()
        if doubtful.used:
            doubtful.publish()
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
    output = path.with_name(path.name + SUFFIX)
    with disk_errors(path, 'compacted'):
        output.unlink(missing_ok=True)  # what earlier versions left when they were killed
    with disk_errors(path, 'compacted'), _salvaged(BagFiles(str(path), (path,)), output) as it:
        if it.sound.messages != messages or it.doubtful.used:
            raise BagError(
                f'{str(path)!r} cannot be compacted: it holds {it.sound.messages} sound '
                f'messages, {messages} were written'
            )
        it.sound.writer.close()
        it.sound.part.replace(path)
        sync_directory(path.parent)


@contextmanager
def _salvaged(
    bag: BagFiles,
    output: Path,
    progress: PartDone = lambda done, total: None,
    replaced: Collection[str] = (),
) -> Iterator[_Salvage]:
    """Save what can be saved of a bag, into files that vanish unless they are published."""
    quarantine = output.with_suffix('.quarantine.mcap')
    with _Salvaged(output, replaced) as sound, _Salvaged(quarantine) as doubtful:
        salvage = _Salvage(sound, doubtful, bag)
        for file in bag.files:
            salvage.take(file, progress)
        yield salvage


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
    unpacked = unpacked_file(path, damages)
    with unpacked or nullcontext(), mapped(path, unpacked) as data:
        if not data:
            damages.add(0, 'file', DamageKind.TRUNCATED, 'it is empty')
        yield data


def _declared(data: Buffer) -> FileSummary:
    """Return the schemas and channels that stand outside of chunks, wherever they do."""
    declared = FileSummary()
    footer = records.footer_of(data)
    begin = len(data)
    if footer is not None and footer.summary_crc and records.summary_agrees(data, footer):
        begin = footer.summary_start
    for place in records.walk(data, 0, len(data)):
        if place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and place.damage is None:
            record = records.read(data, place)
            if record is not None:
                declared.add(record, verified=place.offset >= begin)
    return declared


class _Salvaged:
    """A bag that is there as a whole, or not at all; nothing is overwritten."""

    def __init__(self, path: Path, replaced: Collection[str] = ()) -> None:
        self.path = path
        self.part = path.with_name(f'.{path.name}.part')
        self.profile = 'ros2'
        self.messages = 0
        self.numbers: dict[int, int] = {}
        self.used = False  # whether anything was written
        self._replaced = replaced  # names of attachments that are not taken
        self._written: set[bytes] = set()
        if path.exists():
            raise BagError(f'{str(path)!r} exists; choose another name or remove it')

    @cached_property
    def writer(self) -> RecordWriter:
        """Makes the file when it is first needed."""
        with suppress(OSError):
            self.part.unlink()  # of an attempt that was killed
        made = RecordWriter(self.part, profile=self.profile)
        self.used = True
        return made

    def number(self, number: int, declared: FileSummary) -> int:
        """Return the number here of a channel of the source, known or not."""
        if number not in self.numbers:
            stranger = Channel(number, f'/unknown_channel_{number}', 'cdr', {}, 0)
            channel = declared.records.get((Channel, number), stranger)
            schema = declared.records.get((Schema, channel.schema_id))
            self.numbers[number] = self.writer.declare(channel, schema)
        return self.numbers[number]

    def once(self, record: Attachment | Metadata) -> None:
        """Write an attachment or metadata; those of several parts are often the same."""
        key = as_bytes(record)
        if key not in self._written and record.name not in self._replaced:
            self._written.add(key)
            self.writer.add(record)

    def publish(self) -> None:
        """Give the file its name."""
        self.writer.close()
        try:
            self.path.hardlink_to(self.part)  # which never replaces a file, as a rename does
        except FileExistsError:
            raise BagError(f'{str(self.path)!r} exists; choose another name') from None
        except OSError:  # a file system without such links
            self.part.rename(self.path)
        sync_directory(self.path.parent)

    def __enter__(self) -> _Salvaged:
        return self

    def __exit__(self, *error: object) -> None:
        if self.used:
            with suppress(BagError):
                self.writer.close()
            with suppress(OSError):
                self.part.unlink()


class _Salvage:
    """One pass over the files of a bag."""

    def __init__(self, sound: _Salvaged, doubtful: _Salvaged, bag: BagFiles) -> None:
        self.damages = DamageList()
        self.bytes_read = self.bytes_lost = self.records = 0
        self.sound, self.doubtful = sound, doubtful
        self._bag = bag
        self._declared = FileSummary()
        for warning in bag.warnings:
            self.damages.add(0, 'file', DamageKind.MISSING, warning)

    def take(self, file: Path, progress: PartDone) -> None:
        """Write what can be saved of a file."""
        self.damages.file = file.name if len(self._bag.files) > 1 else ''
        with opened(file, self.damages) as data:
            self.bytes_read += len(data)
            self._declared = _declared(data)
            self._forget()
            for found in records.scan(data, self.damages, partly=True):
                place, item, sound = found
                if isinstance(item, OpenChunk):
                    progress(place.offset, len(data))
                    self._chunk(item, sound=sound)
                elif place.readable:
                    self._record(data, found, place.offset)
                elif place.damage is not None or place.opcode != records.GARBAGE:
                    self.bytes_lost += place.end - place.offset
            if self.sound.used:
                for channel in self._declared.of(Channel):  # also those without a message
                    self.sound.number(channel.id, self._declared)
            if data[-len(MAGIC) :] != MAGIC:
                self.damages.add(len(data), 'footer', DamageKind.MISSING)

    def _forget(self) -> None:
        self.sound.numbers.clear()
        self.doubtful.numbers.clear()

    def _chunk(self, chunk: OpenChunk, *, sound: bool) -> None:
        unpacked, offset, used = chunk.records, chunk.place.offset, 0
        inside = []
        for found in chunk.scan(self.damages, sound=sound):
            if found.place.readable:
                used += found.place.end - found.place.offset
                inside += [] if found.place.opcode == Opcode.MESSAGE else [found.item]
                self._record(unpacked, found, offset, verified=chunk.verified)
        if not (sound and chunk.whole):
            packed, size = chunk.place.end - chunk.place.start, len(unpacked) or 1
            self.bytes_lost += packed * (size - used) // size
        elif not self._copy(chunk, inside):
            messages = chunk.indexed.messages
            starts = (messages.start - records.MESSAGE_HEAD.size).tolist()
            for start, end in zip(starts, messages.end.tolist(), strict=True):
                self._message(unpacked[start:end], offset, self.sound)

    def _copy(self, chunk: OpenChunk, inside: list[Any]) -> bool:
        """Write a chunk as it is, if it needs no other numbers and is worth it; say whether."""
        record, bag, known = chunk.chunk, self.sound, self._declared.records
        times_ns = chunk.times_ns
        if record is None or times_ns is None or self._bag.message_compression:
            return False
        if not chunk.verified or chunk.damage is not None or not chunk.ended:
            return False
        if not record.compression and len(record.data) < writer.CHUNK_RANGE[0]:  # a small one
            return False
        entries, (first, last) = chunk.entries(), times_ns
        numbers = {*entries, *(it.id for it in inside if isinstance(it, Channel))}
        if any((Channel, it) not in known for it in entries) or any(
            bag.number(it, self._declared) != it for it in numbers
        ):
            return False
        if not all(it is not None and bag.writer.says(it) for it in inside):
            return False
        bag.writer.add_chunk(
            replace(record, message_start_time=first, message_end_time=last), entries
        )
        bag.messages += len(chunk.indexed.messages)
        return True

    def _record(
        self, data: Buffer, found: records.FoundRecord, offset: int, *, verified: bool = False
    ) -> None:
        self.records += 1
        place, record, sound = found
        bag = self.sound if sound else self.doubtful
        match record:
            case None if place.opcode == Opcode.MESSAGE:
                self._message(data[place.start : place.end], offset, bag)
            case Schema() | Channel():
                if not self._declared.add(record, verified=verified) and sound:
                    self.damages.add(offset, place.name, DamageKind.DISAGREES)
                self._forget()
            case Header():
                self.sound.profile = self.doubtful.profile = record.profile
            case Attachment() | Metadata():
                bag.once(record)

    def _message(self, content: bytes, offset: int, bag: _Salvaged) -> None:
        head = records.MESSAGE_HEAD
        channel, _, log_ns, _ = head.unpack_from(content)
        if log_ns >= records.TIME_LIMIT_NS:  # no reader takes it
            self._lose(content, offset, DamageKind.CONTENT, f'log time {log_ns}')
            return
        if (Channel, channel) not in self._declared.records:
            bag = self.doubtful
            if channel not in bag.numbers:  # said once; a thousand messages may be of it
                self.damages.add(offset, 'message', DamageKind.REFERENCE, f'channel {channel}')
        if self._bag.message_compression:
            try:
                payload = records.unpack_zstd(content[head.size :], records.CHUNK_LIMIT_BYTES)
            except (zstandard.ZstdError, ValueError, MemoryError):
                self._lose(content, offset, DamageKind.COMPRESSION)
                return
            content = content[: head.size] + payload
        number = bag.numbers.get(channel) or bag.number(channel, self._declared)
        bag.writer.add_content(number, content, log_ns=log_ns)
        bag.messages += 1

    def _lose(self, content: bytes, offset: int, why: DamageKind, detail: str = '') -> None:
        self.damages.add(offset, 'message', why, detail)
        self.bytes_lost += records.HEAD.size + len(content)
