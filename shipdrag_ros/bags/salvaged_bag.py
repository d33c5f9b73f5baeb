# SPDX-License-Identifier: Apache-2.0
"""
The bag that salvage writes: whole under its name, or not there at all.
"""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO

from mcap.records import Attachment, Channel, Metadata
from mcap.writer import Writer

from shipdrag_ros import __version__
from shipdrag_ros.bags.learnt import Learnt
from shipdrag_ros.errors import BagError


class SalvagedBag:
    """
    Writes records of other files as they are, but for the numbers of their channels.

    Parameters
    ----------
    path
        File to make.

    Attributes
    ----------
    profile
        Of the header; to be set before the first record.
    messages
        Written so far.
    used
        Whether anything was written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.profile = 'ros2'
        self.messages = 0
        self._learnt = Learnt()
        self._file: IO[bytes] | None = None
        self._writer: Writer | None = None
        self._channels: dict[int, tuple[Channel | None, int]] = {}
        self._registered: dict[tuple[Hashable, ...], int] = {}

    @property
    def used(self) -> bool:
        return self._writer is not None

    def begin(self, learnt: Learnt) -> None:
        """
        Begin with a file whose channels are known there; it may grow meanwhile.
        """
        self._learnt = learnt
        self._channels = {}

    def declare(self) -> None:
        """
        Write the channels of the file at hand that have no message.
        """
        with self._errors_told():
            for number, channel in self._learnt.channels.items():
                if number not in self._channels:
                    self._register(number, channel)

    def write(
        self, number: int, payload: bytes, *, sequence: int, log_ns: int, publish_ns: int
    ) -> None:
        """
        Write a message of a channel of the source.

        A channel that is not known is called `/unknown_channel_NUMBER`.
        """
        with self._errors_told():
            writer = self._open()
            channel = self._learnt.channel(number)
            known = self._channels.get(number)
            if known is None or known[0] is not channel:
                known = self._channels[number] = channel, self._register(number, channel)
            writer.add_message(known[1], log_ns, payload, publish_ns, sequence)
        self.messages += 1

    def attach(self, attachment: Attachment) -> None:
        """
        Write an attachment.
        """
        with self._errors_told():
            self._open().add_attachment(
                attachment.create_time,
                attachment.log_time,
                attachment.name,
                attachment.media_type,
                attachment.data,
            )

    def describe(self, metadata: Metadata) -> None:
        """
        Write a metadata record.
        """
        with self._errors_told():
            self._open().add_metadata(metadata.name, metadata.metadata)

    def publish(self) -> None:
        """
        Bring the file to the disk, then give it its name.

        Raises
        ------
        BagError
            If the name is taken meanwhile, or the disk does not take the file.
        """
        with self._errors_told():
            writer = self._open()
            assert self._file is not None
            writer.finish()
            self._file.flush()
            os.fsync(self._file.fileno())
            os.link(self._file.name, self.path)  # which never replaces a file, as a rename does
            folder = os.open(self.path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)

    def discard(self) -> None:
        """
        Remove the temporary file.
        """
        if self._file is not None:
            self._file.close()
            self._file = None

    def _open(self) -> Writer:
        if self._writer is None:
            self._file = NamedTemporaryFile(  # noqa: SIM115 (closed by discard)
                dir=self.path.parent, prefix=f'.{self.path.name}.', suffix='.part'
            )
            self._writer = Writer(self._file)
            self._writer.start(profile=self.profile, library=f'shipdrag_ros {__version__}')
        return self._writer

    def _register(self, number: int, channel: Channel | None) -> int:
        writer = self._open()
        if channel is None:
            return int(writer.register_channel(f'/unknown_channel_{number}', '', 0, {}))
        schema_id = self._schema(channel.schema_id)
        metadata = tuple(sorted(channel.metadata.items()))
        key = channel.topic, channel.message_encoding, schema_id, metadata
        if key not in self._registered:
            self._registered[key] = writer.register_channel(
                channel.topic, channel.message_encoding, schema_id, channel.metadata
            )
        return self._registered[key]

    def _schema(self, number: int) -> int:
        schema = self._learnt.schema(number) if number else None
        if schema is None:
            return 0  # a channel without one
        key = schema.name, schema.encoding, schema.data
        if key not in self._registered:
            self._registered[key] = self._open().register_schema(*key)
        return self._registered[key]

    @contextmanager
    def _errors_told(self) -> Iterator[None]:
        try:
            yield
        except FileExistsError:
            raise BagError(
                f'{str(self.path)!r} exists; choose another name or remove it'
            ) from None
        except OSError as error:
            raise BagError(
                f'{str(self.path)!r} cannot be written: {error.strerror}; '
                'give a name in a folder that is there, has room and may be written'
            ) from error
