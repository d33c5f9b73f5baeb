# SPDX-License-Identifier: Apache-2.0
"""On board: the node, and the page of the bridge."""

from __future__ import annotations

import argparse
import contextlib
import ipaddress
import os
import stat
import sys
from collections.abc import Callable, Iterator, MutableMapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from shipdrag_ros import strict_yaml
from shipdrag_ros.cli.arguments import add, number, open_parts, whole, windowed_bag
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.live import FASTEST
from shipdrag_ros.nmea.live import parse_addresses
from shipdrag_ros.node.settings import sections
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import checked

if TYPE_CHECKING:
    from shipdrag_ros.live.app import FleetPages
    from shipdrag_ros.live.outputs import PastRun
    from shipdrag_ros.live.source import PictureFeed

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
LOCAL_ONLY = 'ROS_LOCALHOST_ONLY'
SHORTEST_TOKEN = 16
LOOPBACK = '127.0.0.1'


def add_node(parser: argparse.ArgumentParser) -> None:
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


def run_node(options: argparse.Namespace) -> int:
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
        remove the oldest recordings when all are larger together, those that hold a coastdown
        last, for instance 2e10 (default: half of the disk, and none that holds a coastdown; 1e15:
        keep all)
    --network
        be found by ROS on the whole network; without it, and without a ROS environment variable
        that says so, on this machine alone
    --ros-args ...
        last: the rest goes to ROS, for instance -p window_s:=1800.0 or -r position:=/gps or
        --params-file parameters.yaml; --ship and --out hold whatever stands there

    Examples
    --------
    shipdrag node --ship ship.yaml --out records
    shipdrag node --ship ship.yaml --out records --ros-args -p window_s:=1800.0 -r position:=/gps \
