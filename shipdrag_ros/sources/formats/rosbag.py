# SPDX-License-Identifier: Apache-2.0
"""
Bags of ROS 1 (.bag) and of rosbag2 in sqlite3 storage (.db3), copied message by message.

The topics keep their names, so that `--remap` of replay means the same as with
any bag; messages of ROS 1 become CDR.
"""

from __future__ import annotations

import bz2
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from urllib.parse import quote

import lz4.frame
from rosbags.rosbag1 import Reader

from shipdrag_ros import strict_yaml
from shipdrag_ros.display import Table
from shipdrag_ros.errors import BagError, ImportDataError
from shipdrag_ros.messages import EncodedMessage, MalformedMessage, match_inputs, types
from shipdrag_ros.messages.topics import TOPICS
from shipdrag_ros.sources.format import CERTAIN, NO, Format, Head, Job
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    LIMIT_NS,
    Log,
    Rejected,
    Understood,
    rejected_words,
)

_ROS1, _SQLITE = b'#ROSBAG V', b'SQLite format 3\0'
_CHUNK_BYTES = 256 << 20
_MESSAGE_BYTES = 16 << 20
_TAKEN = {name for names in TOPICS.values() for name in names}


@dataclass(frozen=True)
class CopyResult:
    """
    What became of a bag.

    Attributes
    ----------
    kind
        Of the bag.
    written
        Messages by topic.
    inputs
        Topic that carries each input, without any `--remap`.
    not_used
        Messages of types that carry no input, by topic.
    rejected
        By topic and reason.
    notes, understood
        See `stream.StreamResult`.
    """

    kind: str
    written: dict[str, int]
    inputs: dict[str, str]
    not_used: dict[str, int]
    rejected: dict[str, dict[str, Rejected]]
    notes: tuple[str, ...]
    understood: tuple[Understood, ...] = ()

    def summary(self, bag: Path) -> list[str]:
        """
        Say how much was copied.
        """
        lines = [f'{bag}: {sum(self.written.values())} messages of a bag of {self.kind}']
        if not self.inputs:
            lines.append('No topic has the name of an input: give replay --remap TOPIC:=INPUT.')
        return [*lines, *self.notes]

    def table(self) -> Table:
        """
        Return messages by topic.
        """
        carried = {topic: name for name, topic in self.inputs.items()}
        return Table(
            ('topic', 'input', 'messages'),
            tuple((topic, carried.get(topic, '-'), f'{n}') for topic, n in self.written.items()),
        )

    def details(self) -> list[str]:
        """
        Say what was not copied, and why.
        """
        lines = rejected_words(self.rejected)
        if self.not_used:
            others = ', '.join(f'{topic} {n}' for topic, n in list(self.not_used.items())[:20])
            lines.append(f'Of types that carry no input: {others}')
        return lines


def _score(head: Head) -> float:
    if head.path.is_dir():
        return CERTAIN if any(head.path.glob('*.db3')) else NO
    return CERTAIN if head.raw.startswith((_ROS1, _SQLITE)) else NO


def _open(job: Job, log: Log) -> CopyResult:
    first = b'' if job.source.is_dir() else job.source.open('rb').read(len(_SQLITE))
    ros1 = first.startswith(_ROS1)
    kind = 'ROS 1' if ros1 else 'rosbag2 (sqlite3)'

    def messages(copy: _Copy | None = None) -> Iterator[EncodedMessage]:
        return (_ros1 if ros1 else _sqlite)(job.source, copy or _Copy())

    # read now to count, and again by whoever uses it: it may not fit into memory
    copy = _Copy()
    for message in messages(copy):
        log.counts[message.topic, message.type] += 1
        log.include(message.log_ns)
    if not log.counts:
        reasons = '; '.join([*copy.notes, *rejected_words(copy.rejected)])
        others = ', '.join(f'{topic} {n}' for topic, n in copy.not_used.most_common(10))
        raise ImportDataError(
            f'{str(job.source)!r}, a bag of {kind}, holds no message of a type that carries '
            f'an input; {reasons or f"it has {others or 0}"}'
        )
    log.messages = messages
    log.attach(ATTACHMENT, strict_yaml.dump({'source': job.source.name, 'kind': kind}))
    return copy.result(kind, log.counts)


