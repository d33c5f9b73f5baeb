# SPDX-License-Identifier: Apache-2.0
"""
Writing MCAP files that any tool for ROS 2 reads.

Profile `ros2`, full message definitions, log time = time of arrival,
publish time = stamp.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from enum import Enum
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self
from uuid import uuid4

import lz4.frame
import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap import records as mcap
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

from shipdrag_ros import __version__
from shipdrag_ros.bags.contents import DECLARED, INDEXES, RECORDING, FileSummary, key_of
from shipdrag_ros.bags.message_index import CHANNELS
from shipdrag_ros.bags.records import HEAD, MAGIC, MESSAGE_HEAD
from shipdrag_ros.errors import BagError, disk_errors
from shipdrag_ros.messages import OUTPUT_TOPICS, EncodedMessage, encode, types
from shipdrag_ros.samples import Block, Int64

PROFILE = 'ros2'
LIBRARY = f'shipdrag_ros {__version__}'

# as rosbag2 writes it; a player needs it to latch the topic again
_LATCHED_QOS = """\
- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: automatic
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
_LATCHED = {(topic.name, topic.type) for topic in OUTPUT_TOPICS if topic.latched}


def attachment(name: str, text: str) -> mcap.Attachment:
    """Return the record of an attached text."""
    kind = 'application/yaml' if name.endswith('.yaml') else 'text/plain'
    return mcap.Attachment(0, 0, name, kind, text.encode())


def as_bytes(*records: Any) -> bytes:
    """Return records of `mcap.records` as they stand in a file."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


_NUMBERED = struct.Struct('<BQH')  # opcode, length, channel
CHUNK_RANGE = 1 << 14, 1 << 20
"""Least and most bytes of a chunk before it is packed."""


def private_opener(path: str, flags: int) -> int:
    """Make a file for `open`: not readable by everybody, never through a link, and locked."""
    file = os.open(path, flags | os.O_NOFOLLOW, 0o640)
    with suppress(OSError):  # not every file system has locks
        flock(file, LOCK_EX | LOCK_NB)
    return file


def sync_directory(path: Path) -> None:
    """Bring the names in a directory to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class Compression(Enum):
    """How the chunks of a file are compressed."""

    NONE = ''
    LZ4 = 'lz4'
    ZSTD = 'zstd'


_PACKERS: dict[Compression, Callable[[bytes], bytes]] = {
    Compression.NONE: bytes,
    Compression.LZ4: lz4.frame.compress,
    Compression.ZSTD: zstandard.compress,
}


def content_of(number: int, message: EncodedMessage) -> bytes:
    """Return the content of the record of a message, by the number of its channel."""
    # a stamp before 1970 has no place here; the message itself keeps it
    publish_ns = max(message.publish_ns, 0)
    return MESSAGE_HEAD.pack(number, 0, message.log_ns, publish_ns) + message.payload


class NameTakenError(BagError):
    """A file of this name is there already."""


