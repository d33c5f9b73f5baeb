# SPDX-License-Identifier: Apache-2.0
"""
The process around the node: start, spin, end cleanly on a signal.

rclpy's own signal handlers shut ROS down under the node's feet. Here a signal
only asks for the end, so that the last estimate is still published and the bag
is closed. In a terminal one live line shows state, speed, last figure and inputs.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TextIO

from shipdrag_ros.display import M_S_PER_KNOT
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.imports import uncollected
from shipdrag_ros.messages.topics import OK, Health

_CLEAR = '\x1b[K'


def show(health: Health, stream: TextIO) -> None:
    """
    Tell the service manager each second that the executor goes round, and a terminal the health.

    Parameters
    ----------
    stream
        Of the log; the line is left of the cursor, so that a log line writes over it.
    """
    notify(f'WATCHDOG=1\nSTATUS={health.of("state").message}')
    if stream.isatty():
        width = shutil.get_terminal_size().columns
        stream.write(f'{line(health)[: width - 1]}{_CLEAR}\r')
        stream.flush()


def line(health: Health) -> str:
    """
    Return a node's health in a line.
    """
    state, estimate = health.of('state'), health.of('estimate')
    monitor = state.values.get('monitor', '')
    said = [monitor or 'not active']
    lead_s, ready_s = health.lead
    if monitor == 'steady' and lead_s is not None and ready_s is not None:
        enough = 'min: record ready' if lead_s >= ready_s else f'of {ready_s / 60.0:.0f} min'
        said[0] = f'steady {lead_s // 60.0:.0f} {enough}'
    if state.level != OK and not state.message.startswith(f'{monitor};'):
        said[0] = state.message  # inputs that are not well are named behind it
    speed = estimate.number('speed through water')
    r = estimate.number('specific resistance')
    sigma = estimate.number('standard deviation of it')
    if speed is not None and r is not None and sigma is not None:
        band = f' ± {200.0 * sigma / r:.0f} %' if r > 0.0 else ''
        said.append(f'last at {speed / M_S_PER_KNOT:.1f} kn: r {r:.4f} m/s²{band}')
    heard = [status for status in health.inputs if status.number('messages')]
    bad = [status.input for status in heard if status.level != OK]
    said.append(f'{len(heard)} inputs' + (f', not well: {", ".join(bad)}' if bad else ''))
    return ' | '.join(said)


with uncollected():
    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import remove_ros_args

    from shipdrag_ros.node.background import leave_if_compiling
    from shipdrag_ros.node.node import CoastdownNode


def notify(state: str) -> None:
    """
    Tell the service manager, where there is one that listens (sd_notify).

    Parameters
    ----------
    state
        `READY=1` for instance; lines, one an assignment.
    """
    address = os.environ.get('NOTIFY_SOCKET', '')
    if not address:
        return
    if address.startswith('@'):  # of the abstract namespace
        address = f'\0{address[1:]}'
    # a manager that is gone ends no node
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.sendto(state.encode(), address)


USAGE = 'usage: coastdown_node --ros-args -p ship_file:=FILE [-p NAME:=VALUE]... [-r FROM:=TO]...'
STOPPING = (signal.SIGINT, signal.SIGTERM)


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run the node until a signal; the console script.

    Parameters
    ----------
    arguments
        Command line, the program's name first; that of the process by default.

    Returns
    -------
    int
        Exit status: 0 done, 1 user error, 2 usage.
    """
    line = list(sys.argv if arguments is None else arguments)
    try:
        status = _run(line)
    except ShipdragError as error:
        print(f'ERROR: {error}', file=sys.stderr)
        status = 1
    leave_if_compiling(status)
    return status


def run(
    ship_file: Path,
    output_directory: Path,
    *,
    settings: Mapping[str, object] | None = None,
    ros_arguments: Sequence[str] = (),
) -> int:
    """
    Run the node on a ship file, recording into a directory.

    Parameters
    ----------
    settings
        More parameters by name.
    ros_arguments
        More of what may follow `--ros-args`, for instance `['-p', 'window_s:=600.0']`; what
        is given here holds whatever is said of it there.
    """
    # the value of -p is YAML, and a JSON string is a YAML string whatever is in it
    paths = {'ship_file': str(ship_file), 'output_directory': str(output_directory)}
    given = {**(settings or {}), **paths}
    assignments = [f'{name}:={json.dumps(value)}' for name, value in given.items()]
    flags = [word for assignment in assignments for word in ('-p', assignment)]
    # of several values of a parameter ROS takes the last
    return main(['coastdown_node', '--ros-args', *ros_arguments, *flags])


def _run(line: list[str]) -> int:
    if 'HOME' not in os.environ:  # as under systemd; ROS refuses to start without a place for logs
        os.environ.setdefault('ROS_LOG_DIR', tempfile.gettempdir())
    context = rclpy.Context()
    try:
        rclpy.init(args=line, context=context, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        why = re.sub(r', at /\S+:\d+|\n', '', str(error))  # places in the source of rcl
        raise ShipdragError(f'ROS does not start: {why}; check what follows --ros-args') from error
    try:
        if stray := remove_ros_args(line)[1:]:
            print(f'{USAGE}\nunknown: {" ".join(stray)}', file=sys.stderr)
            return 2
        executor = SingleThreadedExecutor(context=context)
        with _ended_by_signal() as stop:
            node = CoastdownNode(context=context, arguments=line)
            try:
                executor.add_node(node)
                node.shown = partial(show, stream=sys.stderr)
                node.start()
                notify('READY=1')
                while not stop.is_set():
                    executor.spin_once()
            except ExternalShutdownException:
                pass
            finally:
                notify('STOPPING=1')
                node.close()
    finally:
        rclpy.try_shutdown(context=context)
    return 0


@contextmanager
def _ended_by_signal() -> Iterator[threading.Event]:
    """
    Give an event that SIGINT and SIGTERM set.

    A Python handler has to wait until the executor returns from C, which the timers of the node
    let it do every `LOOK_S`.
    """
    stop = threading.Event()
    before = {number: signal.signal(number, lambda *_: stop.set()) for number in STOPPING}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


if __name__ == '__main__':
    sys.exit(main())
