# SPDX-License-Identifier: Apache-2.0
"""
Arguments that several verbs share, checked where they are given.

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
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.imports import need

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
