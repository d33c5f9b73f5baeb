# SPDX-License-Identifier: Apache-2.0
"""
The onboard node: estimates live and records.

Options
-------
--ship FILE
    ship file (YAML)
--out DIR
    where recordings are written; made if missing, nothing there is overwritten
--nmea SOURCE
    receive NMEA 0183 beside topics: udp://ADDRESS:PORT, tcp://HOST:PORT or serial:DEVICE:BAUD;
    may be given several times
--keep-days N
    remove recordings that are older, unless they hold a coastdown (default: keep all)
--keep-bytes N
    remove the oldest recordings when all are larger together, those that hold a coastdown last,
    for instance 2e10 (default: half of the disk, and none that holds a coastdown; 1e15: keep all)
--network
    be found by ROS on the whole network; without it, and without a ROS environment variable that
    says so, on this machine alone
--ros-args ...
    last: the rest goes to ROS, for instance -p window_s:=1800.0 or -r position:=/gps or
    --params-file parameters.yaml; --ship and --out hold whatever stands there

Examples
--------
shipdrag node --ship ship.yaml --out records
shipdrag node --ship ship.yaml --out records --ros-args -p window_s:=1800.0 -r position:=/gps \
--params-file parameters.yaml
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, MutableMapping, Sequence
from itertools import pairwise
from pathlib import Path

from shipdrag_ros import strict_yaml
from shipdrag_ros.cli.arguments import number
from shipdrag_ros.cli.output import Output
from shipdrag_ros.nmea.live import parse_addresses
from shipdrag_ros.node.settings import sections
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import checked

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
LOCAL_ONLY = 'ROS_LOCALHOST_ONLY'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('--ship', required=True, type=Path)
    parser.add_argument('--out', required=True, type=Path)
    parser.add_argument('--nmea', action='append', default=[])
    parser.add_argument('--keep-days', type=number(0.0))
    parser.add_argument('--keep-bytes', type=number(0.0))
    parser.add_argument('--network', action='store_true')
    parser.add_argument('--ros-args', nargs=argparse.REMAINDER, default=[])


def run(options: argparse.Namespace) -> int:
    """
    Run the node until SIGINT or SIGTERM.
    """
    checked(Ship.load(options.ship))  # here its problems are said before ROS starts
    output = Output()
    for line in overruled(options.ros_args, ship=options.ship, out=options.out):
        output.log(line)
    from shipdrag_ros.node import main  # help must not need ROS

    output.log(discovery(os.environ, network=options.network))
    return main.run(
        options.ship,
        options.out,
        settings=stated_settings(options),
        ros_arguments=options.ros_args,
    )


def stated_settings(options: argparse.Namespace) -> dict[str, object]:
    """
    Return the parameters of the node that the command line states.

    Raises
    ------
    ShipdragError
        If a source of NMEA is none.
    """
    stated: dict[str, object] = {}
    if options.nmea:
        stated['nmea'] = ' '.join(str(each) for each in parse_addresses(' '.join(options.nmea)))
    if options.keep_days is not None:
        stated['keep_days'] = float(options.keep_days)
    if options.keep_bytes is not None:
        stated['keep_bytes'] = int(options.keep_bytes)
    return stated


def discovery(environment: MutableMapping[str, str], *, network: bool) -> str:
    """
    Settle who can find the node, and say it.

    Parameters
    ----------
    environment
        Of this process; set where it says nothing.
    network
        Whether `--network` was given.
    """
    if network:
        environment[RANGE] = 'SUBNET'
        environment.pop(LOCAL_ONLY, None)
        return (
            'the node is found on the whole network, by anybody (--network); see docs/security.md'
        )
    for name in (RANGE, LOCAL_ONLY):
        if name in environment:
            return f'who finds the node: {name}={environment[name]}, as the environment says'
    environment[RANGE] = 'LOCALHOST'
    return (
        f'the node is found on this machine alone; --network, or {RANGE}=SUBNET, opens it to '
        'drivers elsewhere on the network, and to everybody else there'
    )


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
    """Yield where a parameter stands, its name and its value; what is wrong is said by ROS."""
    for flag, word in pairwise(ros_arguments):
        if flag in ('-p', '--param') and ':=' in word:
            name, _, text = word.partition(':=')
            yield flag, name.rpartition(':')[2], _yaml(text)
        elif flag == '--params-file' and Path(word).is_file():
            tree = _yaml(Path(word).read_text(encoding='utf-8', errors='replace'))
            for _, values in sections(tree):
                yield from ((word, name, value) for name, value in values.items())


def _yaml(text: str) -> object:
    try:
        return strict_yaml.load(text)
    except ValueError:
        return None
