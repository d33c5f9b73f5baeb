# SPDX-License-Identifier: Apache-2.0
"""
Messages of the types that carry inputs are copied under their topics, those of ROS 1 as CDR;
a folder of rosbag2 is given as a whole. Other bags (MCAP) need no import.
"""

# The topics keep their names, so that `--remap` of replay means the same as with any bag;
# messages of ROS 1 become CDR.

from __future__ import annotations

import bz2
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar
from urllib.parse import quote

import lz4.frame
import zstandard
from rosbags.rosbag1 import Reader

from shipdrag_ros import strict_yaml
from shipdrag_ros.bags.mcap_file import METADATA, unpacked_file
from shipdrag_ros.bags.records import DamageKind, DamageList
from shipdrag_ros.bags.run import unpacked_message
from shipdrag_ros.display import Table
from shipdrag_ros.errors import BagError, ImportDataError, reason_of
from shipdrag_ros.messages import EncodedMessage, MalformedMessage, match_inputs, types
from shipdrag_ros.messages.topics import TOPICS
from shipdrag_ros.sources.format import CERTAIN, NO, Format, Head, Job, beginning
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    LIMIT_NS,
    ImportResult,
    Log,
    Tally,
    most_of,
    rejected_words,
)

_ROS1, _SQLITE = b'#ROSBAG V', b'SQLite format 3\0'
_CHUNK_BYTES = 256 << 20
_MESSAGE_BYTES = 16 << 20
_TAKEN = {name for names in TOPICS.values() for name in names}


@dataclass(frozen=True, kw_only=True)
class CopyResult(ImportResult):
    """
    What became of a bag; all of it is by topic.

    Attributes
    ----------
    kind
        Of the bag.
    inputs
        Topic that carries each input, without any `--remap`.
    """

    kind: str
    inputs: Mapping[str, str]
    unused: ClassVar = 'Of types that carry no input'

    @property
    def size(self) -> str:
        """What was read."""
        return f'a bag of {self.kind}'

    def table(self) -> Table:
        """Return messages by topic."""
        carried = {topic: name for name, topic in self.inputs.items()}
        return Table(
            ('topic', 'input', 'messages'),
            tuple((topic, carried.get(topic, '-'), f'{n}') for topic, n in self.written.items()),
        )


def _score(head: Head) -> float:
    if head.path.is_dir() or head.path.name == METADATA:
        return CERTAIN if _sqlite_files(head.path) else NO
    packed = head.path.name.endswith('.db3.zstd')
    return CERTAIN if packed or head.raw.startswith((_ROS1, _SQLITE)) else NO


def _open(job: Job, log: Log) -> CopyResult:
    ros1 = not job.source.is_dir() and beginning(job.source).startswith(_ROS1)
    kind = 'ROS 1' if ros1 else 'rosbag2 (sqlite3)'

    def messages(tally: Tally | None = None) -> Iterator[EncodedMessage]:
        return (_ros1 if ros1 else _sqlite)(job.source, tally or Tally())

    # read now to count, and again by whoever uses it: it may not fit into memory
    tally = Tally()
    for message in messages(tally):
        log.counts[message.topic, message.type] += 1
        log.include(message.log_ns)
    if not log.counts:
        reasons = '; '.join([*tally.notes, *rejected_words(tally.rejected)])
        others = most_of(tally.not_used)
        raise ImportDataError(
            f'{str(job.source)!r}, a bag of {kind}, holds no message of a type that carries '
            f'an input; {reasons or f"it has {others or 0}"}'
        )
    log.messages = messages
    log.attachments[ATTACHMENT] = strict_yaml.dump({'source': job.source.name, 'kind': kind})
    inputs = {}
    written: Counter[str] = Counter()
    for (topic, _), count in log.counts.items():
        written[topic] += count
    try:
        matched = match_inputs(log.counts)
        inputs = {source.input: topic for (topic, _), source in matched.heard.items()}
    except BagError as error:
        tally.notes.append(str(error))
    if not inputs:
        tally.notes.insert(
            0, 'No topic has the name of an input: give replay --remap TOPIC:=INPUT.'
        )
    start_ns, end_ns = log.span_ns or (0, 0)
    return CopyResult(
        kind=kind,
        written=dict(written),
        inputs=inputs,
        not_used=dict(tally.not_used),
        rejected=tally.rejected,
        notes=tuple(tally.notes),
        start_ns=start_ns,
        end_ns=end_ns,
    )


