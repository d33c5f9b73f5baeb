# SPDX-License-Identifier: Apache-2.0
"""The node in a process of its own, and a ship that sails past it, on this machine alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.samples import Block

if TYPE_CHECKING:  # help must not need ROS
    from shipdrag_ros.node.rehearsal import Rehearsal

_CONNECT_S = 120.0  # the first start on a machine compiles the kernels
_ANSWER_S = 1.0
_END_S = 30.0
_FIRST_DOMAIN, _DOMAINS = 61, 41  # above 101 the ports run into those for outgoing traffic


class OnboardNode:
    """The node in a process of its own, on a domain that nobody else uses."""

    def __init__(self, ship_file: Path, recordings: Path, log: Path, *settings: str) -> None:
        self.log = log
        with log.open('w') as file:
            self._process = subprocess.Popen(
                [
                    *(sys.executable, '-m', 'shipdrag_ros.cli', 'node'),
                    *('--ship', ship_file, '--out', recordings),
                    *('--ros-args', '-p', 'use_sim_time:=true'),
                    *(word for each in settings for word in ('-p', each)),
                ],
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
            )

    @property
    def is_running(self) -> bool:
        """Whether the process is there."""
        return self._process.poll() is None

    def check(self) -> None:
        """
        Raise if the process has ended.
        """
        if not self.is_running:
            raise self.failed(f'the node ended with status {self._process.returncode}')

    def interrupt(self) -> None:
        """
        Ask for the end.
        """
        self._process.send_signal(signal.SIGINT)

    def end(self) -> None:
        """
        Leave no process behind, whatever happens meanwhile.
        """
        try:
            if self.is_running:
                self.interrupt()
                self._process.wait(timeout=_END_S)
        except subprocess.TimeoutExpired:
            pass
        finally:
            if self.is_running:
                self._process.kill()
                self._process.wait()

    def failed(self, what: str) -> ShipdragError:
        """
        Return an error that shows the end of the log.
        """
        lines = self.log.read_text(encoding='utf-8', errors='replace').splitlines()[-10:]
        return ShipdragError('\n  '.join([f'{what}; the end of {str(self.log)!r}:', *lines]))


@contextmanager
def onboard_node(
    ship_file: Path, recordings: Path, log: Path, *settings: str
) -> Iterator[OnboardNode]:
    """
    Run a node, and end it.

    Parameters
    ----------
    settings
        More of its parameters, `name:=value` each.
    """
    # nothing leaves this machine, and no other ROS on it is received or receives
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = str(_FIRST_DOMAIN + os.getpid() % _DOMAINS)
    os.environ.pop('ROS_STATIC_PEERS', None)
    os.environ.setdefault('ROS_LOG_DIR', str(log.parent / 'ros'))
    node = OnboardNode(ship_file, recordings, log, *settings)
    try:
        yield node
    finally:
        node.end()


@contextmanager
def ended_by_sigterm() -> Iterator[None]:
    """
    Unwind on SIGTERM as on Ctrl-C, so that the node's process is ended too.
    """

    def leave(number: int, frame: FrameType | None) -> NoReturn:
        sys.exit(128 + number)

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def sail(
    rehearsal: Rehearsal,
    node: OnboardNode,
    block: Block,
    *,
    speed_up: float,
    begins: Callable[[], None] = lambda: None,
) -> None:
    """
    Send the readings and let the node end.

    Parameters
    ----------
    speed_up
        Seconds of readings in a second of life.
    begins
        Called once the node is ready.

    Raises
    ------
    ShipdragError
        If the node is not ready in time, ends too early, or sends nothing.
    """
    rehearsal.wait_for_node(block, alive=node.check, timeout_s=_CONNECT_S)
    begins()
    rehearsal.play(block, speed=speed_up, progress=lambda _: node.check())
    # the answers to the last samples are on their way
    rehearsal.listen(timeout_s=_ANSWER_S)
    node.interrupt()
    rehearsal.listen(until=lambda: not node.is_running, timeout_s=_END_S)
    if node.is_running:
        raise node.failed(f'the node did not end within {_END_S:g} s of SIGINT')
    if not rehearsal.estimates:
        raise node.failed('no estimate was received')
