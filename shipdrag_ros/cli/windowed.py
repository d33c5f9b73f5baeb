# SPDX-License-Identifier: Apache-2.0
"""Bags, and logs that are made bags, as a verb takes them; with a window each: `BAG@START:END`."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from shipdrag_ros.bags import Run, WindowedRun, WindowSpan, open_runs
from shipdrag_ros.bags.mcap_file import METADATA, is_bag
from shipdrag_ros.cli.arguments import bag
from shipdrag_ros.cli.output import Output


def open_sources(paths: Sequence[Path], output: Output, *, remap: Mapping[str, str]) -> list[Run]:
    """
    Open bags and logs; what was understood of a log is printed on stderr.

    Parameters
    ----------
    paths
    output
    remap
        Recorded topic -> input.

    Raises
    ------
    BagError
        If a bag cannot be read.
    ImportDataError
        If nothing in a log can be used.
    """
    if all(is_bag(path) for path in paths):
        return open_runs(paths, remap=remap)
    from shipdrag_ros.sources.reading import read_any  # a bag needs no importer

    return read_any(paths, remap=remap, show=lambda lines: output.log('\n'.join(lines)))


class WindowedBag(NamedTuple):
    """A bag, and the window of it that was given, [s] from its start."""

    path: Path
    window: WindowSpan | None


def windowed_bag(text: str) -> WindowedBag:
    """
    Read `BAG` or `BAG@START:END`; a file of that very name is meant before all.
    """
    path = bag(text)
    name, at, window = text.rpartition('@')
    # what stands behind the sign is a window if it looks like one, or what is before it is there
    meant = bool(at) and (':' in window or (bool(name) and bag(name).exists()))
    if not meant or path.exists():
        return WindowedBag(path, None)
    start, _, end = window.partition(':')
    try:
        span = (float(start), float(end))
    except ValueError:
        span = (math.nan, math.nan)
    if not name or not all(map(math.isfinite, span)):
        raise argparse.ArgumentTypeError(
            f'{text!r}: the window {window!r} is not START:END in s from the start of the bag, '
            f'as in {name or "BAG"}@120:900'
        )
    if not 0.0 <= span[0] < span[1]:
        raise argparse.ArgumentTypeError(
            f'{text!r}: the window runs from {span[0]:g} to {span[1]:g} s; expected 0 <= START < '
            'END, in s from the start of the bag'
        )
    return WindowedBag(bag(name), span)


def add_bags(parser: argparse.ArgumentParser, metavar: str = 'BAG') -> None:
    """
    Add one bag or several, each with a window where one is given.
    """
    parser.add_argument('bags', nargs='+', type=windowed_bag, metavar=metavar)


def open_windowed(
    bags: Sequence[WindowedBag],
    *,
    remap: Mapping[str, str],
    output: Output,
    window: Sequence[float] | None = None,
) -> list[WindowedRun]:
    """
    Open bags in the order given.

    Parameters
    ----------
    bags
        From `windowed_bag`. One with a window is a run of its own, and may be given
        again with another window; parts of one recording are joined among the others.
    remap
        Recorded topic -> input.
    output
        Called with what was understood of a log that is no bag.
    window
        Of the bags without a window of their own.

    Raises
    ------
    BagError
        If a bag cannot be read.
    ImportDataError
        If nothing in a log can be used.
    """
    whole = [each.path for each in bags if each.window is None]
    left = open_sources(whole, output, remap=remap) if whole else []
    of_all = None if window is None else (window[0], window[1])
    found: list[WindowedRun] = []
    for each in bags:
        if each.window is not None:
            runs = open_sources([each.path], output, remap=remap)
        else:
            files = each.path.parent if each.path.name == METADATA else each.path
            runs = [run for run in left if any(file.is_relative_to(files) for file in run.paths)]
            left = [run for run in left if run not in runs]
        found += [WindowedRun(run, each.window or of_all) for run in runs]
    return found + [WindowedRun(run, of_all) for run in left]


def open_parts(
    bags: Sequence[WindowedBag], output: Output, *, remap: Mapping[str, str]
) -> list[Run]:
    """
    Open bags as `open_windowed` does; of one with a window, this part alone.
    """
    found = open_windowed(bags, remap=remap, output=output)
    return [run.part(*own) if own else run for run, own in found]
