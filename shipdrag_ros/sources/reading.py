# SPDX-License-Identifier: Apache-2.0
"""
Any file as runs: a bag, a log or a table, read as a bag of it would be.

Its samples are encoded and decoded again, some at a time, as those of a bag are,
so that both give the same to the last bit and a `--remap` means the same. Several
files of one ship are one run; a ship is nowhere twice at one time: logs that say so are
of two, and refused.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, islice
from pathlib import Path
from typing import Any

import numpy as np

from shipdrag_ros import strict_yaml
from shipdrag_ros.bags import Run, open_runs
from shipdrag_ros.bags.contents import Contents
from shipdrag_ros.bags.mcap_file import METADATA, BagFiles, is_bag
from shipdrag_ros.bags.message_index import Messages
from shipdrag_ros.bags.records import MAGIC
from shipdrag_ros.bags.run import BATCH
from shipdrag_ros.bags.writer import new_bag
from shipdrag_ros.display import utc
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.messages.encoding import encode_batch
from shipdrag_ros.samples import (
    ABSURD_SPEED_M_S,
    SECOND_NS,
    Block,
    Channel,
    Float64,
    Int64,
    in_arrival_order,
)
from shipdrag_ros.sources import formats
from shipdrag_ros.sources.format import Format, Job, best_of, head_of
from shipdrag_ros.sources.log import ATTACHMENT, ImportResult, Log, key_of

_APART_M = (
    2000.0  # more than a ship is long, and more than clocks make of it that disagree a little
)
_METRES_PER_DEGREE = 1852.0 * 60.0


_Fixes = tuple[Int64, Float64]
"""Times [ns], and latitudes and longitudes [deg] then."""


def _track(block: Block) -> _Fixes:
    """Return where the ship of a log was, at most once a second."""
    chosen = block[block.channel == Channel.POSITION_GEODETIC]
    seconds, first = np.unique(chosen.stamp_ns // SECOND_NS, return_index=True)
    return seconds * SECOND_NS, chosen.value[first]


def _away_m(here: _Fixes, there: _Fixes) -> Float64:
    """Return how far [m] `there` is from `here` at its times, less what a ship sails between."""
    (here_ns, here_deg), (there_ns, there_deg) = here, there
    after = np.searchsorted(here_ns, there_ns).clip(1, len(here_ns) - 1)
    both = np.stack((after - 1, after))  # before and after; the nearer one counts
    between_ns = np.abs(there_ns - here_ns[both])
    which = between_ns.argmin(axis=0), np.arange(len(there_ns))
    near, between_s = both[which], between_ns[which] / SECOND_NS
    north = there_deg[:, 0] - here_deg[near, 0]
    east = (there_deg[:, 1] - here_deg[near, 1] + 180.0) % 360.0 - 180.0
    east *= np.cos(np.radians(there_deg[:, 0]))
    away_m: Float64 = np.hypot(north, east) * _METRES_PER_DEGREE - ABSURD_SPEED_M_S * between_s
    return away_m


def _refuse_two_ships(names: Sequence[str], blocks: Sequence[Block]) -> None:
    """
    Refuse logs of which half of the common fixes are further apart than a ship is long.

    Positions in metres have origins of their own and are not held against each other.
    """
    known: list[tuple[str, _Fixes]] = []
    for name, block in zip(names, blocks, strict=True):
        here = _track(block)
        if len(here[0]) < 2:
            continue
        for other, there in known:
            apart_m = np.median(_away_m(there, here))
            if apart_m > _APART_M:
                at = utc(int(here[0][len(here[0]) // 2]))
                raise ImportDataError(
                    f'{other!r} and {name!r} are {apart_m / 1000.0:.0f} km apart about {at}: they '
                    'are of two ships, or one clock is wrong. Read each by itself'
                )
        known.append((name, here))


def read_joined(parts: Sequence[tuple[Format, Job]]) -> tuple[Log, list[ImportResult], list[str]]:
    """
    Read the measurements of files as one log.

    Parameters
    ----------
    parts
        Format and job of each file.

    Returns
    -------
    log, results, notes
        What they hold together; of each file; what was left out when they were put together,
        a sentence each.

    Raises
    ------
    ImportDataError
        If nothing in one of them can be used, or they hold a ship at two places at a time.

    Notes
    -----
    Of an input that two files hold for the same time, the first file's is taken:
    two instruments are never mixed.
    """
    logs = [(job.source.name, Log()) for _, job in parts]
    results = [each.read(job, log) for (each, job), (_, log) in zip(parts, logs, strict=True)]
    joined, lost, notes = join(logs)
    return joined, [_without(*each) for each in zip(results, lost, strict=True)], notes


def _without(result: ImportResult, lost: Counter[str]) -> ImportResult:
    written = {name: n - lost[name] for name, n in result.written.items() if n > lost[name]}
    return replace(result, written=written)


def join(logs: Sequence[tuple[str, Log]]) -> tuple[Log, list[Counter[str]], list[str]]:
    """
    Put logs together; what is left out of each is counted by input, and said.

    Parameters
    ----------
    logs
        With the name of each.

    Raises
    ------
    ImportDataError
        If they hold a ship at two places at a time.
    """
    if len(logs) == 1:
        return logs[0][1], [Counter()], []
    blocks = [_block(log) for _, log in logs]
    names = [name for name, _ in logs]
    _refuse_two_ships(names, blocks)
    taken, lost = _taken(blocks)
    joined = Log()
    about = {name: log.attachments.get(ATTACHMENT, '') for name, log in logs}
    joined.attachments[ATTACHMENT] = strict_yaml.dump({'sources': about})
    joined.take(in_arrival_order(taken))
    notes = [
        f'{name}: {", ".join(sorted(counts))} not taken for the time that an earlier file gives '
        'it too.'
        for name, counts in zip(names, lost, strict=True)
        if counts
    ]
    return joined, lost, notes


def _block(log: Log) -> Block:
    """Return all samples of a log; messages as their topics say."""
    if log.messages is None:
        return log.block
    return LogRun(log, []).inputs().block()


def _taken(blocks: Sequence[Block]) -> tuple[list[Block], list[Counter[str]]]:
    """Leave out of each block the spans that earlier ones give of the same input; count them."""
    covered: dict[str, list[tuple[int, int]]] = {}
    left, lost = [], []
    for block in blocks:
        keep = np.ones(len(block), np.bool_)
        own: list[tuple[str, tuple[int, int]]] = []
        for number in np.unique(block.channel):
            of_channel = block.channel == number
            stamps = block.stamp_ns[of_channel]
            name_of = Channel(number).input
            own.append((name_of, (int(stamps.min()), int(stamps.max()))))
            for start, end in covered.get(name_of, []):
                keep[of_channel & (block.stamp_ns >= start) & (block.stamp_ns <= end)] = False
        left.append(block[keep])
        lost.append(Counter(Channel(each).input for each in block.channel[~keep]))
        for name_of, span in own:
            covered.setdefault(name_of, []).append(span)
    return left, lost


class LogPart:
    """
    A log where a run expects a file of a bag.

    Parameters
    ----------
    log
    path
        What it is called.

    Attributes
    ----------
    contents
        Its channels, how many messages each has, and attachments.
    span_ns
        First and last time of arrival [ns]; None without messages.
    """

    def __init__(self, log: Log, path: Path) -> None:
        self.path = path
        self.span_ns = log.span_ns
        self._log = log
        self.contents = Contents()
        self._number = {key: number for number, key in enumerate(log.counts)}
        for (topic, kind), number in self._number.items():
            self.contents.channels[number] = topic, kind
            self.contents.counts[number] = log.counts[topic, kind]
        for name, text in log.attachments.items():
            self.contents.attachments[name] = text.encode()

    def messages(
        self, channels: Collection[int], *, start_ns: int = 0, end_ns: int = sys.maxsize
    ) -> Iterator[Messages]:
        """
        Yield messages in order of arrival, some at a time.

        Parameters
        ----------
        channels
            Numbers of those to read.
        start_ns, end_ns
            First and last time of arrival to read [ns].
        """
        for found in self._all():
            wanted = np.isin(found.channel, list(channels))
            wanted &= (found.log_ns >= start_ns) & (found.log_ns <= end_ns)
            if wanted.any():
                yield found if wanted.all() else found[wanted]

    def _all(self) -> Iterator[Messages]:
        for block in self._log.pieces():
            yield self._encoded(block)
        stored = iter(()) if self._log.messages is None else self._log.messages()
        for some in iter(lambda: tuple(islice(stored, BATCH)), ()):
            ends = np.fromiter(accumulate((len(one.payload) for one in some), initial=0), np.int64)
            yield Messages(
                np.frombuffer(b''.join(one.payload for one in some), np.uint8),
                np.array([one.log_ns for one in some], np.int64),
                np.zeros(len(some), np.int64),
                np.array([self._number[one.topic, one.type] for one in some], np.uint16),
                ends[:-1],
                ends[1:],
            )

    def _encoded(self, block: Block) -> Messages:
        number = np.zeros(len(Channel), np.uint16)
        for code in np.unique(block.channel).tolist():
            number[code] = self._number[key_of(Channel(code))]
        batch = encode_batch(block)
        nowhere = np.zeros(len(block), np.int64)
        return Messages(
            batch.data, block.receive_ns, nowhere, number[block.channel], batch.start, batch.end
        )


class LogRun(Run):
    """A run whose samples stood in logs or tables; `paths` are these."""

    def __init__(
        self, log: Log, sources: Sequence[Path], remap: Mapping[str, str] | None = None
    ) -> None:
        name = ', '.join(map(str, sources))
        part = LogPart(log, Path(name))
        super().__init__(BagFiles(name, tuple(sources)), [part], remap=remap)  # type: ignore[list-item]
        folders = [each.parent if each.name == METADATA else each for each in sources]
        self._sources = tuple(
            file
            for each, folder in zip(sources, folders, strict=True)
            for file in sorted(folder.glob('*.db3*')) or [each]
        )
        self._log = log

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files that it was made of."""
        return self._sources

    def save(self, out: Path, attachments: Mapping[str, str]) -> None:
        """Write the run as a bag, see `Run.save`."""
        known, own = {**self.attachments, **attachments}, self._log.attachments
        with new_bag(out, {k: text for k, text in known.items() if k not in own}) as bag:
            self._log.copy_to(bag)


