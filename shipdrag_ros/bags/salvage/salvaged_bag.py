# SPDX-License-Identifier: Apache-2.0
"""
The bag that salvage writes: whole under its name, or not there at all.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO

import numpy as np
from mcap.records import Attachment, Channel, Metadata, Schema

from shipdrag_ros.bags.message_index import CHANNELS, HEAD_BYTES
from shipdrag_ros.bags.salvage.indexed_file import IndexedFile
from shipdrag_ros.bags.salvage.learnt import Learnt
from shipdrag_ros.bags.salvage.scan import ScannedRecord
from shipdrag_ros.bags.salvage.whole_chunk import WholeChunk
from shipdrag_ros.errors import BagError
from shipdrag_ros.samples import Int64


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
    used
        Whether anything was written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.profile = 'ros2'
        self._learnt = Learnt()
        self._file: IO[bytes] | None = None
        self._writer: IndexedFile | None = None
        self._channels: dict[int, tuple[Channel | None, int]] = {}
        self._registered: dict[tuple[Hashable, ...], int] = {}
        self._last: Counter[type] = Counter()

    @property
    def used(self) -> bool:
        return self._writer is not None

    @property
    def messages(self) -> int:
        """Written so far."""
        return 0 if self._writer is None else self._writer.messages

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
        with self._errors_named():
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
        with self._errors_named():
            self._open().write(
                self._number(number),
                payload,
                sequence=sequence,
                log_ns=log_ns,
                publish_ns=publish_ns,
            )

    def write_chunk(self, records: bytes, whole: WholeChunk) -> None:
        """
        Write all messages of an unpacked chunk, as they lie there.
        """
        with self._errors_named():
            # in order of their first messages, as one after the other would be
            numbers = whole.channel[np.sort(np.unique(whole.channel, return_index=True)[1])]
            here = np.zeros(CHANNELS, np.uint16)
            here[numbers] = [self._number(number) for number in numbers.tolist()]
            channel = here[whole.channel]
            log_ns, offset = whole.entries.T
            messages, offset = _without(records, whole.declarations, offset)
            if (here[numbers] != numbers).any():
                changed = np.frombuffer(messages, np.uint8).copy()
                changed[offset + HEAD_BYTES] = channel & 0xFF
                changed[offset + HEAD_BYTES + 1] = channel >> 8
                messages = changed.tobytes()
            self._open().write_records(messages, channel, log_ns, offset)

    def attach(self, attachment: Attachment) -> None:
        """
        Write an attachment.
        """
        with self._errors_named():
            self._open().attach(attachment)

    def describe(self, metadata: Metadata) -> None:
        """
        Write a metadata record.
        """
        with self._errors_named():
            self._open().describe(metadata)

    def publish(self) -> None:
        """
        Bring the file to the disk, then give it its name.

        Raises
        ------
        BagError
            If the name is taken meanwhile, or the disk does not take the file.
        """
        with self._errors_named():
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

    def _open(self) -> IndexedFile:
        if self._writer is None:
            self._file = NamedTemporaryFile(  # noqa: SIM115 (closed by discard)
                dir=self.path.parent, prefix=f'.{self.path.name}.', suffix='.part'
            )
            os.fchmod(self._file.fileno(), 0o640)  # as recordings are: the group may read
            self._writer = IndexedFile(self._file, profile=self.profile)
        return self._writer

    def _number(self, number: int) -> int:
        """Return what a channel of the source is called here."""
        channel = self._learnt.channel(number)
        known = self._channels.get(number)
        if known is None or known[0] is not channel:
            known = self._channels[number] = channel, self._register(number, channel)
        return known[1]

    def _register(self, number: int, channel: Channel | None) -> int:
        if channel is None:
            topic = f'/unknown_channel_{number}'
            channel = Channel(0, topic=topic, message_encoding='', metadata={}, schema_id=0)
        schema_id = self._schema(channel.schema_id)
        metadata = tuple(sorted(channel.metadata.items()))
        key = Channel, channel.topic, channel.message_encoding, schema_id, metadata
        if key not in self._registered:
            made = replace(channel, id=self._next(Channel), schema_id=schema_id)
            self._open().declare(made)
            self._registered[key] = made.id
        return self._registered[key]

    def _schema(self, number: int) -> int:
        schema = self._learnt.schema(number) if number else None
        if schema is None:
            return 0  # a channel without one
        key = Schema, schema.name, schema.encoding, schema.data
        if key not in self._registered:
            made = replace(schema, id=self._next(Schema))
            self._open().declare(made)
            self._registered[key] = made.id
        return self._registered[key]

    def _next(self, kind: type) -> int:
        self._last[kind] += 1
        return self._last[kind]

    @contextmanager
    def _errors_named(self) -> Iterator[None]:
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


def _without(
    records: bytes, others: Sequence[ScannedRecord], offset: Int64
) -> tuple[bytes, Int64]:
    """Cut some records out; return what is left, and where the rest lies in it."""
    if not others:
        return records, offset
    starts = [0, *(found.end for found in others)]
    ends = [*(found.offset for found in others), len(records)]
    left = b''.join(records[start:end] for start, end in zip(starts, ends, strict=True))
    cut = np.cumsum([0, *(found.end - found.offset for found in others)])
    return left, offset - cut[np.searchsorted(ends[:-1], offset)]
