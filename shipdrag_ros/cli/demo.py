# SPDX-License-Identifier: Apache-2.0
"""
Simulate a coastdown, send its readings over ROS topics on this machine to the node, show the
estimates as they come, replay what the node recorded and write a report.

Options
-------
--out DIR
    where everything is written; made if missing
--speed-up N
    seconds of the simulation in a second of life [-], 1 to 200

Examples
--------
shipdrag demo
shipdrag demo --out demo --speed-up 20
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn, Self

import numpy as np

from shipdrag_ros import display
from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli.arguments import REPORT as REPORT_MODULES
from shipdrag_ros.cli.arguments import number
from shipdrag_ros.cli.output import CheckResult, CheckState, Output
from shipdrag_ros.cli.replay import CURVES, JSON, REPORT, show_run, write_results
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.imports import need, what_to_install
from shipdrag_ros.library import simulated
from shipdrag_ros.library.replaying import replay_run
from shipdrag_ros.replay import replay, words
from shipdrag_ros.replay.run_result import RunResult, TrueCurve
from shipdrag_ros.samples import Block
from shipdrag_ros.ship import Ship

if TYPE_CHECKING:  # help must not need ROS
    from shipdrag_ros.node.spectator import LiveEstimate


_CONNECT_S = 120.0  # the first start on a machine compiles the kernels
_ANSWER_S = 1.0
_END_S = 30.0
_FIRST_DOMAIN, _DOMAINS = 61, 41  # above 101 the ports run into those for outgoing traffic


class OnboardNode:
    """The node in a process of its own, on a domain that nobody else uses; a context manager."""

    def __init__(self, ship_file: Path, recordings: Path, log: Path, *settings: str) -> None:
        self.log = log
        self._line: list[str | Path] = [
            *(sys.executable, '-m', 'shipdrag_ros.cli', 'node'),
            *('--ship', ship_file, '--out', recordings),
            *('--ros-args', '-p', 'use_sim_time:=true'),
            *(word for each in settings for word in ('-p', each)),
        ]

    def __enter__(self) -> Self:
        # nothing leaves this machine, and no other ROS on it is received or receives
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        os.environ['ROS_DOMAIN_ID'] = str(_FIRST_DOMAIN + os.getpid() % _DOMAINS)
        os.environ.pop('ROS_STATIC_PEERS', None)
        os.environ.setdefault('ROS_LOG_DIR', str(self.log.parent / 'ros'))
        with self.log.open('w') as file:
            self._process = subprocess.Popen(
                self._line, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT
            )
        return self

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

    def __exit__(self, *error: object) -> None:
        """Leave no process behind, whatever happens meanwhile."""
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
    node: OnboardNode,
    block: Block,
    *,
    show: Callable[[LiveEstimate], None],
    speed_up: float,
    begins: Callable[[], None] = lambda: None,
) -> int:
    """
    Send the readings, let the node end, and return how many estimates came.

    Parameters
    ----------
    node
        It is ended, whatever happens meanwhile.
    show
        Called with each estimate.
    speed_up
        Seconds of readings in a second of life.
    begins
        Called once the node is ready.

    Raises
    ------
    ShipdragError
        If the node is not ready in time, ends too early, or sends nothing.
    """
    from shipdrag_ros.node.spectator import Rehearsal

    with ended_by_sigterm(), node, Rehearsal(show) as rehearsal:
        rehearsal.wait_for_node(block, alive=node.check, timeout_s=_CONNECT_S)
        begins()
        rehearsal.player.play(block, speed=speed_up, progress=lambda _: node.check())
        # the answers to the last samples are on their way
        rehearsal.listen(timeout_s=_ANSWER_S)
        node.interrupt()
        rehearsal.listen(until=lambda: not node.is_running, timeout_s=_END_S)
        if node.is_running:
            raise node.failed(f'the node did not end within {_END_S:g} s of SIGINT')
        if not rehearsal.estimates:
            raise node.failed('no estimate was received')
    return rehearsal.estimates


SHIP = 'vitus_bering.yaml'
SETTINGS = simulated.SimulationSettings(
    speed_m_s=8.2,
    duration_s=1500.0,
    lead_in_s=900.0,
    heading_rad=0.52,
    rate_hz=1.0,
    noise=1.0,
    seed=1,
)
_SHOWN_NS = 100_000_000_000  # an estimate every 10 s of data is too much to read


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('--out', type=Path, default=Path('demo'))
    parser.add_argument('--speed-up', type=number(1.0, 200.0), default=60.0)


def run(options: argparse.Namespace) -> int:
    """
    Run the demonstration.
    """
    need('rclpy', *REPORT_MODULES)
    output = Output()
    out: Path = options.out
    recordings = out / 'recordings'
    recordings.mkdir(parents=True, exist_ok=True)
    ship_file = _ship_file(out)
    ship = Ship.load(ship_file)
    block, truth = simulated.make(ship, SETTINGS)
    seconds = SETTINGS.lead_in_s + SETTINGS.duration_s
    output.say(
        f'A simulated {ship.summary()},\n'
        f'sails at {SETTINGS.speed_m_s:g} m/s; after {SETTINGS.lead_in_s:.0f} s her engine is '
        f'stopped. {seconds:.0f} s of data take {seconds / options.speed_up:.0f} s.\n'
    )
    output.log('starting the node; the first start on a machine compiles for some seconds')
    before = set(recordings.glob('*.mcap'))
    stop_ns = int(block.receive_ns[0]) + round(SETTINGS.lead_in_s * 1e9)
    node = OnboardNode(ship_file, recordings, out / 'node.log')
    sail(
        node,
        block,
        show=_live(truth, stop_ns, output),
        speed_up=options.speed_up,
        begins=lambda: output.heading('Live from the node, over ROS topics'),
    )
    bags = sorted(set(recordings.glob('*.mcap')) - before)
    if not bags:
        raise node.failed('the node recorded nothing')

    output.heading('What the node recorded, replayed without ROS')
    results = [replace(replay_run(each, output), truth=truth) for each in open_runs(bags)]
    for result in results:
        show_run(output, result)
    write_results(out, results)
    output.heading('Where everything is')
    files_made = [ship_file, *bags, *(out / name for name in (REPORT, JSON, CURVES)), node.log]
    output.say(*map(str, files_made))
    return _verdict(results)


def _ship_file(folder: Path) -> Path:
    path = folder / SHIP
    path.write_bytes(files('shipdrag_ros').joinpath('data', SHIP).read_bytes())
    return path


def _verdict(results: Sequence[RunResult]) -> int:
    """Fail if what was to be demonstrated was not."""
    for result in results:
        recorded = result.recorded
        if recorded.identical < recorded.compared or not recorded.compared:
            raise ShipdragError(
                f'{result.bag!r}: {words.recorded_sentence(recorded)} Live and replay should '
                'agree bit by bit; please report this'
            )
    if not any(part.estimate for result in results for part in result.coastdowns):
        raise ShipdragError('the coastdown was not found; see the node log, and report this')
    return 0


def _live(truth: TrueCurve, stop_ns: int, output: Output) -> Callable[[LiveEstimate], None]:
    """Return what prints estimates beside the truth as they come, but not all of them."""
    next_ns = 0

    def show(estimate: LiveEstimate) -> None:
        nonlocal next_ns
        if estimate.stamp_ns < next_ns:
            return
        next_ns = estimate.stamp_ns + _SHOWN_NS
        output.say(
            f'{(estimate.stamp_ns - stop_ns) * 1e-9:7.0f} s after the stop: '
            f'{estimate.speed_m_s:6.3f} m/s, r = '
            f'{display.plus_minus(estimate.resistance_m_s2, 2.0 * estimate.sigma_m_s2)} m/s², '
            f'true {truth.at(estimate.speed_m_s):.5f}'
        )

    return show


_TRIAL = replace(SETTINGS, lead_in_s=600.0, duration_s=600.0)
TRIAL_SETTINGS = ('steady_s:=300.0', 'diagnose:=false')
_TRIAL_SPEED_UP = 200.0
_SIGMAS = 4.0  # no figure of the run may be further from the truth
_REPORT = 'send the folder to the maintainers, it holds log and bag'


def _step(what: str, works: bool, seen: str, do: str = _REPORT) -> CheckResult:
    """Return whether a part of the way works, what was seen, and what to do where it does not."""
    state = CheckState.FINE if works else CheckState.BROKEN
    return CheckResult(f'run: {what}', state, seen, '' if works else do)


def run_through() -> Iterator[CheckResult]:
    """
    Sail a simulated ship past the node, and yield each part of the way until one fails.

    The files are kept where one does, in a folder that is named.
    """
    folder = Path(tempfile.mkdtemp(prefix='shipdrag-doctor-'))
    works = True
    try:
        for step in _way(folder):
            works = step.state is CheckState.FINE
            yield step if works else step._replace(found=f'{step.found}; files in {folder}')
            if not works:
                return
    except (ShipdragError, ModuleNotFoundError) as error:
        works = False
        missing = what_to_install(error) if isinstance(error, ModuleNotFoundError) else None
        do = 'look at the log above; is another ROS with the same domain in the way?'
        yield _step('node', False, f'{missing or error}; files in {folder}', do)
    finally:
        if works:
            shutil.rmtree(folder, ignore_errors=True)


def _way(folder: Path) -> Iterator[CheckResult]:
    need('rclpy')
    ship_file = _ship_file(folder)
    block, truth = simulated.make(Ship.load(ship_file), _TRIAL)
    yield _step('simulated ship', True, f'{len(block)} readings')
    node = OnboardNode(ship_file, folder, folder / 'node.log', *TRIAL_SETTINGS)
    live = sail(node, block, show=lambda _: None, speed_up=_TRIAL_SPEED_UP)
    yield _step('node', True, f'{live} estimates over ROS topics')
    bags = sorted(folder.glob('*.mcap'))
    if not bags:
        yield _step('bag', False, 'nothing was recorded', 'see node.log')
        return
    yield _step('bag', True, f'{bags[0].stat().st_size / 1e3:.0f} kB')
    (run,) = open_runs(bags)
    result = replay(run)
    recorded = result.recorded
    same = 0 < recorded.compared == recorded.identical
    yield _step('replay', same, words.recorded_sentence(recorded))
    yield _figures([each.estimate for each in result.coastdowns], truth)


def _figures(estimates: list[Estimate | None], truth: TrueCurve) -> CheckResult:
    what = 'figures'
    if len(estimates) != 1 or estimates[0] is None:
        return _step(what, False, f'{len(estimates)} coastdowns, expected one')
    curve = estimates[0].valid_curve
    off = (curve.resistance_m_s2 - truth.at(curve.speed_m_s)) / curve.sigma_m_s2
    worst = float(np.nanmax(np.abs(off)))
    seen = f'at most {worst:.1f} standard deviations from the truth'
    return _step(what, worst <= _SIGMAS, seen)