def read_any(
    paths: Iterable[Path],
    *,
    remap: Mapping[str, str] | None = None,
    show: Callable[[list[str]], None] | None = None,
) -> list[Run]:
    """
    Open files of any format that is known, as `open_runs` opens bags.

    Parameters
    ----------
    paths
        MCAP files, rosbag2 directories, logs and tables.
    remap
        Recorded topic -> input.
    show
        Called with what is to be said of each log: what each input was taken from, and what was
        left out.

    Returns
    -------
    list of Run
        First those of the bags, then those of the logs, each by itself, in the order given.

    Raises
    ------
    BagError
        If a bag cannot be read.
    ImportDataError
        If nothing in a log can be used, saying what to type.

    Notes
    -----
    Source: docs/import.md.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from shipdrag_ros.sources.reading import read_any
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table = Path(folder) / 'coast.csv'
    ...     _ = table.write_text('time_s,STW [kn]\\n0,12.0\\n1,11.9\\n')
    ...     (run,) = read_any([table])
    >>> [topic.topic for topic in run.topics]
    ['/speed_through_water']
    """
    bags: list[Path] = []
    logs: list[Path] = []
    for path in map(Path, paths):
        (bags if is_bag(path) else logs).append(path)
    runs = open_runs(bags, remap=remap) if bags else []
    return runs + [_imported(path, remap, show) for path in logs]


def _imported(
    path: Path, remap: Mapping[str, str] | None, show: Callable[[list[str]], None] | None
) -> Run:
    declared, log = format_of(path, {}), Log()
    advice = ' (make a bag of it with `shipdrag import`, which takes these options)'
    try:
        result = declared.read(Job(path), log)
    except ImportDataError as error:
        if '--' not in str(error):
            raise
        raise ImportDataError(f'{error}{advice}') from error
    if show is not None:
        told = result.told(path, declared.kind)
        show([f'{line}{advice}' if ' --' in line else line for line in told])
    return LogRun(log, [path], remap)


def format_of(source: Path, options: Mapping[str, Any], named: Format | None = None) -> Format:
    """
    Return the format of a file: the named one, that which an option chooses, or by its beginning.

    Raises
    ------
    ImportDataError
        If it is of none that is known, no regular file, or a bag that needs no import.
    """
    known = formats.found()
    head = head_of(source)
    if head.raw.startswith(MAGIC) or is_bag(source):
        raise ImportDataError(f'{str(source)!r} is a bag already: `shipdrag replay` takes it')
    chosen = [each for each in known if each.chosen_by in options]
    return named or (chosen[0] if chosen else best_of(known, head))
