# SPDX-License-Identifier: Apache-2.0
"""
Making the file of a finished part small and quick to read.

The name holds a whole file at every moment: first the one that grew, then, from
one moment to the next, the compact one.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import IO, Any

from mcap.exceptions import EndOfFile, McapError
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from shipdrag_ros.bags.live import sync_directory
from shipdrag_ros.bags.writer import METADATA, BagWriter
from shipdrag_ros.errors import BagError

SUFFIX = '.compacting'


def compact(path: Path, *, messages: int) -> None:
    """
    Rewrite a file that is no longer written into large compressed chunks.

    Parameters
    ----------
    path
        From `LiveFile`; afterwards the same messages with an index.
    messages
        How many there are.

    Raises
    ------
    BagError
        If that is impossible; the file is then as it was.
    """
    compacted = path.with_name(path.name + SUFFIX)
    try:
        compacted.unlink(missing_ok=True)  # from an attempt that failed
        written = _rewrite(path, compacted)
        if written != messages:
            raise BagError(f'{str(path)!r} holds {written} messages, {messages} were written')
        compacted.replace(path)
        sync_directory(path.parent)
    except (OSError, McapError, ValueError, KeyError) as error:
        raise BagError(f'{str(path)!r} cannot be compacted: {error}') from error
    finally:
        with suppress(OSError):
            compacted.unlink(missing_ok=True)


def _rewrite(source: Path, target: Path) -> int:
    written = 0
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    with source.open('rb') as stream, ExitStack() as made:
        for record in _whole_records(stream):
            match record:
                case Metadata(name=name, metadata=about) if name == METADATA:
                    identity, part = about['recording_id'], int(about['part'])
                    bag = made.enter_context(BagWriter(target, recording_id=identity, part=part))
                case Attachment():
                    bag.attach(record.name, record.data.decode())
                case Schema():
                    schemas[record.id] = record.name
                case Channel():
                    channels[record.id] = (record.topic, schemas[record.schema_id])
                case Message():
                    bag.write(
                        *channels[record.channel_id],
                        record.data,
                        log_ns=record.log_time,
                        publish_ns=record.publish_time,
                    )
                    written += 1
    return written


def _whole_records(stream: IO[bytes]) -> Iterator[Any]:
    # a file that the disk let down has no end; whether all is there, the count shows
    with suppress(EndOfFile, struct.error):
        yield from StreamReader(stream, validate_crcs=True).records
