# SPDX-License-Identifier: Apache-2.0
"""Several files of one ship as one bag."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from shipdrag_ros import strict_yaml
from shipdrag_ros.bags import Run, open_runs
from shipdrag_ros.importing.bag import ATTACHMENT, new_bag
from shipdrag_ros.importing.format import Format, ImportResult, Job
from shipdrag_ros.importing.one_ship import LogTrack, refuse_two_ships
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import Block, Channel, in_arrival_order


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