class _Copy:
    """What becomes of the messages."""

    def __init__(self) -> None:
        self.not_used: Counter[str] = Counter()
        self.rejected: dict[str, dict[str, Rejected]] = {}
        self.notes: list[str] = []
        self.seen = 0

    def reject(self, topic: str, reason: str, text: str) -> None:
        self.rejected.setdefault(topic, {}).setdefault(reason, Rejected()).add(self.seen, text)

    def result(self, kind: str, counts: Counter[tuple[str, str]]) -> CopyResult:
        inputs = {}
        written: Counter[str] = Counter()
        for (topic, _), count in counts.items():
            written[topic] += count
        try:
            matched = match_inputs(counts)
            inputs = {source.input: topic for (topic, _), source in matched.heard.items()}
        except BagError as error:
            self.notes.append(str(error))
        return CopyResult(
            kind,
            dict(written),
            inputs,
            dict(self.not_used),
            self.rejected,
            tuple(self.notes),
        )


def _ros1(path: Path, copy: _Copy) -> Iterator[EncodedMessage]:
    """Yield the messages of a bag of ROS 1, in the order of their times."""
    try:
        with Reader(path) as reader:
            reader.chunks = {
                place: chunk._replace(decompressor=_bounded(chunk.decompressor))
                for place, chunk in reader.chunks.items()
            }
            for connection, time_ns, payload in reader.messages():
                copy.seen += 1
                if connection.msgtype not in _TAKEN:
                    copy.not_used[connection.topic] += 1
                    continue
                if not 0 < time_ns < LIMIT_NS or len(payload) > _MESSAGE_BYTES:
                    copy.reject(connection.topic, 'no possible date or size', str(time_ns))
                    continue
                try:
                    cdr = types.from_ros1(connection.msgtype, payload)
                except MalformedMessage as error:
                    copy.reject(connection.topic, 'malformed', str(error))
                    continue
                yield EncodedMessage(connection.topic, connection.msgtype, cdr, time_ns, time_ns)
    except (GeneratorExit, BagError):
        raise
    except Exception as error:  # the reader raises what a damaged record happens to raise
        copy.notes.append(
            f'The bag could not be read to its end: {error or type(error).__name__}; '
            '`rosbag reindex` may mend it.'
        )


def _bounded(decompress: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """Return what unpacks a chunk to a sane size, instead of what unpacks it to any."""
    name = getattr(decompress, '__module__', '')
    if 'bz2' in name:
        return lambda data: bz2.BZ2Decompressor().decompress(data, _CHUNK_BYTES)
    if 'lz4' in name:
        unpack = partial(lz4.frame.LZ4FrameDecompressor().decompress, max_length=_CHUNK_BYTES)
        return lambda data: bytes(unpack(data))
    return decompress


def _sqlite(path: Path, copy: _Copy) -> Iterator[EncodedMessage]:
    """Yield the messages of the files of a bag of rosbag2."""
    if path.is_dir():
        if any(path.glob('*.db3.zstd')):
            copy.notes.append('Files packed with zstd are left out; unpack them with `unzstd`.')
        files = sorted(path.glob('*.db3'), key=lambda file: (len(file.name), file.name))
    else:
        files = [path]
    for file in files:
        try:
            yield from _one_sqlite(file, copy)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            copy.notes.append(f'{file.name} could not be read to its end: {error}.')


def _one_sqlite(file: Path, copy: _Copy) -> Iterator[EncodedMessage]:
    uri = f'file:{quote(str(file.resolve()))}?mode=ro&immutable=1'
    with closing(sqlite3.connect(uri, uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _MESSAGE_BYTES)
        tables = {
            str(name)
            for (name,) in database.execute("select name from sqlite_master where type = 'table'")
        }
        if not {'topics', 'messages'} <= tables:
            raise sqlite3.DatabaseError('it has no tables of topics and messages')
        topics = {
            number: (str(name), str(kind), str(form))
            for number, name, kind, form in database.execute(
                'select id, name, type, serialization_format from topics'
            )
        }
        rows = database.execute(
            'select topic_id, timestamp, data from messages order by timestamp'
        )
        for number, time_ns, payload in rows:
            copy.seen += 1
            topic, kind, form = topics.get(number, (f'topic {number}', '', ''))
            if kind not in _TAKEN or form != 'cdr':
                copy.not_used[topic] += 1
            elif not isinstance(payload, bytes) or not isinstance(time_ns, int):
                copy.reject(topic, 'no message', repr(payload)[:40])
            elif not 0 < time_ns < LIMIT_NS:
                copy.reject(topic, 'no possible date', str(time_ns))
            else:
                yield EncodedMessage(topic, kind, payload, time_ns, time_ns)


FORMAT = Format(
    name='rosbag',
    kind='a bag of ROS 1 or of rosbag2 in sqlite3',
    about='Messages of the types that carry inputs are copied under their topics, those of ROS 1 '
    'as CDR; a folder of rosbag2 is given as a whole. Other bags (MCAP) need no import.',
    score=_score,
    read=_open,
    by_head=False,
)
