# SPDX-License-Identifier: Apache-2.0
"""
Several files of one ship as one bag.

A ship is nowhere twice at one time: logs that say so are of two, and refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from shipdrag_ros import strict_yaml
from shipdrag_ros.bags import Run, open_runs
from shipdrag_ros.display import utc
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.importing.bag import ATTACHMENT, new_bag
from shipdrag_ros.importing.format import Format, ImportResult, Job
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import (
    ABSURD_SPEED_M_S,
    SECOND_NS,
    Block,
    Channel,
    Float64,
    Int64,
    in_arrival_order,
)

_APART_M = (
    2000.0  # more than a ship is long, and more than clocks make of it that disagree a little
)
_METRES_PER_DEGREE = 1852.0 * 60.0


class LogTrack:
    """
    Where the ship of a log was, at most once a second.

    Parameters
    ----------
    name
        Of the log.
    blocks
        Its samples, in their order.
    """

    def __init__(self, name: str, blocks: Iterator[Block]) -> None:
        self.name = name
        times, places = [np.empty(0, np.int64)], [np.empty((0, 2))]
        for block in blocks:
            chosen = block[block.channel == Channel.POSITION_GEODETIC]
            seconds, first = np.unique(chosen.stamp_ns // SECOND_NS, return_index=True)
            times.append(seconds * SECOND_NS)
            places.append(chosen.value[first])
        order = np.argsort(np.concatenate(times), kind='stable')
        self.time_ns: Int64 = np.concatenate(times)[order]
        self.degrees: Float64 = np.concatenate(places)[order]

    def away_m(self, other: LogTrack) -> tuple[Float64, Int64]:
        """
        Return how far the other is from here when she is there, less the way between.

        Parameters
        ----------
        other
            With a place at least.

        Returns
        -------
        distances, times
            [m], beyond what a ship can sail from the nearest time of this log; [ns].
        """
        after = np.searchsorted(self.time_ns, other.time_ns).clip(1, len(self.time_ns) - 1)
        before_ns = other.time_ns - self.time_ns[after - 1]
        after_ns = self.time_ns[after] - other.time_ns
        near = np.where(np.abs(before_ns) <= np.abs(after_ns), after - 1, after)
        north = other.degrees[:, 0] - self.degrees[near, 0]
        east = (other.degrees[:, 1] - self.degrees[near, 1] + 180.0) % 360.0 - 180.0
        east *= np.cos(np.radians(other.degrees[:, 0]))
        apart_m = np.hypot(north, east) * _METRES_PER_DEGREE
        between_s = np.abs(other.time_ns - self.time_ns[near]) / SECOND_NS
        return apart_m - ABSURD_SPEED_M_S * between_s, other.time_ns


def refuse_two_ships(ways: Sequence[LogTrack]) -> None:
    """
    Refuse logs that hold a ship at two places at one time.

    Raises
    ------
    ImportDataError
        If half of the common fixes of two logs are further apart than a ship is long.

    Notes
    -----
    Positions in metres have origins of their own and are not held against each other.
    """
    known = [way for way in ways if len(way.time_ns) > 1]
    for number, one in enumerate(known):
        for other in known[:number]:
            away_m, times = other.away_m(one)
            if np.median(away_m) > _APART_M:
                at = utc(int(times[len(times) // 2]))
                raise ImportDataError(
                    f'{other.name!r} and {one.name!r} are {np.median(away_m) / 1000.0:.0f} km '
                    f'apart about {at}: they are of two ships, or one clock is wrong. Read each '
                    'by itself'
                )


@dataclass(frozen=True)
class Joined:
    """
    What became of the files.

    Attributes
    ----------
    results
        Of each file.
    notes
        What was left out when they were put together, a sentence each.
    """

    results: list[ImportResult]
    notes: list[str]


def import_joined(
    parts: Sequence[tuple[Format, Job]],
    out: Path,
    attachments: Mapping[str, str],
    progress: PartDone | None = None,
) -> Joined:
    """
    Write the measurements of files as one bag.

    Parameters
    ----------
    parts
        Format and job of each file.
    out
        MCAP file to make.
    attachments
        Text by name, a ship file for instance.
    progress
        Called with how much of a file is read, and of how much.

    Raises
    ------
    ImportDataError
        If nothing in one of them can be used, or they hold a ship at two places at a time.
    BagError
        If the bag cannot be made.

    Notes
    -----
    Of an input that two files hold for the same time, the first file's is taken:
    two instruments are never mixed.
    """
    if len(parts) == 1:
        (declared, job), *_ = parts
        return Joined([declared.write(replace(job, progress=progress))], [])
    with TemporaryDirectory(prefix='shipdrag-import-') as folder:
        made = [Path(folder) / f'{number}.mcap' for number in range(len(parts))]
        results = [
            declared.write(replace(job, out=path, attachments={}, progress=progress))
            for (declared, job), path in zip(parts, made, strict=True)
        ]
        runs = [open_runs([path])[0] for path in made]
        names = [job.source.name for _, job in parts]
        refuse_two_ships(
            [LogTrack(name, _blocks(run)) for name, run in zip(names, runs, strict=True)]
        )
        taken, notes = _taken(runs, names)
        with new_bag(out, attachments) as bag:
            about = {name: run.attachments.get(ATTACHMENT, '') for name, run in zip(names, runs)}
            bag.attach(ATTACHMENT, strict_yaml.dump({'sources': about}))
            for block in _merged([_without(run, own) for run, own in zip(runs, taken)]):
                bag.write_samples(block)
    return Joined(results, notes)


Spans = dict[Channel, list[tuple[int, int]]]


def _taken(runs: Sequence[Run], names: Sequence[str]) -> tuple[list[Spans], list[str]]:
    """Return for each run the spans of each channel that earlier ones cover, and say so."""
    covered: dict[str, list[tuple[int, int]]] = {}
    left_out: list[Spans] = []
    notes = []
    for run, name in zip(runs, names, strict=True):
        own: dict[Channel, list[int]] = {}
        for block in _blocks(run):
            for number in np.unique(block.channel):
                stamps = block.stamp_ns[block.channel == number]
                low, high = own.setdefault(Channel(number), [int(stamps.min()), int(stamps.max())])
                own[Channel(number)] = [min(low, int(stamps.min())), max(high, int(stamps.max()))]
        spans = {channel: list(covered.get(channel.input, [])) for channel in own}
        left_out.append(spans)
        lost = {
            channel.input
            for channel, (low, high) in own.items()
            if any(start <= high and low <= end for start, end in spans[channel])
        }
        if lost:
            notes.append(
                f'{name}: {", ".join(sorted(lost))} not taken for the time that an earlier file '
                'gives it too.'
            )
        for channel, (low, high) in own.items():
            covered.setdefault(channel.input, []).append((low, high))
    return left_out, notes


def _blocks(run: Run) -> Iterator[Block]:
    """Yield the samples of a run; one that was imported holds nothing else."""
    for part in run.inputs():
        assert isinstance(part, Block)
        yield part


def _without(run: Run, spans: Spans) -> Iterator[Block]:
    """Yield the samples of a run outside of spans of their channel."""
    for block in _blocks(run):
        keep = np.ones(len(block), np.bool_)
        for channel, covered in spans.items():
            for start, end in covered:
                inside = (block.stamp_ns >= start) & (block.stamp_ns <= end)
                keep[inside & (block.channel == channel)] = False
        if keep.any():
            yield block[keep]


def _merged(sources: Sequence[Iterator[Block]]) -> Iterator[Block]:
    """Merge blocks by time of arrival, in the memory of one block a source."""
    waiting: list[Block | None] = [next(source, None) for source in sources]
    while any(block is not None for block in waiting):
        horizon = min(int(block.receive_ns[-1]) for block in waiting if block is not None)
        due = []
        for place, block in enumerate(waiting):
            if block is None:
                continue
            count = int(np.searchsorted(block.receive_ns, horizon, side='right'))
            due.append(block[slice(0, count)])
            rest = block[slice(count, None)]
            waiting[place] = rest if len(rest) else next(sources[place], None)
        yield in_arrival_order(due)
