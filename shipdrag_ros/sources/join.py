# SPDX-License-Identifier: Apache-2.0
"""
Several files of one ship as one log.

A ship is nowhere twice at one time: logs that say so are of two, and refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shipdrag_ros import strict_yaml
from shipdrag_ros.display import utc
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import (
    ABSURD_SPEED_M_S,
    SECOND_NS,
    Block,
    Channel,
    Float64,
    Int64,
    concatenate,
    in_arrival_order,
)
from shipdrag_ros.sources.format import Format, ImportResult, Job
from shipdrag_ros.sources.log import ATTACHMENT, Log
from shipdrag_ros.sources.run import run_of

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
    block
        Its samples.
    """

    def __init__(self, name: str, block: Block) -> None:
        self.name = name
        chosen = block[block.channel == Channel.POSITION_GEODETIC]
        seconds, first = np.unique(chosen.stamp_ns // SECOND_NS, return_index=True)
        self.time_ns: Int64 = seconds * SECOND_NS
        self.degrees: Float64 = chosen.value[first]

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
    log
        What they hold together.
    results
        Of each file.
    notes
        What was left out when they were put together, a sentence each.
    """

    log: Log
    results: list[ImportResult]
    notes: list[str]


def read_joined(parts: Sequence[tuple[Format, Job]]) -> Joined:
    """
    Read the measurements of files as one log.

    Parameters
    ----------
    parts
        Format and job of each file.

    Raises
    ------
    ImportDataError
        If nothing in one of them can be used, or they hold a ship at two places at a time.

    Notes
    -----
    Of an input that two files hold for the same time, the first file's is taken:
    two instruments are never mixed.
    """
    logs = [Log() for _ in parts]
    results = [declared.read(job, log) for (declared, job), log in zip(parts, logs, strict=True)]
    joined, notes = join([(job.source.name, log) for (_, job), log in zip(parts, logs)])
    return Joined(joined, results, notes)


def join(logs: Sequence[tuple[str, Log]]) -> tuple[Log, list[str]]:
    """
    Put logs together; what is left out is said.

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
        return logs[0][1], []
    blocks = [_block(log) for _, log in logs]
    names = [name for name, _ in logs]
    refuse_two_ships([LogTrack(*each) for each in zip(names, blocks, strict=True)])
    taken, notes = _taken(blocks, names)
    whole = in_arrival_order(taken)
    joined = Log()
    about = {name: log.attachments.get(ATTACHMENT, '') for name, log in logs}
    joined.attach(ATTACHMENT, strict_yaml.dump({'sources': about}))
    joined.write_samples(whole)
    return joined, notes


def _block(log: Log) -> Block:
    """Return all samples of a log; messages as their topics say."""
    if log.messages is None:
        return concatenate(log.blocks)
    return concatenate([item for item in run_of(log, []).inputs() if isinstance(item, Block)])


def _taken(blocks: Sequence[Block], names: Sequence[str]) -> tuple[list[Block], list[str]]:
    """Leave out of each block the spans that earlier ones give of the same input, and say so."""
    covered: dict[str, list[tuple[int, int]]] = {}
    left, notes = [], []
    for block, name in zip(blocks, names, strict=True):
        keep = np.ones(len(block), np.bool_)
        own: list[tuple[str, tuple[int, int]]] = []
        lost = set()
        for number in np.unique(block.channel):
            of_channel = block.channel == number
            stamps = block.stamp_ns[of_channel]
            name_of = Channel(number).input
            own.append((name_of, (int(stamps.min()), int(stamps.max()))))
            for start, end in covered.get(name_of, []):
                if start <= stamps.max() and stamps.min() <= end:
                    lost.add(name_of)
                keep[of_channel & (block.stamp_ns >= start) & (block.stamp_ns <= end)] = False
        left.append(block[keep])
        if lost:
            notes.append(
                f'{name}: {", ".join(sorted(lost))} not taken for the time that an earlier file '
                'gives it too.'
            )
        for name_of, span in own:
            covered.setdefault(name_of, []).append(span)
    return left, notes
