# SPDX-License-Identifier: Apache-2.0
"""
Arguments that several verbs share, checked where they are given, and the bags they name, opened.

Options
-------
--json FILE
    write the result as JSON, NaN as null, to FILE; without FILE: JSON alone on stdout and the
    readable result on stderr
--ship FILE
    ship file (YAML) (default: the one attached to the bag, else ship.yaml beside it)
--parameters FILE
    parameters as `name: value` (YAML) (default: those attached to the bag)
--stop TIME
    the engine was stopped then, within some seconds [s from the start of the bag, or ISO 8601
    with its zone]: evidence that the regimes weigh with the rest
STORE
    folder that `shipdrag fleet` has written
--remap FROM:=TO
    read topic FROM of the bag as input TO; may be given more than once
--effects DIR
    folder of effects as `shipdrag learn` writes them (.yaml), which count beside those of the
    library; may be repeated
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.imports import need

if TYPE_CHECKING:
    from shipdrag_ros.bags import Run, WindowedRun, WindowSpan
    from shipdrag_ros.library.replaying import Listener

STDOUT = '-'
PART = 'BAG@START:END takes this part alone [s from its start], as --window does'
REPORT = ('matplotlib', 'jinja2')
"""Modules that a page with pictures needs."""


class Help(argparse.ArgumentDefaultsHelpFormatter):
    """Name every default that says something; leave examples to stand line by line."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        if action.default in (None, False, []) or '(default: ' in (action.help or ''):
            return action.help
        return super()._get_help_string(action)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith('example'):
            return text
        return super()._fill_text(text, width, indent)


def stop_time(text: str) -> float | datetime:
    """
    Read a time: s from the start of the bag, or ISO 8601 with its zone.
    """
    with suppress(argparse.ArgumentTypeError):
        return number(0.0)(text)
    with suppress(ValueError):
        at = datetime.fromisoformat(text)
        if at.tzinfo is not None:
            return at
    raise argparse.ArgumentTypeError(
        f'{text!r}, expected s from the start of the bag, or a time of day with its zone, as '
        '2026-06-01T08:05:00Z'
    )


def number(
    low: float, high: float = math.inf, *, unit: str = '', above: bool = False
) -> Callable[[str], float]:
    """
    Return a reader of numbers low <= x <= high, or low < x with `above`.
    """

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        # written so that NaN fails
        if not (math.isfinite(value) and low <= value <= high) or (above and value == low):
            most = f' and at most {high:g}' if math.isfinite(high) else ''
            least = f'above {low:g}' if above else f'at least {low:g}'
            if low == -math.inf:
                least = 'finite'
            raise argparse.ArgumentTypeError(
                f'{text!r}, expected a number {least}{most}{f" [{unit}]" if unit else ""}'
            )
        return value

    return read


def whole(low: int, high: float = math.inf) -> Callable[[str], int]:
    """
    Return a reader of whole numbers low <= n <= high.
    """

    def read(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            within = f' from {low} to {high:g}' if math.isfinite(high) else f', {low} or more'
            raise argparse.ArgumentTypeError(f'{text!r}, expected a whole number{within}')
        return int(text)

    return read


class _Remap(argparse.Action):
    """Collects remappings by name, of which none takes the place of another unseen."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: Any, pair: Any, *_: Any
    ) -> None:
        found = getattr(namespace, self.dest)
        if pair[0] in found:
            parser.error(f'argument --remap: {pair[0]!r} is remapped twice; give it once')
        setattr(namespace, self.dest, found | dict([pair]))


def remap(text: str) -> tuple[str, str]:
    """
    Read `from:=to`.
    """
    topic, separator, name = text.partition(':=')
    if not (topic and separator and name):
        raise argparse.ArgumentTypeError(
            f'{text!r}, expected FROM:=TO, a topic of the bag and one of the inputs; '
            'write --remap before each'
        )
    return topic, name


def bag(text: str) -> Path:
    """
    Read the path of a bag.
    """
    if ':=' in text:
        raise argparse.ArgumentTypeError(f'{text!r} is a remapping; write --remap before each')
    return Path(text)


def new_file(ending: str) -> Callable[[str], Path]:
    """
    Return a reader of the path of a file to write, in a folder that exists.
    """

    def read(text: str) -> Path:
        path = Path(text)
        if path.suffix != ending:
            raise argparse.ArgumentTypeError(f'{text!r}, expected a name that ends in {ending}')
        _check_folder(path)
        if ending == '.html':
            need(*REPORT)
        return path

    return read


def checked(read: Callable[[str], Any]) -> Callable[[str], Any]:
    """
    Return a reader whose errors are of the use of the command.
    """

    def reader(text: str) -> Any:
        try:
            return read(text)
        except (ValueError, ShipdragError) as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return reader


def unused_file(ending: str) -> Callable[[str], Path]:
    """
    Return a reader of the path of a file to write that does not exist yet.
    """
    in_a_folder = new_file(ending)

    def read(text: str) -> Path:
        path = in_a_folder(text)
        if path.exists():
            raise argparse.ArgumentTypeError(f'{text!r} exists; choose another name or remove it')
        return path

    return read


def _check_folder(path: Path) -> None:
    """Refuse now, not when the work is done."""
    if not path.parent.is_dir():
        raise argparse.ArgumentTypeError(
            f'{str(path)!r}: no folder {str(path.parent)!r}; make it first'
        )


def _json_file(text: str) -> str:
    # `--json a.mcap` takes the bag for the file to write, and would destroy it
    path = Path(text)
    if path.suffix == '.mcap' or path.is_dir() or (path.is_file() and path.suffix != '.json'):
        raise argparse.ArgumentTypeError(
            f'{text!r} would be overwritten by the JSON; for stdout put --json last or write '
            f'--json={STDOUT}, for a file give a new name or one that ends in .json'
        )
    _check_folder(path)
    return text


_SHARED: dict[str, dict[str, Any]] = {
    '--json': {'nargs': '?', 'const': STDOUT, 'type': _json_file},
    '--ship': {'type': Path},
    '--parameters': {'type': Path},
    '--window': {'nargs': 2, 'type': number(0.0, unit='s')},
    '--stop': {'type': stop_time},
    '--remap': {'action': _Remap, 'default': {}, 'type': remap},
    '--report': {'type': new_file('.html')},
    '--effects': {'dest': 'effects_from', 'action': 'append', 'default': [], 'type': Path},
    'store': {'type': Path, 'metavar': 'STORE'},
}


def add(parser: argparse.ArgumentParser, *names: str) -> None:
    """
    Add arguments that several verbs share, by their names.
    """
    for name in names:
        parser.add_argument(name, **_SHARED[name])


def open_sources(
    paths: Sequence[Path], output: Listener, *, remap: Mapping[str, str]
) -> list[Run]:
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
    from shipdrag_ros.bags import open_runs
    from shipdrag_ros.bags.mcap_file import is_bag

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
    output: Listener,
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
    from shipdrag_ros.bags import WindowedRun
    from shipdrag_ros.bags.mcap_file import METADATA

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
    bags: Sequence[WindowedBag], output: Listener, *, remap: Mapping[str, str]
) -> list[Run]:
    """
    Open bags as `open_windowed` does; of one with a window, this part alone.
    """
    found = open_windowed(bags, remap=remap, output=output)
    return [run.part(*own) if own else run for run, own in found]