--params-file parameters.yaml
    """
    checked(Ship.load(options.ship))  # here its problems are said before ROS starts
    output = Output()
    output.log(*overruled(options.ros_args, ship=options.ship, out=options.out))
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


def add_watch(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('bags', nargs='*', type=windowed_bag, metavar='BAG')
    parser.add_argument('--port', type=whole(0, 65535), default=8088)
    parser.add_argument('--listen', default=LOOPBACK)
    parser.add_argument('--token-file', type=Path)
    parser.add_argument('--speed', type=number(0.0, FASTEST, above=True), default=10.0)
    add(parser, '--ship')
    parser.add_argument('--earlier', type=Path)
    parser.add_argument('--node', default='')
    parser.add_argument('--signal-k', type=whole(0, 65535))
    parser.add_argument('--store', type=Path)
    parser.add_argument('--allow-marks', action='store_true')
    add(parser, '--remap')


def run_watch(options: argparse.Namespace) -> int:
    """
    Serve one page for the bridge: the state and what to do now, speed, r(v) against the clean
    hull, inputs, checklist and verdict. Without a bag it shows the node that runs on this
    network, which may come and go; with bags or logs it plays them. It only reads, but for
    --allow-marks.

    Options
    -------
    BAG
        bag or log to play; BAG@START:END is this part alone [s from its start]
    --speed X
        seconds of a bag in a second [-]
    --ship FILE
        ship file, instead of that of the node or of the bag
    --earlier DIR
        folder of bags that this ship's nodes recorded: their coastdowns are listed
    --node NAME
        full name of the node (default: the first)
    --signal-k PORT
        send Signal K deltas, a line each, to who connects to this TCP port of this machine
    --store STORE
        store of `shipdrag fleet`: the page of the fleet stands under /fleet
    --allow-marks
        a button tells the node that the engine was stopped just now: who sees the page may press
        it
    --port
        of the page, 0: any free one
    --listen ADDRESS
        address to listen on; any but that of this machine alone needs --token-file
    --token-file FILE
        text of at least {SHORTEST_TOKEN} characters that a viewer must give

    Examples
    --------
    shipdrag watch --port 8090 --earlier records
    shipdrag watch run.mcap --speed 20
    """
    # a server takes long to import
    from shipdrag_ros.live.app import FLEET, LivePage
    from shipdrag_ros.live.serve import listen, serve

    output = Output()
    if options.allow_marks and options.bags:
        raise ShipdragError(
            '--allow-marks tells a running node; of a bag say it with `shipdrag replay --stop '
            'TIME`'
        )
    token = _token(options.listen, options.token_file)
    ship = None if options.ship is None else Ship.load(options.ship)
    notes: list[str] = []
    page_socket = listen(options.listen, options.port)
    deltas = None if options.signal_k is None else listen(LOOPBACK, options.signal_k)
    with page_socket, contextlib.ExitStack() as stack:
        past = [] if options.earlier is None else list(_earlier(options.earlier, notes))
        source, mark = stack.enter_context(_source(options, ship, past, output, notes))
        fleet = None if options.store is None else fleet_pages(output, options.store)
        output.log(*notes)
        name, port = page_socket.getsockname()[:2]
        shown = f'[{name}]' if ':' in name else name

        def announce() -> None:
            output.say(f'the page: http://{shown}:{port}/')
            if fleet is not None:
                output.say(f'the fleet: http://{shown}:{port}{FLEET}')
            if deltas is not None:
                output.say(f'Signal K deltas: tcp://{LOOPBACK}:{deltas.getsockname()[1]}')
            if token is not None:
                output.log(
                    'a viewer gives the token once; there is no encryption, see docs/bridge.md'
                )
            output.log('Ctrl-C ends it; the node is not touched')

        page = LivePage(
            source, token=token, notes=tuple(notes), fleet=fleet, mark=mark, ready=announce
        )
        serve(page, [page_socket], deltas=deltas)
    # a library's thread may still be in compiled code, where the end of the interpreter aborts it
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


@contextlib.contextmanager
def _source(
    options: argparse.Namespace,
    ship: Ship | None,
    past: list[PastRun],
    output: Output,
    notes: list[str],
) -> Iterator[tuple[PictureFeed, Callable[[], str] | None]]:
    """Yield what feeds the page, and what tells the node of a stop; end it. Bags add notes."""
    from shipdrag_ros.live.source import BagSource, NodeSource

    if options.bags:
        runs = open_parts(options.bags, output, remap=options.remap)
        player = BagSource(runs, ship=ship, speed=options.speed, past=past)
        notes += (f'{run.name}: {each}' for run in runs for each in run.warnings)
        with contextlib.closing(player) as bags:
            yield bags, None
        return
    from shipdrag_ros.node.spectator import Spectator

    node = NodeSource(ship)
    for each in past:
        node.hear(each)
    marks = bool(options.allow_marks)
    with Spectator(node.hear, node=options.node, marks=marks) as spectator:
        yield node, spectator.mark_stop if marks else None


def fleet_pages(output: Output, store: Path) -> FleetPages:
    """
    Return the pages of the fleet by a store of `shipdrag fleet`.
    """
    # Parquet and pictures take long to import
    from shipdrag_ros.fleet.store import read_coastdowns
    from shipdrag_ros.library.trends import trends_of
    from shipdrag_ros.live.app import FLEET, FleetPages
    from shipdrag_ros.trend.page import fleet_text, links

    rows = read_coastdowns(store).to_pylist()
    text = fleet_text(*trends_of(output, store), links=links(rows, f'{FLEET}/'))
    return FleetPages(text, rows)


def _earlier(folder: Path, notes: list[str]) -> Iterator[PastRun]:
    """Yield the coastdowns of a folder; what gave none is said."""
    from shipdrag_ros.live.outputs import recorded_runs

    for found in recorded_runs(folder):
        if isinstance(found, str):
            notes.append(found)
        else:
            yield found


def _token(address: str, file: Path | None) -> str | None:
    try:
        alone = ipaddress.ip_address(address).is_loopback
    except ValueError:
        raise ShipdragError(
            f'--listen {address!r}: expected an address such as 192.168.1.5, or 0.0.0.0 for all'
        ) from None
    if file is None and not alone:
        raise ShipdragError(
            f'--listen {address} lets others in: give --token-file FILE with a text of at least '
            f'{SHORTEST_TOKEN} characters that they must know'
        )
    if file is None:
        return None
    about = os.stat(file)
    if not stat.S_ISREG(about.st_mode):
        raise ShipdragError(f'--token-file {str(file)!r}: is no regular file')
    if about.st_mode & stat.S_IRWXO:
        raise ShipdragError(
            f'--token-file {str(file)!r}: every user of this machine may read it; chmod 600 it'
        )
    with file.open('rb') as stream:
        token = stream.read(1000).decode(errors='replace').strip()
    if len(token) < SHORTEST_TOKEN or not token.isprintable():
        raise ShipdragError(
            f'--token-file {str(file)!r}: expected one line of at least {SHORTEST_TOKEN} '
            'characters, for instance of `openssl rand -hex 16`'
        )
    return token
