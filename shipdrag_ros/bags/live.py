# SPDX-License-Identifier: Apache-2.0
"""
A recording while it grows: nothing in it depends on how it ends.

What distinguishes the messages comes first and comes again; each write is a chunk
of its own with a checksum; no index is kept, so that it takes no memory.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from fcntl import LOCK_EX, LOCK_NB, flock
from itertools import starmap
from pathlib import Path

from isal.isal_zlib import crc32
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Channel,
    Chunk,
    DataEnd,
    Footer,
    Header,
    Message,
    Metadata,
    Schema,
)

from shipdrag_ros.bags.records import MAGIC
from shipdrag_ros.bags.writer import (
    LIBRARY,
    METADATA,
    PROFILE,
    as_bytes,
    attachment,
    channel,
    metadata,
    private_opener,
    schema,
)
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import EncodedMessage

DECLARE_BYTES = 1 << 20  # topics are declared anew behind so much


class NameTakenError(BagError):
    """A file of this name is there already."""


class LiveFile:
    """
    An MCAP file that is safe up to its last `sync`, and locked until its `release`.

    Parameters
    ----------
    path
        File to make; one that exists is never overwritten.
    recording_id, part
        Files of one recording carry the same id and are numbered from 0.
    attachments
        Text by name.

    Attributes
    ----------
    size_bytes
        Written so far.
    synced_bytes, synced_messages
        Of these, safe when the power goes.

    Raises
    ------
    NameTakenError
        If the file exists.
    BagError
        If it cannot be made.
    """

    def __init__(
        self, path: Path, *, recording_id: str, part: int, attachments: Mapping[str, str]
    ) -> None:
        self.path = path
        self.size_bytes = self.synced_bytes = self.synced_messages = 0
        self.first_log_ns: int | None = None
        self._messages = 0
        self._schemas: dict[str, Schema] = {}
        self._channels: dict[tuple[str, str], Channel] = {}
        self._declared_at = 0
        try:
            # unbuffered: what could not be written must not be tried again on closing
            self._file = open(path, 'xb', buffering=0, opener=private_opener)  # noqa: SIM115
            with suppress(OSError):  # not every file system has locks
                flock(self._file, LOCK_EX | LOCK_NB)
        except FileExistsError:
            raise NameTakenError(f'{str(path)!r} exists') from None
        except OSError as error:
            raise BagError(f'{str(path)!r} cannot be made: {error.strerror}') from error
        try:
            self._write(
                MAGIC
                + as_bytes(
                    Header(PROFILE, LIBRARY),
                    Metadata(METADATA, metadata(recording_id, part)),
                )
                + as_bytes(*starmap(attachment, attachments.items()))
            )
            self.sync()
            sync_directory(path.parent)
        except BagError:
            self.abandon()
            raise
        except OSError as error:
            self.abandon()
            raise BagError(f'{str(path)!r} cannot be made: {error.strerror}') from error

    def append(self, messages: Sequence[EncodedMessage]) -> None:
        """
        Write messages as one chunk.

        Raises
        ------
        BagError
            If a type is not known or the disk does not take it.
        """
        new = [record for message in messages for record in self._declare(message)]
        if new:
            self._write(as_bytes(*new))
        if self.size_bytes - self._declared_at > DECLARE_BYTES:
            self._write(as_bytes(*self._schemas.values(), *self._channels.values()))
            self._declared_at = self.size_bytes
        self._write(as_bytes(self._chunk(messages)))
        self._messages += len(messages)
        if self.first_log_ns is None:
            self.first_log_ns = messages[0].log_ns

    def sync(self) -> None:
        """
        Bring what is written to the disk.

        Raises
        ------
        BagError
            If the disk does not take it, or the file is no longer in its place.
        """
        try:
            os.fsync(self._file.fileno())
            if not self.in_place():
                raise BagError(f'{str(self.path)!r} was removed or replaced by somebody else')
        except OSError as error:
            raise BagError(f'{str(self.path)!r}: {error.strerror}') from error
        self.synced_bytes, self.synced_messages = self.size_bytes, self._messages

    def in_place(self) -> bool:
        """
        Say whether the name is still that of this file.
        """
        try:
            there = self.path.stat()
        except FileNotFoundError:
            return False
        return os.path.samestat(os.fstat(self._file.fileno()), there)

    def vanished(self) -> bool:
        """
        Say whether nothing can open the file any more: it was removed, and not moved.
        """
        return os.fstat(self._file.fileno()).st_nlink == 0

    def close(self) -> None:
        """
        Write the end, without an index, and bring everything to the disk.

        Raises
        ------
        BagError
            If the disk does not take it.
        """
        self._write(as_bytes(DataEnd(0), Footer(0, 0, 0)) + MAGIC)
        self.sync()

    def abandon(self) -> None:
        """
        Leave the file as the last `sync` did; without messages, remove it.
        """
        with suppress(OSError):
            self._file.truncate(self.synced_bytes)
        if not self.synced_messages:
            with suppress(OSError):
                if self.in_place():
                    self.path.unlink()
            self.release()

    def release(self) -> None:
        """
        Let others have the file.
        """
        with suppress(OSError):
            self._file.close()

    def _declare(self, message: EncodedMessage) -> list[Schema | Channel]:
        """Return what must be said before this message can be understood."""
        new: list[Schema | Channel] = []
        key = (message.topic, message.type)
        if key not in self._channels:
            if message.type not in self._schemas:
                number = len(self._schemas) + 1
                self._schemas[message.type] = schema(number, message.type)
                new.append(self._schemas[message.type])
            self._channels[key] = channel(
                len(self._channels) + 1, *key, schema_id=self._schemas[message.type].id
            )
            new.append(self._channels[key])
        return new

    def _chunk(self, messages: Sequence[EncodedMessage]) -> Chunk:
        builder = RecordBuilder()
        for message in messages:
            Message(
                channel_id=self._channels[message.topic, message.type].id,
                sequence=0,
                log_time=message.log_ns,
                # a stamp before 1970 has no place here; the message itself keeps it
                publish_time=max(message.publish_ns, 0),
                data=message.payload,
            ).write(builder)
        data = builder.end()
        return Chunk(
            compression='',
            data=data,
            message_start_time=min(message.log_ns for message in messages),
            message_end_time=max(message.log_ns for message in messages),
            uncompressed_crc=crc32(data),
            uncompressed_size=len(data),
        )

    def _write(self, data: bytes) -> None:
        left = memoryview(data)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            raise BagError(f'{str(self.path)!r} cannot be written: {error.strerror}') from error
        self.size_bytes += len(data)


def sync_directory(path: Path) -> None:
    """
    Bring the names in a directory to the disk.
    """
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