class RecordWriter:
    """
    Writes an MCAP file; a context manager.

    Parameters
    ----------
    path
        File to make; one that exists is never overwritten.
    compression
        Of the chunks.
    profile
        Of the messages.
    chunk_bytes
        Size of each chunk before it is packed [bytes]; 0: a 64th of all so far, within
        `CHUNK_RANGE`, so that a damage costs little and a long bag is read quickly.

    Attributes
    ----------
    size_bytes
        Written so far.

    Raises
    ------
    NameTakenError
        If the file exists.
    BagError
        If it cannot be made.
    """

    indexed = True
    """Whether each chunk is listed, for an index at the end; not of a file that grows."""

    def __init__(
        self,
        path: Path,
        *,
        compression: Compression = Compression.ZSTD,
        profile: str = PROFILE,
        chunk_bytes: int = 0,
    ) -> None:
        self.path = Path(path)
        self._compression = compression
        self._chunk_bytes = chunk_bytes
        self._room = chunk_bytes or CHUNK_RANGE[0]
        self._chunk = bytearray()
        self._times = 0, 0  # first and last of the chunk [ns]
        self._entries: dict[int, list[int]] = {}  # of its index: time and offset, by channel
        self._numbers: dict[bytes, int] = {}
        self._summary = FileSummary()
        self._unpacked = self.size_bytes = 0
        try:
            # of one that grows, what could not be written must not be tried again on closing
            buffering = -1 if self.indexed else 0
            self._file = open(path, 'xb', buffering, opener=private_opener)  # noqa: SIM115
        except FileExistsError:
            raise NameTakenError(
                f'{str(path)!r} exists; choose another name or remove it'
            ) from None
        except OSError as error:
            raise BagError(
                f'{str(path)!r} cannot be made: {error.strerror}; '
                'give a name in a folder that is there and may be written'
            ) from error
        self._write(MAGIC + as_bytes(mcap.Header(profile, LIBRARY)))

    def declare(self, channel: mcap.Channel, schema: mcap.Schema | None) -> int:
        """
        Write a channel and its schema, unless they are there; return its number.

        Parameters
        ----------
        channel, schema
            Their own numbers are kept where they are free; 0 is none.
        """
        number = 0 if schema is None else self._number(schema)
        return self._number(replace(channel, schema_id=number))

    def says(self, record: mcap.Schema | mcap.Channel) -> bool:
        """Say whether exactly this was declared, with its number."""
        return bool(self._summary.records.get(key_of(record)) == record)

    def _number(self, record: mcap.Schema | mcap.Channel) -> int:
        """Keep the number of a record where it is free, and give it another where not."""
        key = as_bytes(replace(record, id=0))
        if key not in self._numbers:
            taken = self._summary.records
            if not record.id or key_of(record) in taken:
                free = (n for n in range(1, CHANNELS) if (type(record), n) not in taken)
                record = replace(record, id=next(free))
            self._summary.add(record)
            self._numbers[key] = record.id
            # outside of chunks: any chunk may be damaged and the others sound
            self._write(as_bytes(record))
        return self._numbers[key]

    def add_content(self, number: int, content: bytes, *, log_ns: int) -> None:
        """
        Write a message of a channel that was declared.

        Parameters
        ----------
        number
            Of the channel here.
        content
            Of its record, here or in another file; the number in it is not used.
        log_ns
            Its time of arrival [ns since the epoch].
        """
        chunk = self._chunk
        if not chunk:
            self._times = log_ns, log_ns
        elif log_ns < self._times[0] or log_ns > self._times[1]:
            self._times = min(self._times[0], log_ns), max(self._times[1], log_ns)
        self._entries.setdefault(number, []).extend((log_ns, len(chunk)))
        chunk += _NUMBERED.pack(Opcode.MESSAGE, len(content), number)
        chunk += content[2:]
        if len(chunk) >= self._room:
            self._end_chunk()

    def add(self, record: mcap.Attachment | mcap.Metadata) -> None:
        """
        Write an attachment or metadata, before the first message if it is to survive a crash.
        """
        written = as_bytes(record)
        self._summary.add_indexed(record, self.size_bytes, len(written))
        self._write(written)

    def close(self) -> None:
        """
        Write the index and bring everything to the disk; again is harmless.

        Raises
        ------
        BagError
            If the disk does not take it.
        """
        if self._file.closed:
            return
        try:
            self._end_chunk()
            self._write(as_bytes(mcap.DataEnd(0)))
            listed = self._summary.of(*DECLARED) + self._summary.of(*INDEXES)
            summary = as_bytes(*listed, self._summary.statistics())
            start = self.size_bytes
            # its checksum covers the footer too, up to itself
            covered = summary + as_bytes(mcap.Footer(start, 0, 0))[:-4]
            self._write(covered + struct.pack('<I', crc32(covered)) + MAGIC)
            with disk_errors(self.path, 'written'):
                self._file.flush()
                os.fsync(self._file.fileno())
        finally:
            with suppress(OSError):
                self._file.close()

    def _end_chunk(self) -> None:
        if not self._chunk:
            return
        records, (first_ns, last_ns) = bytes(self._chunk), self._times
        packed, kind = _PACKERS[self._compression](records), self._compression.value
        chunk = mcap.Chunk(kind, packed, last_ns, first_ns, crc32(records), len(records))
        entries = {number: np.array(each, np.int64) for number, each in self._entries.items()}
        self._chunk.clear()
        self._entries.clear()
        self.add_chunk(chunk, entries)

    def add_chunk(self, chunk: mcap.Chunk, entries: Mapping[int, Int64]) -> None:
        """
        Write a chunk as it is, behind what was added before.

        Parameters
        ----------
        chunk
            Of messages whose channels were declared by the numbers that they have in it.
        entries
            Log time [ns] and offset of each message in it, in turn, by channel.
        """
        self._end_chunk()
        at, record = self.size_bytes, as_bytes(chunk)
        self._write(record)
        if not self.indexed:
            return
        index = self._summary.add_indexed(chunk, at, len(record))
        counts = {number: each.size // 2 for number, each in entries.items()}
        self._summary.count(counts, chunk.message_start_time, chunk.message_end_time)
        for number, each in entries.items():
            index.message_index_offsets[number] = self.size_bytes
            listed = each.tobytes()
            head = HEAD.pack(Opcode.MESSAGE_INDEX, 6 + len(listed))
            self._write(head + struct.pack('<HI', number, len(listed)) + listed)
        index.message_index_length = self.size_bytes - at - len(record)
        self._unpacked += chunk.uncompressed_size
        least, most = CHUNK_RANGE
        self._room = self._chunk_bytes or min(max(self._unpacked >> 6, least), most)

    def _write(self, data: bytes) -> None:
        left = memoryview(data)
        with disk_errors(self.path, 'written'):
            while left:
                left = left[self._file.write(left) :]
        self.size_bytes += len(data)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class BagWriter(RecordWriter):
    """
    Writes a recording of types that are known.

    Parameters
    ----------
    path, compression, chunk_bytes
        As of `RecordWriter`.
    recording_id, part
        Files of one recording carry the same id and are numbered from 0; by
        default the file is a recording of its own.
    attachments
        Text by name.
    """

    def __init__(
        self,
        path: Path,
        *,
        compression: Compression = Compression.ZSTD,
        chunk_bytes: int = 0,
        recording_id: str = '',
        part: int = 0,
        attachments: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        super().__init__(path, compression=compression, chunk_bytes=chunk_bytes)
        self._channels: dict[tuple[str, str], int] = {}
        about = {'version': __version__, 'recording_id': recording_id or uuid4().hex}
        self.add(mcap.Metadata(RECORDING, {**about, 'part': str(part)}))
        for name, text in attachments.items():
            self.attach(name, text)

    def attach(self, name: str, text: str) -> None:
        """Write a text file into the bag, before the first message if it is to survive a crash."""
        self.add(attachment(name, text))

    def write_samples(self, block: Block) -> None:
        """
        Write samples as messages, each on the topic of its input.

        Raises
        ------
        BagError
            If the file cannot be written.
        """
        for message in encode(block):
            self.put(message)

    def put(self, message: EncodedMessage) -> None:
        """
        Write one message.

        Raises
        ------
        BagError
            If the type is not known or the file cannot be written.
        """
        number = self.register(message.topic, message.type)
        self.add_content(number, content_of(number, message), log_ns=message.log_ns)

    def register(self, topic: str, type_name: str) -> int:
        """
        Make a topic known, at its first message or before; return the number of its channel.

        Raises
        ------
        BagError
            If the definition of the type is not known.
        """
        key = (topic, type_name)
        if key in self._channels:
            return self._channels[key]
        if not types.is_known(type_name):
            raise BagError(f'{type_name!r} is no message type of ROS 2 Jazzy that is known')
        latched = (topic.rpartition('/')[2], type_name) in _LATCHED
        metadata = {
            'offered_qos_profiles': _LATCHED_QOS if latched else '',
            'topic_type_hash': types.type_hash(type_name),
        }
        channel = mcap.Channel(0, topic, 'cdr', metadata, 0)
        text = types.definition(type_name).encode()
        schema = mcap.Schema(id=0, name=type_name, encoding='ros2msg', data=text)
        self._channels[key] = self.declare(channel, schema)
        return self._channels[key]


@contextmanager
def new_bag(out: Path, attachments: Mapping[str, str]) -> Iterator[BagWriter]:
    """
    Open a bag to write into; where that fails, none is left.

    Parameters
    ----------
    out
        MCAP file to make.
    attachments
        Text by name, a ship file for instance.

    Raises
    ------
    BagError
        If the bag cannot be made.
    """
    writer = BagWriter(out)
    try:
        with writer:
            for name, text in attachments.items():
                writer.attach(name, text)
            yield writer
    except BaseException:
        out.unlink(missing_ok=True)
        raise
