# SPDX-License-Identifier: Apache-2.0
"""A run: which files make it up, and its samples as one sequence in order of arrival."""

from __future__ import annotations

import copy
import os
import shutil
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zstandard

from shipdrag_ros.bags.mcap_file import BagFiles, McapFile, is_bag_folder, locate
from shipdrag_ros.bags.message_index import CHANNELS, Messages
from shipdrag_ros.bags.records import unpack_zstd
from shipdrag_ros.bags.recover import recover
from shipdrag_ros.errors import BagError, disk_errors
from shipdrag_ros.messages import (
    OUTPUT_TOPICS,
    EventKind,
    MalformedMessage,
    OutputMessage,
    Source,
    match_inputs,
    read_event,
    types,
)
from shipdrag_ros.messages.decoding import decode_batch
from shipdrag_ros.messages.topics import EVENTS, RESISTANCE, TOPICS
from shipdrag_ros.samples import FURTHER, Block, concatenate
from shipdrag_ros.ship import SHIP_FILE, Ship

WindowSpan = tuple[float, float]


class WindowedRun(NamedTuple):
    """A run, and the window of it that was given, [s] from its start."""

    run: Run
    window: WindowSpan | None


def open_runs(paths: Iterable[Path], *, remap: Mapping[str, str] | None = None) -> list[Run]:
    """
    Open bags; parts of one recording become one run.

    Parameters
    ----------
    paths
        MCAP files and rosbag2 directories.
    remap
        Recorded topic -> input.

    Raises
    ------
    BagError
        If a bag cannot be read, or its topics are ambiguous.
    """
    runs: dict[str, tuple[BagFiles, list[McapFile]]] = {}
    for bag in [bag for path in paths for bag in locate(Path(path))]:
        parts = [McapFile(file) for file in bag.files]
        about = parts[0].contents.recording
        if len(parts) == 1 and 'recording_id' in about:
            recording = runs.setdefault(f'id {about["recording_id"]}', (bag, []))
            recording[1].extend(parts)
        else:
            runs.setdefault(f'bag {bag.files[0].resolve()}', (bag, parts))
    return [Run(*_in_order(bag, parts), remap=remap) for bag, parts in runs.values()]


def _in_order(bag: BagFiles, parts: list[McapFile]) -> tuple[BagFiles, list[McapFile]]:
    """Sort the parts of a recording by their number."""
    if len(parts) < 2 or not all(part.contents.recording for part in parts):
        return bag, parts
    numbered: dict[int, McapFile] = {}
    for part in parts:
        text = part.contents.recording.get('part', '0')
        number = int(text) if text.isdecimal() else 0
        if number in numbered:
            raise BagError(
                f'{str(part.path)!r} and {str(numbered[number].path)!r} are the same part '
                f'{number} of one recording; give one of them'
            )
        numbered[number] = part
    missing = sorted(set(range(min(numbered), max(numbered))) - set(numbered))
    ordered = [part for _, part in sorted(numbered.items())]
    warnings = (f'part {number} of the recording is missing' for number in missing)
    files = tuple(part.path for part in ordered)
    return BagFiles(str(files[0]), files, warnings=(*bag.warnings, *warnings)), ordered


# messages decoded at once: a chunk as writers make them, and of a giant one a part
BATCH = 1 << 14
# of one message that rosbag2 has packed for itself; inputs have some hundred bytes
_MESSAGE_LIMIT_BYTES = 1 << 20
_ALL_NS = (0, sys.maxsize)
RECORDED = 'recorded_'
"""Before the name of what was attached when it was recorded, where another is given since."""


@dataclass(frozen=True)
class ResetMark:
    """All memory was dropped on request, at arrival time `receive_ns`."""

    receive_ns: int
    reason: str


@dataclass(frozen=True)
class SilenceMark:
    """All sources of the motion had fallen silent by the clock, at arrival time `receive_ns`."""

    receive_ns: int
    reason: str


@dataclass(frozen=True)
class StopMark:
    """A person said that the engine was stopped, within some seconds of `receive_ns`."""

    receive_ns: int


Mark = ResetMark | SilenceMark | StopMark
"""What the node learnt other than from samples, and what a replay obeys at its place."""


@dataclass(frozen=True)
class TopicInfo:
    """
    A topic of a run.

    `rate_hz` is its mean over the whole run, None where that says nothing; `input` is the
    input it carries, None where it carries none; `refused` says that its name is an input's
    and its type is not accepted.
    """

    topic: str
    type: str
    messages: int
    rate_hz: float | None
    input: str | None
    refused: bool


