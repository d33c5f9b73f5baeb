# SPDX-License-Identifier: Apache-2.0
"""`shipdrag node`: the onboard node, started without a ROS tool."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from shipdrag_ros import strict_yaml
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.ship import Ship


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument(
        '--ship', required=True, type=Path, metavar='FILE', help='ship file (YAML)'
    )
    parser.add_argument(
        '--out',
        required=True,
        type=Path,
        metavar='DIR',
        help='where recordings are written; made if missing, nothing there is overwritten',
    )
    parser.add_argument(
        '--ros-args',
        nargs=argparse.REMAINDER,
        default=[],
        metavar='...',
        help='last: the rest goes to ROS, for instance -p window_s:=1800.0 or -r position:=/gps '
        'or --params-file parameters.yaml; --ship and --out hold whatever stands there',
    )


def run(options: argparse.Namespace) -> int:
    """
    Run the node until SIGINT or SIGTERM.
    """
    Ship.load(options.ship)  # here its problems are told before ROS starts
    output = Output()
    for line in overruled(options.ros_args, ship=options.ship, out=options.out):
        output.log(line)
    try:
        from shipdrag_ros.node import main
    except ModuleNotFoundError as error:
        raise no_ros(error) from error
    return main.run(options.ship, options.out, ros_arguments=options.ros_args)


def overruled(ros_arguments: Sequence[str], *, ship: Path, out: Path) -> list[str]:
    """
    Say which paths after `--ros-args` are not used, a line each.

    Parameters
    ----------
    ros_arguments
        What follows `--ros-args`.
    ship, out
        Of the command line, which hold.
    """
    used = {'ship_file': ('--ship', ship), 'output_directory': ('--out', out)}
    said = []
    for source, name, value in _stated(ros_arguments):
        # an empty path, and the folder '.', are defaults that nobody has chosen
        if name in used and value not in ('', '.', str(used[name][1])):
            flag, path = used[name]
            said.append(f"{name} '{value}' of {source} is not used: {flag} says '{path}'")
    return said


def _stated(ros_arguments: Sequence[str]) -> Iterator[tuple[str, str, object]]:
    """Yield where a parameter stands, its name and its value; what is wrong is told by ROS."""
    for flag, word in pairwise(ros_arguments):
        if flag in ('-p', '--param') and ':=' in word:
            name, _, text = word.partition(':=')
            yield flag, name.rpartition(':')[2], _yaml(text)
        elif flag == '--params-file' and Path(word).is_file():
            tree = _yaml(Path(word).read_text(encoding='utf-8', errors='replace'))
            for name, value in _parameters(tree):
                yield word, name, value


def _parameters(tree: object) -> Iterator[tuple[str, object]]:
    if not isinstance(tree, dict):
        return
    for key, branch in tree.items():
        if key == 'ros__parameters' and isinstance(branch, dict):
            yield from branch.items()
        else:
            yield from _parameters(branch)


def _yaml(text: str) -> object:
    try:
        return strict_yaml.load(text)
    except ValueError:
        return None


def no_ros(error: ModuleNotFoundError) -> ShipdragError:
    """
    Say how to install what is missing.
    """
    return ShipdragError(
        f'ROS 2 is not installed here (no module {error.name!r}); run `pip install .[ros]` in '
        'the source tree, or source the set-up file of a ROS 2 Jazzy installation'
    )
