# SPDX-License-Identifier: Apache-2.0
"""The installation: what of it works, and its completion in a shell."""

from __future__ import annotations

import argparse
import importlib.util
import os
import platform
import shutil
import socket
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import shtab

from shipdrag_ros import __version__, cli
from shipdrag_ros.cli.arguments import add
from shipdrag_ros.cli.output import CheckResult, CheckState, Output
from shipdrag_ros.display import Table
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.imports import EXTRA_OF, LEFT_OUT, pip_name
from shipdrag_ros.parameters import ESTIMATORS
from shipdrag_ros.simulation.effects import LIBRARY

BROKEN = 1
_PAGE_PORT = 8088
_LITTLE_BYTES = 2e9  # a week of three inputs at 10 Hz
_SYNCHRONISED = Path('/run/systemd/timesync/synchronized')
_NEEDED = (
    *('numpy', 'scipy', 'numba', 'ruamel.yaml', 'rich'),
    *('mcap', 'isal', 'rosbags', 'pynmeagps', 'serial'),
)
_OPTIONAL = {  # module: what does not work without it
    'rclpy': 'node, demo, and watch over a running node',
    'starlette': 'watch',
    'uvicorn': 'watch',
    'matplotlib': 'reports, pictures and demo',
    'nmea2000': 'logs of NMEA 2000',
    'pymavlink': 'logs of ArduPilot',
    'pyulog': 'logs of PX4',
    'distributed': 'fleet',
    'pyarrow': 'fleet and trend',
    's3fs': 'fleet over s3://',
    'duckdb': 'trend --sql',
}


_FINE, _LOOK, _BROKEN = CheckState


