# SPDX-License-Identifier: Apache-2.0
"""
Writing MCAP files that any tool for ROS 2 reads.

Profile `ros2`, full message definitions, log time = time of arrival,
publish time = stamp.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from enum import Enum
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self
from uuid import uuid4

from mcap.records import Attachment, Channel, Schema
from mcap.writer import CompressionType, Writer

from shipdrag_ros.bags.declarations import (
    LIBRARY,
    PROFILE,
    as_bytes,
    attachment,
    channel,
    metadata,
    schema,
)
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import encode
from shipdrag_ros.samples import Block

CHUNK_BYTES = 1 << 20
METADATA = 'shipdrag_ros'
"""Name of the metadata record that says which recording a file is part of."""


def private_opener(path: str, flags: int) -> int:
    """
    Open a file that is made: not readable by everybody, and never through a link.

    Parameters
    ----------
    path, flags
        As `open` hands them to its `opener`.
    """
    return os.open(path, flags | os.O_NOFOLLOW, 0o640)


class Compression(Enum):
    """How the chunks of a file are compressed."""

    NONE = 'none'
    LZ4 = 'lz4'
    ZSTD = 'zstd'


_MCAP_COMPRESSION = {
    Compression.NONE: CompressionType.NONE,
    Compression.LZ4: CompressionType.LZ4,
    Compression.ZSTD: CompressionType.ZSTD,
}


class RecordWriter:
    """
    Writes the records of an MCAP file; a context manager.

    Parameters
    ----------
    path
        File to make; one that exists is never overwritten.
    compression
        Of the chunks.
    chunk_bytes
        Messages are written in chunks of this size [bytes], not before they are full.
    profile
        Of the messages.

    Raises
    ------
    BagError
        If the file exists or cannot be made.
    """

    def __init__(
        self,
        path: Path,
        *,
        compression: Compression = Compression.ZSTD,
        chunk_bytes: int = CHUNK_BYTES,
        profile: str = PROFILE,
    ) -> None:
        self.path = Path(path)
        self._numbers: dict[bytes, int] = {}
        try:
            self._file = open(self.path, 'xb', opener=private_opener)  # noqa: SIM115
        except FileExistsError:
            raise BagError(f'{str(path)!r} exists; choose another name or remove it') from None
        except OSError as error:
            raise BagError(
                f'{str(path)!r} cannot be made: {error.strerror}; '
                'give a name in a folder that is there and may be written'
            ) from error
        self._writer = Writer(
            self._file, chunk_size=chunk_bytes, compression=_MCAP_COMPRESSION[compression]
        )
        self._writer.start(profile=profile, library=LIBRARY)

    def declare(self, channel: Channel, schema: Schema | None) -> int:
        """
        Write a channel and its schema, unless they are there; return its number.

        Parameters
        ----------
        channel, schema
            Their own numbers do not count.
        """
        with self.errors_named():
            number = 0
            if schema is not None:
                texts = schema.name, schema.encoding, schema.data
                register = partial(self._writer.register_schema, *texts)
                number = self._number(replace(schema, id=0), register)
            register = partial(
                self._writer.register_channel,
                channel.topic,
                channel.message_encoding,
                number,
                channel.metadata,
            )
            return self._number(replace(channel, id=0, schema_id=number), register)

    def _number(self, record: Schema | Channel, register: Callable[[], int]) -> int:
        key = as_bytes(record)
        if key not in self._numbers:
            number = self._numbers[key] = register()
            # outside of chunks too: the first chunk may be damaged and the others sound
            self._file.write(as_bytes(replace(record, id=number)))
        return self._numbers[key]

    def add(
        self, number: int, payload: bytes, *, log_ns: int, publish_ns: int, sequence: int = 0
    ) -> None:
        """
        Write a message of a channel that was declared.

        Parameters
        ----------
        number
            Of the channel.
        payload
            CDR bytes.
        log_ns, publish_ns
            Time of arrival and of measurement [ns since the epoch].
        sequence
            Of the publisher.
        """
        with self.errors_named():
            self._writer.add_message(number, log_ns, payload, publish_ns, sequence)

    def add_attachment(self, attached: Attachment) -> None:
        """
        Write an attachment, before the first message if it is to survive a crash.
        """
        with self.errors_named():
            self._writer.add_attachment(
                attached.create_time,
                attached.log_time,
                attached.name,
                attached.media_type,
                attached.data,
            )

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """
        Write metadata.
        """
        with self.errors_named():
            self._writer.add_metadata(name, dict(values))

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
            with self.errors_named():
                self._writer.finish()
                self._file.flush()
                os.fsync(self._file.fileno())
        finally:
            with suppress(OSError):
                self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @contextmanager
    def errors_named(self) -> Iterator[None]:
        """
        Say which file it is that the disk does not take.
        """
        try:
            yield
        except OSError as error:
            raise BagError(f'{str(self.path)!r} cannot be written: {error.strerror}') from error


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
    """

    def __init__(
        self,
        path: Path,
        *,
        compression: Compression = Compression.ZSTD,
        chunk_bytes: int = CHUNK_BYTES,
        recording_id: str | None = None,
        part: int = 0,
    ) -> None:
        super().__init__(path, compression=compression, chunk_bytes=chunk_bytes)
        self._channels: dict[tuple[str, str], int] = {}
        self.add_metadata(METADATA, metadata(recording_id or uuid4().hex, part))

    def attach(self, name: str, text: str) -> None:
        """
        Write a text file into the bag, before the first message if it is to survive a crash.
        """
        self.add_attachment(attachment(name, text))

    def register(self, topic: str, type_name: str) -> None:
        """
        Make a topic known before its first message, or without any.

        Raises
        ------
        BagError
            If the definition of the type is not known.
        """
        self._channel(topic, type_name)

    def write(
        self, topic: str, type_name: str, payload: bytes, *, log_ns: int, publish_ns: int
    ) -> None:
        """
        Write one message.

        Parameters
        ----------
        topic, type_name
            Full names, `/shaft` and `sensor_msgs/msg/JointState` for instance.
        payload
            CDR bytes.
        log_ns
            Time of arrival [ns since the epoch].
        publish_ns
            Time of measurement [ns since the epoch].

        Raises
        ------
        BagError
            If the type is not known or the file cannot be written.
        """
        # a stamp before 1970 has no place here; the message itself keeps it
        number = self._channel(topic, type_name)
        self.add(number, payload, log_ns=log_ns, publish_ns=max(publish_ns, 0))

    def write_samples(self, block: Block) -> None:
        """
        Write samples as messages, each on the topic of its input.

        Raises
        ------
        BagError
            If the file cannot be written.
        """
        for message in encode(block):
            self.write(
                message.topic,
                message.type,
                message.payload,
                log_ns=message.log_ns,
                publish_ns=message.publish_ns,
            )

    def _channel(self, topic: str, type_name: str) -> int:
        key = (topic, type_name)
        if key not in self._channels:
            declared = channel(0, topic, type_name, schema_id=0)
            self._channels[key] = self.declare(declared, schema(0, type_name))
        return self._channels[key]
