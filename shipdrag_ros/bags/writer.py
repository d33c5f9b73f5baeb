# SPDX-License-Identifier: Apache-2.0
"""
Writing MCAP files that any tool for ROS 2 reads.

Profile `ros2`, full message definitions, log time = time of arrival,
publish time = stamp.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import Self
from uuid import uuid4

from mcap.writer import CompressionType, Writer

from shipdrag_ros.bags.declarations import (
    LIBRARY,
    PROFILE,
    as_bytes,
    channel,
    media_type,
    metadata,
    schema,
)
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import encode
from shipdrag_ros.samples import Block

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


class BagWriter:
    """
    Writes one MCAP file; a context manager.

    Parameters
    ----------
    path
        File to make; one that exists is never overwritten.
    compression
        Of the chunks.
    chunk_bytes
        Messages are written in chunks of this size [bytes], not before they are full.
    recording_id, part
        Files of one recording carry the same id and are numbered from 0; by
        default the file is a recording of its own.

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
        chunk_bytes: int = 1 << 20,
        recording_id: str | None = None,
        part: int = 0,
    ) -> None:
        self.path = Path(path)
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str], int] = {}
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
        self._writer.start(profile=PROFILE, library=LIBRARY)
        self._writer.add_metadata(METADATA, metadata(recording_id or uuid4().hex, part))

    def attach(self, name: str, text: str) -> None:
        """
        Write a text file into the bag, before the first message if it is to survive a crash.
        """
        with self._errors_named():
            self._writer.add_attachment(
                create_time=0,
                log_time=0,
                name=name,
                media_type=media_type(name),
                data=text.encode(),
            )

    def register(self, topic: str, type_name: str) -> None:
        """
        Make a topic known before its first message, or without any.

        Raises
        ------
        BagError
            If the definition of the type is not known.
        """
        with self._errors_named():
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
        with self._errors_named():
            self._writer.add_message(
                self._channel(topic, type_name),
                log_time=log_ns,
                data=payload,
                # a stamp before 1970 has no place here; the message itself keeps it
                publish_time=max(publish_ns, 0),
            )

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
            with self._errors_named():
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
    def _errors_named(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise BagError(f'{str(self.path)!r} cannot be written: {error.strerror}') from error

    def _channel(self, topic: str, type_name: str) -> int:
        key = (topic, type_name)
        if key not in self._channels:
            schema_id = self._schema(type_name)
            made = channel(len(self._channels) + 1, topic, type_name, schema_id=schema_id)
            # outside of chunks too: the first chunk may be damaged and the others sound
            self._file.write(as_bytes(made))
            self._channels[key] = self._writer.register_channel(
                made.topic, made.message_encoding, made.schema_id, made.metadata
            )
        return self._channels[key]

    def _schema(self, type_name: str) -> int:
        if type_name not in self._schemas:
            made = schema(len(self._schemas) + 1, type_name)
            self._file.write(as_bytes(made))
            self._schemas[type_name] = self._writer.register_schema(
                made.name, made.encoding, made.data
            )
        return self._schemas[type_name]