def _ros1(path: Path, tally: Tally) -> Iterator[EncodedMessage]:
    """Yield the messages of a bag of ROS 1, in the order of their times."""
    try:
        with Reader(path) as reader:
            reader.chunks = {
                place: chunk._replace(decompressor=_bounded(chunk.decompressor))
                for place, chunk in reader.chunks.items()
            }
            for connection, time_ns, payload in reader.messages():
                tally.records += 1
                if connection.msgtype not in _TAKEN:
                    tally.not_used[connection.topic] += 1
                    continue
                if not 0 < time_ns < LIMIT_NS or len(payload) > _MESSAGE_BYTES:
                    tally.reject(connection.topic, 'no possible date or size', str(time_ns))
                    continue
                try:
                    cdr = types.from_ros1(connection.msgtype, payload)
                except MalformedMessage as error:
                    tally.reject(connection.topic, 'malformed', str(error))
                    continue
                yield EncodedMessage(connection.topic, connection.msgtype, cdr, time_ns, time_ns)
    except (GeneratorExit, BagError):
        raise
    except Exception as error:  # the reader raises what a damaged record happens to raise
        tally.notes.append(
            f'The bag could not be read to its end: {reason_of(error)}; '
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


def _sqlite(path: Path, tally: Tally) -> Iterator[EncodedMessage]:
    """Yield the messages of the files of a bag of rosbag2."""
    for file in _sqlite_files(path):
        damages = DamageList()
        try:
            with unpacked_file(file, damages) or nullcontext() as unpacked:
                yield from _one_sqlite(Path(unpacked.name) if unpacked else file, tally)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            damages.add(0, 'file', DamageKind.CONTENT, str(error))
        for damage in damages.listed[:1]:
            tally.notes.append(f'{file.name} could not be read to its end: {damage.detail}.')


def _sqlite_files(path: Path) -> list[Path]:
    """Return the files of a bag of rosbag2, each once where it is there packed too."""
    folder = path.parent if path.name == METADATA else path
    found = [*folder.glob('*.db3.zstd'), *folder.glob('*.db3')] if folder.is_dir() else [path]
    once = {file.name.removesuffix('.zstd'): file for file in found if file.is_file()}
    return [once[name] for name in sorted(once, key=lambda name: (len(name), name))]


def _one_sqlite(file: Path, tally: Tally) -> Iterator[EncodedMessage]:
    log = file.with_name(f'{file.name}-wal')  # of what came last, where a recorder was killed
    how = 'vfs=unix-none' if log.is_file() and log.stat().st_size else 'immutable=1'
    uri = f'file:{quote(str(file.resolve()))}?mode=ro&{how}'
    with closing(sqlite3.connect(uri, uri=True)) as database:
        database.execute('pragma locking_mode = exclusive')  # no index of the log beside the bag
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
            tally.records += 1
            topic, kind, form = topics.get(number, (f'topic {number}', '', ''))
            if kind not in _TAKEN or form != 'cdr':
                tally.not_used[topic] += 1
            elif not isinstance(payload, bytes) or not isinstance(time_ns, int):
                tally.reject(topic, 'no message', repr(payload)[:40])
            elif not 0 < time_ns < LIMIT_NS:
                tally.reject(topic, 'no possible date', str(time_ns))
            else:
                if payload.startswith(zstandard.FRAME_HEADER):  # no CDR begins so
                    payload = unpacked_message(payload)
                yield EncodedMessage(topic, kind, payload, time_ns, time_ns)


FORMAT = Format(
    name='rosbag',
    kind='a bag of ROS 1 or of rosbag2 in sqlite3',
    about=__doc__,
    score=_score,
    read=_open,
    by_head=False,
)