class Run:
    """
    One recording, of one or several files.

    Parameters
    ----------
    bag
        The files, in the order of the parts.
    parts
        The same, opened.
    remap
        Recorded topic -> input.

    Attributes
    ----------
    name
        As the user gave it.
    parts
        Its files.
    attachments
        Text by name.
    topics
        What is in it, by name.
    refused
        Messages of types that are not accepted, by input.
    node
        Full name of the node whose outputs it holds, None without any.
    """

    def __init__(
        self, bag: BagFiles, parts: Sequence[McapFile], *, remap: Mapping[str, str] | None = None
    ) -> None:
        self.name = bag.name
        self.parts = tuple(parts)
        self._limits_ns = _ALL_NS
        self._message_compression = bag.message_compression
        self._warnings = list(bag.warnings)
        counts: Counter[tuple[str, str]] = Counter()
        for part in parts:
            for number, key in part.contents.channels.items():
                counts[key] += part.contents.counts[number]
        try:
            self._matched = match_inputs(counts, remap=remap, own=_is_own(parts))
        except BagError as error:
            raise BagError(f'{self.name!r}: {error}') from None
        self.topics = tuple(self._topic(key, counts[key]) for key in sorted(counts))
        self.refused: Counter[str] = Counter()
        for key, name in self._matched.unaccepted.items():
            self.refused[name] += counts[key]
        self.node = self._find_node(set(counts))
        self.attachments = self._join_attachments()

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files of the run."""
        return tuple(part.path for part in self.parts)

    @property
    def folders(self) -> tuple[Path, ...]:
        """That of its files, and that of a bag which is a folder itself; a frame lies in none."""
        first = self.paths[0]
        if not first.is_file():
            return ()
        if not is_bag_folder(os.listdir(first.parent)):
            return (first.parent,)
        bag = first.parent if first.parent.name.strip('.') else first.parent.resolve()
        return bag, bag.parent

    @cached_property
    def ship(self) -> Ship | None:
        """The ship whose file is attached, or else lies beside it, which is noted."""
        text = self.attachments.get(SHIP_FILE)
        if text is not None:
            return Ship.from_yaml(text, subject=f'{self.name}: {SHIP_FILE}')
        near = (each / SHIP_FILE for each in self.folders)
        path = next((each for each in near if each.is_file()), None)
        if path is None:
            return None
        self.note([f'{path} holds for this run'])
        return Ship.load(path)

    def about(self) -> dict[str, Any]:
        """Return what `shipdrag info` has of it."""
        topics = self.topics_inside()  # a part is read for it, and may be found damaged
        start_ns, end_ns = self.span_ns or (None, None)
        found = {*FURTHER, *(topic.input for topic in topics)}
        return {
            'bag': self.name,
            'files': tuple(map(str, self.paths)),
            'size_bytes': sum(path.stat().st_size for path in self.paths),
            'start_ns': start_ns,
            'end_ns': end_ns,
            'duration_s': self.duration_s,
            'messages': sum(topic.messages for topic in topics),
            'compression': self.compression,
            'indexed': self.indexed,
            'topics': [asdict(topic) for topic in topics],
            'missing_inputs': tuple(name for name in TOPICS if name not in found),
            'attachments': {name: len(text.encode()) for name, text in self.attachments.items()},
            'software': self.software,
            'node': self.node,
            'warnings': self.warnings,
        }

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last time of arrival [ns]; None without messages."""
        spans = [part.span_ns for part in self.parts if part.span_ns is not None]
        if not spans:
            return None
        starts, ends = zip(*spans, strict=True)
        return max(self._limits_ns[0], min(starts)), min(self._limits_ns[1], max(ends))

    @property
    def duration_s(self) -> float:
        """From the first arrival to the last [s]; 0 without messages."""
        first, last = self.span_ns or (0, 0)
        return (last - first) * 1e-9

    @property
    def indexed(self) -> bool:
        """Whether all files have a sound index."""
        return all(part.contents.indexed for part in self.parts)

    @property
    def compression(self) -> str:
        """Of the chunks: `none`, `lz4`, `zstd`, joined by commas; `none` of a log."""
        kinds = {
            each.compression or 'none' for part in self.parts for each in part.contents.segments
        }
        return ', '.join(sorted(kinds)) or 'none'

    @property
    def software(self) -> str | None:
        """Version of this package that recorded it; None if it was another tool."""
        return self.parts[0].contents.recording.get('version')

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong with the files; reading them may find more."""
        found = list(self._warnings)
        for part in self.parts:
            found += (f'{part.path.name}: {warning}' for warning in part.contents.warnings)
        return tuple(found)

    def save(self, out: Path, attachments: Mapping[str, str]) -> None:
        """
        Copy the one file of the run, unpacked where rosbag2 has packed it.

        Parameters
        ----------
        out
            File to make.
        attachments
            Text by name, in place of what is attached, which is kept as `recorded_NAME`.

        Raises
        ------
        BagError
            If the disk does not take it.
        """
        path, known = self.parts[0].path, self.attachments
        new = {k: text for k, text in attachments.items() if known.get(k) != text}
        new |= {RECORDED + k: known.get(RECORDED + k, known[k]) for k in new if k in known}
        if new or self._message_compression or path.suffix == '.zstd':
            recover(Path(self.name) if self._message_compression else path, out, attachments=new)
            return
        with disk_errors(out, 'written'):
            shutil.copyfile(path, out)

    def part(self, start_s: float, end_s: float) -> Run:
        """
        Return a part of the run, as if the recording held no more.

        Parameters
        ----------
        start_s, end_s
            From the start of the run [s].

        Raises
        ------
        BagError
            If the run ends before the part begins.
        """
        span_ns = self.span_ns or (0, 0)
        first, last = (span_ns[0] + round(each * 1e9) for each in (start_s, end_s))
        if first >= span_ns[1]:
            raise BagError(
                f'{self.name!r}: nothing is recorded from {start_s:g} to {end_s:g} s: it lasts '
                f'{(span_ns[1] - span_ns[0]) * 1e-9:.1f} s; give an earlier part'
            )
        found = copy.copy(self)
        found._limits_ns = (first, last)
        return found

    def topics_inside(self) -> tuple[TopicInfo, ...]:
        """Return what is in it, by name; a part is read for it."""
        if self._limits_ns == _ALL_NS:
            return self.topics
        keys = [(each.topic, each.type) for each in self.topics]
        counts = np.zeros(len(keys), np.int64)
        for batch in self.messages(keys):
            counts += np.bincount(batch.channel, minlength=len(keys))
        return tuple(self._topic(key, n) for key, n in zip(keys, counts.tolist()) if n)

    def note(self, warnings: Iterable[str]) -> None:
        """Add to what is wrong with the run; what was said before is not repeated."""
        self._warnings += (text for text in warnings if text not in self._warnings)

    def inputs(self, *, start_ns: int = 0, end_ns: int = sys.maxsize) -> RunSamples:
        """
        Return the samples in order of arrival.

        Parameters
        ----------
        start_ns, end_ns
            First and last time of arrival [ns].
        """
        return RunSamples(self, start_ns, end_ns)

    def outputs(self) -> Iterator[OutputMessage]:
        """
        Yield the outputs that the node recorded and a replay gives too, in order of arrival.

        Those that cannot be read have stamp 0.
        """
        if self.node is None:
            return
        stamped = (topic for topic in OUTPUT_TOPICS if types.is_stamped(topic.type))
        wanted = [(topic.under(self.node), topic.type) for topic in stamped]
        for batch in self.messages(wanted):
            for number, place in enumerate(batch.channel.tolist()):
                topic, type_name = wanted[place]
                payload = batch.payload(number)
                try:
                    stamp_ns = types.stamp_ns(types.deserialize(type_name, payload))
                except MalformedMessage:
                    stamp_ns = 0
                yield OutputMessage(topic, type_name, payload, stamp_ns)

    def messages(
        self, keys: Sequence[tuple[str, str]], *, start_ns: int = 0, end_ns: int = sys.maxsize
    ) -> Iterator[Messages]:
        """
        Yield messages of some (topic, type) in order of arrival, some at a time.

        Parts follow each other; inside a part the log time counts, then the place.
        The channel of each is its place among the keys.
        """
        start_ns, end_ns = max(start_ns, self._limits_ns[0]), min(end_ns, self._limits_ns[1])
        for part in self.parts:
            known = part.contents.channels.items()
            wanted = {number: keys.index(key) for number, key in known if key in keys}
            place_of = np.zeros(CHANNELS, np.uint16)
            place_of[list(wanted)] = list(wanted.values())
            for batch in part.messages(wanted, start_ns=start_ns, end_ns=end_ns):
                found = replace(batch, channel=place_of[batch.channel])
                yield _unpacked(found) if self._message_compression else found

    def _topic(self, key: tuple[str, str], messages: int) -> TopicInfo:
        source, duration_s = self._matched.heard.get(key), self.duration_s
        return TopicInfo(
            *key,
            messages,
            rate_hz=(messages - 1) / duration_s if messages > 1 and duration_s > 0.0 else None,
            input=None if source is None else source.input,
            refused=key in self._matched.unaccepted,
        )

    def _find_node(self, keys: set[tuple[str, str]]) -> str | None:
        ends = {output.type: f'/{output.name}' for output in (EVENTS, RESISTANCE)}
        own = ((topic, ends[kind]) for topic, kind in keys if kind in ends)
        nodes = sorted({topic.removesuffix(end) for topic, end in own if topic.endswith(end)})
        if len(nodes) > 1:
            self._warnings.append(
                f'outputs of {len(nodes)} nodes, {", ".join(nodes)}: none of them is compared'
            )
        return nodes[0] if len(nodes) == 1 else None

    def _join_attachments(self) -> dict[str, str]:
        joined: dict[str, str] = {}
        for part in self.parts:
            for name, data in part.contents.attachments.items():
                text = data.decode(errors='replace')
                if joined.setdefault(name, text) != text:
                    self._warnings.append(
                        f'{part.path.name}: its {name} differs from that of the first part, '
                        'which is used'
                    )
        return joined


class RunSamples:
    """
    The samples of a run, in order of arrival; to be read once.

    Attributes
    ----------
    messages
        Messages read so far, by input.
    unreadable
        Of these, how many gave no sample, by input and reason; of joints that have no
        place, how many joints.
    """

    def __init__(self, run: Run, start_ns: int, end_ns: int) -> None:
        self.messages: Counter[str] = Counter()
        self.unreadable: dict[str, Counter[str]] = {}
        self._run = run
        self._span = (start_ns, end_ns)

    def __iter__(self) -> Iterator[Block | Mark]:
        """Yield the samples of at most `BATCH` messages, and marks at their place."""
        heard = self._run._matched.heard
        keys = list(heard)
        if self._run.node is not None:
            keys.append((EVENTS.under(self._run.node), EVENTS.type))
        sources = tuple(heard.values())
        start_ns, end_ns = self._span
        for messages in self._run.messages(keys, start_ns=start_ns, end_ns=end_ns):
            for first in range(0, len(messages), BATCH):
                yield from self._items(messages[first : first + BATCH], sources)

    def block(self) -> Block:
        """Return all samples, without the marks."""
        return concatenate([item for item in self if isinstance(item, Block)])

    def _items(self, messages: Messages, sources: tuple[Source, ...]) -> Iterator[Block | Mark]:
        """Decode, and cut at the marks."""
        block, places, unreadable = decode_batch(
            sources, messages.channel, messages.data, messages.start, messages.end, messages.log_ns
        )
        counts = np.bincount(messages.channel, minlength=len(sources)).tolist()
        for source, count, reasons in zip(sources, counts, unreadable, strict=False):
            if count:
                self.messages[source.input] += count
            for reason, number in reasons.items():
                self.unreadable.setdefault(source.input, Counter())[reason.value] += number
        done = 0
        for number in np.flatnonzero(messages.channel == len(sources)).tolist():
            mark = _mark(messages.payload(number))
            if mark is not None:
                before = int(np.searchsorted(places, number))
                if before > done:
                    yield block[done:before]
                yield mark
                done = before
        if len(block) > done:
            yield block[done:]


def _is_own(parts: Sequence[McapFile]) -> bool:
    """Whether a node of this package recorded it: each type that it holds was subscribed."""
    return any('parameters.yaml' in part.contents.attachments for part in parts)


def _mark(payload: bytes) -> Mark | None:
    try:
        note = read_event(payload)
    except MalformedMessage:
        return None
    match note.kind:
        case EventKind.RESET_REQUEST:
            return ResetMark(note.stamp_ns, note.text)
        case EventKind.SILENCE:
            return SilenceMark(note.stamp_ns, note.text)
        case EventKind.ENGINE_STOPPED:
            return StopMark(note.stamp_ns)
    return None


def _unpacked(messages: Messages) -> Messages:
    """Unpack each message for itself; an empty one is malformed."""
    return messages.holding([unpacked_message(messages.payload(n)) for n in range(len(messages))])


def unpacked_message(payload: bytes) -> bytes:
    """Unpack a message that rosbag2 has packed for itself; one that cannot be is empty."""
    try:
        return unpack_zstd(payload, _MESSAGE_LIMIT_BYTES)
    except (ValueError, zstandard.ZstdError):
        return b''
