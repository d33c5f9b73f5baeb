# SPDX-License-Identifier: Apache-2.0
"""
An MCAP file with an index, made of records that other files hold.

Messages come one by one, or all of a chunk at once as they lie in it: to take
each of those apart and encode it anew costs twenty times as much.
"""

from __future__ import annotations

import struct
from array import array
from collections import Counter
from typing import IO

import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from shipdrag_ros.bags.declarations import LIBRARY, as_bytes
from shipdrag_ros.bags.records import HEAD, MAGIC, MESSAGE_HEAD
from shipdrag_ros.samples import Int64

CHUNK_BYTES = 1 << 20
_INDEX_HEAD = struct.Struct('<HI')  # channel, bytes of the entries
_FOOTER_HEAD = struct.Struct('<BQQQ')  # what the checksum of a summary covers of the footer
_FOOTER_BYTES = 20


class IndexedFile:
    """
    Writes a file in chunks.

    Parameters
    ----------
    file
        Empty, open for writing; it is not closed.
    profile
        Of the header.

    Attributes
    ----------
    messages
        Written so far.
    """

    def __init__(self, file: IO[bytes], *, profile: str) -> None:
        self.messages = 0
        self._file = file
        self._declared: dict[int, list[Schema | Channel]] = {Opcode.SCHEMA: [], Opcode.CHANNEL: []}
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._chunks: list[ChunkIndex] = []
        self._counts: Counter[int] = Counter()
        # of the chunk at hand: records, and of each message what its index needs
        self._records: list[bytes] = []
        self._size = 0
        self._channel = array('H')
        self._log_ns = array('q')
        self._offset = array('q')
        file.write(MAGIC + as_bytes(Header(profile, LIBRARY)))

    def declare(self, record: Schema | Channel) -> None:
        """
        Write a schema or a channel, before what refers to it.
        """
        kind = Opcode.SCHEMA if isinstance(record, Schema) else Opcode.CHANNEL
        self._declared[kind].append(record)
        # outside of chunks: one of those may come to harm, and the others not
        self._file.write(as_bytes(record))

    def attach(self, attachment: Attachment) -> None:
        """
        Write an attachment.
        """
        offset, length = self._put(as_bytes(attachment))
        self._attachments.append(
            AttachmentIndex(
                offset=offset,
                length=length,
                log_time=attachment.log_time,
                create_time=attachment.create_time,
                data_size=len(attachment.data),
                name=attachment.name,
                media_type=attachment.media_type,
            )
        )

    def describe(self, metadata: Metadata) -> None:
        """
        Write a metadata record.
        """
        offset, length = self._put(as_bytes(metadata))
        self._metadata.append(MetadataIndex(offset=offset, length=length, name=metadata.name))

    def write(
        self, channel: int, payload: bytes, *, sequence: int, log_ns: int, publish_ns: int
    ) -> None:
        """
        Write a message.
        """
        self._channel.append(channel)
        self._log_ns.append(log_ns)
        self._offset.append(self._size)
        self._take(
            HEAD.pack(Opcode.MESSAGE, MESSAGE_HEAD.size + len(payload))
            + MESSAGE_HEAD.pack(channel, sequence, log_ns, publish_ns)
            + payload,
            1,
        )

    def write_records(
        self, records: bytes, channel: NDArray[np.uint16], log_ns: Int64, offset: Int64
    ) -> None:
        """
        Write messages as they lie in a chunk.

        Parameters
        ----------
        records
            Of messages alone, with the numbers that their channels have here.
        channel, log_ns, offset : (n,)
            Of each: number, log time [ns], place in `records` [bytes].
        """
        if self._size + len(records) > CHUNK_BYTES:
            self._end_chunk()  # so that none grows beyond what it is made of
        self._channel.frombytes(channel.astype(np.uint16).tobytes())
        self._log_ns.frombytes(log_ns.tobytes())
        self._offset.frombytes((offset + self._size).tobytes())
        self._take(records, len(channel))

    def finish(self) -> None:
        """
        Write the index and the end.
        """
        self._end_chunk()
        self._file.write(as_bytes(DataEnd(0)))
        start = self._file.tell()
        summary, offsets = self._summary(start)
        offsets_start = start + len(summary)
        summary += as_bytes(*offsets)
        head = _FOOTER_HEAD.pack(Opcode.FOOTER, _FOOTER_BYTES, start, offsets_start)
        footer = Footer(
            summary_start=start,
            summary_offset_start=offsets_start,
            summary_crc=crc32(head, crc32(summary)),
        )
        self._file.write(summary + as_bytes(footer) + MAGIC)

    def _summary(self, start: int) -> tuple[bytes, list[SummaryOffset]]:
        """Return the summary, and where its groups lie if it begins at an offset."""
        groups = {
            **self._declared,
            Opcode.STATISTICS: [self._statistics()],
            Opcode.CHUNK_INDEX: self._chunks,
            Opcode.ATTACHMENT_INDEX: self._attachments,
            Opcode.METADATA_INDEX: self._metadata,
        }
        summary = b''
        offsets = []
        for kind, records in groups.items():
            content = as_bytes(*records)
            offsets.append(SummaryOffset(kind, start + len(summary), len(content)))
            summary += content
        return summary, offsets

    def _statistics(self) -> Statistics:
        first_ns = [chunk.message_start_time for chunk in self._chunks]
        last_ns = [chunk.message_end_time for chunk in self._chunks]
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._declared[Opcode.CHANNEL]),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self.messages,
            metadata_count=len(self._metadata),
            message_start_time=min(first_ns, default=0),
            message_end_time=max(last_ns, default=0),
            schema_count=len(self._declared[Opcode.SCHEMA]),
        )

    def _take(self, records: bytes, messages: int) -> None:
        self._records.append(records)
        self._size += len(records)
        self.messages += messages
        if self._size > CHUNK_BYTES:
            self._end_chunk()

    def _end_chunk(self) -> None:
        if not self._records:
            return
        records = b''.join(self._records)
        log_ns = np.array(self._log_ns)
        chunk = Chunk(
            compression='zstd',
            data=zstandard.compress(records),
            message_start_time=int(log_ns.min()),
            message_end_time=int(log_ns.max()),
            uncompressed_crc=crc32(records),
            uncompressed_size=len(records),
        )
        offset, length = self._put(as_bytes(chunk))
        indexes = self._message_indexes(np.column_stack((log_ns, self._offset)))
        self._chunks.append(
            ChunkIndex(
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                chunk_start_offset=offset,
                chunk_length=length,
                message_index_offsets=indexes,
                message_index_length=self._file.tell() - offset - length,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                uncompressed_size=chunk.uncompressed_size,
            )
        )
        self._records, self._size = [], 0
        for column in self._channel, self._log_ns, self._offset:
            del column[:]

    def _message_indexes(self, entries: Int64) -> dict[int, int]:
        """Write the message indexes of the chunk at hand; return where, by channel."""
        channel = np.array(self._channel)
        places = {}
        for number in np.unique(channel).tolist():
            of_channel = entries[channel == number]
            content = of_channel.astype('<i8').tobytes()
            head = _INDEX_HEAD.pack(number, len(content))
            length = len(head) + len(content)
            record = HEAD.pack(Opcode.MESSAGE_INDEX, length) + head + content
            places[number], _ = self._put(record)
            self._counts[number] += len(of_channel)
        return places

    def _put(self, content: bytes) -> tuple[int, int]:
        offset = self._file.tell()
        self._file.write(content)
        return offset, len(content)