def add_doctor(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('--out', type=Path, default=Path())
    parser.add_argument('--run', dest='sails', action='store_true')
    add(parser, '--json')


def run_doctor(options: argparse.Namespace) -> int:
    """
    Look at the installation: Python, packages, ROS 2, where compiled code is kept, the port of
    the page, disk and clock. Changes nothing. Exit status: 0 all works, 1 something is broken.

    Options
    -------
    --out DIR
        where recordings would go (default: this folder)
    --run
        also sail a simulated ship past the node over ROS topics, replay what it records and
        compare with the truth: PASS, or what failed

    Examples
    --------
    shipdrag doctor
    shipdrag doctor --out records --json
    """
    output = Output(options.json)
    found = list(findings(options.out))
    if options.sails:
        output.log('sailing a simulated ship past the node; a first start compiles for minutes')
        from shipdrag_ros.cli.demo import run_through  # only who asks pays for it

        found += run_through()
    rows = tuple((each.what, each.state.value, each.found, each.do or '-') for each in found)
    output.table(Table(('what', 'state', 'found', 'what to do'), rows))
    wrong = [each for each in found if each.state is _BROKEN]
    if options.sails:
        failed = [f'FAIL: {each.what}: {each.found}; {each.do}' for each in wrong]
        output.say('\n'.join(failed) or 'PASS')
    documents = [
        {**each._asdict(), 'state': each.state.value.lower(), 'do': each.do or None}
        for each in found
    ]
    output.json({'works': not wrong, 'findings': documents})
    return BROKEN if wrong else 0


def findings(out: Path) -> Iterator[CheckResult]:
    """
    Look at everything.

    Parameters
    ----------
    out
        Where recordings would go.

    Yields
    ------
    Finding
    """
    yield CheckResult(
        'shipdrag_ros', _FINE, f'{__version__} on Python {platform.python_version()}'
    )
    yield _machine()
    yield from _packages()
    yield from _left_out()
    yield _discovery()
    yield _compiled()
    yield _port(_PAGE_PORT)
    yield _disk(out)
    yield _clock()


def _machine() -> CheckResult:
    if platform.machine() in ('x86_64', 'AMD64'):
        return CheckResult('machine', _FINE, f'{platform.machine()}, {os.cpu_count()} cores')
    do = 'the lock file is tried on x86-64 alone; without ROS most of it works elsewhere'
    return CheckResult('machine', _LOOK, platform.machine(), do)


def _packages() -> Iterator[CheckResult]:
    missing = [name for name in _NEEDED if not _is_there(name)]
    if missing:
        yield CheckResult('packages', _BROKEN, f'missing: {", ".join(missing)}', 'make env')
    else:
        yield CheckResult('packages', _FINE, f'all {len(_NEEDED)} that every verb needs')
    for name, without in _OPTIONAL.items():
        if _is_there(name):
            yield CheckResult(name, _FINE, 'there')
        else:
            extra = EXTRA_OF.get(name)
            do = f'pip install {pip_name(extra)}' if extra else 'make env'
            if name == 'rclpy':
                do += ', or source ROS 2 Jazzy'
            yield CheckResult(name, _LOOK, f'missing; does not work: {without}', do)


def _is_there(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False


def _left_out() -> Iterator[CheckResult]:
    from shipdrag_ros.estimation.estimators import named  # who looks at all of it pays for it
    from shipdrag_ros.sources import formats

    for name in ESTIMATORS:
        with suppress(EstimationError):
            named(name)
    for look in (formats.found, LIBRARY.keys, cli.verbs):
        len(look())
    for point, why in LEFT_OUT.items():
        what = f'package {point.dist.name if point.dist else "?"}'
        yield CheckResult(what, _LOOK, why, 'mend or uninstall it')


def _discovery() -> CheckResult:
    reach = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', '')
    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    if reach:
        return CheckResult('ROS discovery', _FINE, f'{reach}, domain {domain}, by the environment')
    found = f'not set, domain {domain}: shipdrag node receives from this machine alone'
    do = 'to receive from the network: shipdrag node --network'
    return CheckResult('ROS discovery', _FINE, found, do)


def _compiled() -> CheckResult:
    from shipdrag_ros.compiled import CACHE_DIR, cache_root  # numba takes long to import

    root = cache_root()
    if root is None:
        do = f'set {CACHE_DIR} to a folder that can be written'
        return CheckResult('compiled code', _LOOK, 'not kept: each start compiles again', do)
    modules = sum(each.is_dir() for each in root.iterdir())
    if not modules:
        return CheckResult('compiled code', _LOOK, f'none yet in {root}', 'make warm, once')
    return CheckResult('compiled code', _FINE, f'of {modules} modules in {root}')


def _port(port: int) -> CheckResult:
    with socket.socket() as probe:
        try:
            probe.bind(('127.0.0.1', port))
        except OSError:
            do = 'a page may run there already; else shipdrag watch --port N'
            return CheckResult(f'port {port}', _LOOK, 'in use', do)
    return CheckResult(f'port {port}', _FINE, 'free for shipdrag watch')


def _disk(out: Path) -> CheckResult:
    place = next(each for each in (out.absolute(), *out.absolute().parents) if each.exists())
    if not os.access(place, os.W_OK):
        return CheckResult('disk', _BROKEN, f'{place} cannot be written', 'give --out DIR')
    free = shutil.disk_usage(place).free
    if free < _LITTLE_BYTES:
        do = 'make room, or bound the recordings: shipdrag node --keep-bytes N'
        return CheckResult('disk', _LOOK, f'{free / 1e9:.1f} GB free in {place}', do)
    return CheckResult('disk', _FINE, f'{free / 1e9:.0f} GB free in {place}')


def _clock() -> CheckResult:
    if sys.platform != 'linux' or not _SYNCHRONISED.parent.exists():
        do = 'see to it that one does (GNSS or NTP): runs are dated by this clock'
        return CheckResult('clock', _LOOK, 'not known whether anything sets it', do)
    if not _SYNCHRONISED.exists():
        return CheckResult('clock', _LOOK, 'systemd has not set it yet', 'timedatectl status')
    return CheckResult('clock', _FINE, 'set by systemd-timesyncd')


SHELLS = ('bash', 'zsh', 'fish')
_FOLDER = ('DIR', 'STORE', 'DIR_OR_URL')
_FILE = ('FILE', 'BAG', 'SOURCE')


def add_completion(parser: argparse.ArgumentParser) -> None:
    """
    Add what the verb takes.
    """
    parser.add_argument('shell', choices=SHELLS)
    parser.add_argument('-o', '--out', type=Path)


def run_completion(options: argparse.Namespace) -> int:
    """
    Print the script that completes verbs, options and files. Where a shell looks for it: bash:
    ~/.local/share/bash-completion/completions/shipdrag; zsh: a file _shipdrag in a folder of
    $fpath; fish: ~/.config/fish/completions/shipdrag.fish.

    Options
    -------
    shell
        for which shell
    --out FILE
        write it there (default: to stdout)

    Examples
    --------
    shipdrag completion bash -o shipdrag.bash
    shipdrag completion fish
    """
    text = script(options.shell)
    if options.out is None:
        print(text)
    else:
        options.out.write_text(text + '\n', encoding='utf-8')
        print(f'{options.out} completes shipdrag in {options.shell} once it is read')
    return 0


def script(shell: str) -> str:
    """
    Return the script for a shell, one of `SHELLS`.
    """
    whole = cli.parser(*(verb.name for verb in cli.verbs()))
    verbs = next(each for each in whole._actions if isinstance(each, argparse._SubParsersAction))
    for parser in (whole, *verbs.choices.values()):
        for action in parser._actions:
            metavar = str(action.metavar or '').partition('.')[0]
            if metavar in _FOLDER:
                action.complete = shtab.DIRECTORY
            elif metavar in _FILE:
                action.complete = shtab.FILE
    return shtab.complete(whole, shell)
