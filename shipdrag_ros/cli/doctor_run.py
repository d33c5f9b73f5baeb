# SPDX-License-Identifier: Apache-2.0
"""`shipdrag doctor --run`: a simulated ship through the whole way, in some seconds."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli.demo import SETTINGS, SHIP, ended_by_sigterm, onboard_node, sail
from shipdrag_ros.cli.node import no_ros
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.library import simulated
from shipdrag_ros.replay import replay, words
from shipdrag_ros.replay.truth import TrueCurve
from shipdrag_ros.ship import Ship

SAILED = replace(SETTINGS, lead_in_s=600.0, duration_s=600.0)
_NODE = ('steady_s:=300.0', 'diagnose:=false')
_SPEED_UP = 200.0
_SIGMAS = 4.0  # no figure of the run may be further from the truth
_REPORT = 'send the folder to the maintainers, it holds log and bag'


class RunStep(NamedTuple):
    """A part of the way: whether it works, what was seen, and what to do where it does not."""

    what: str
    works: bool
    seen: str
    do: str = ''


def run_through() -> Iterator[RunStep]:
    """
    Sail a simulated ship past the node, and yield each part of the way until one fails.

    The files are kept where one does, in a folder that is named.
    """
    folder = Path(tempfile.mkdtemp(prefix='shipdrag-doctor-'))
    works = True
    try:
        for step in _way(folder):
            works = works and step.works
            yield step if step.works else step._replace(seen=f'{step.seen}; files in {folder}')
            if not works:
                return
    except ShipdragError as error:
        works = False
        do = 'look at the log above; is another ROS with the same domain in the way?'
        yield RunStep('run: node', False, f'{error}; files in {folder}', do)
    finally:
        if works:
            shutil.rmtree(folder, ignore_errors=True)


def _way(folder: Path) -> Iterator[RunStep]:
    try:
        from shipdrag_ros.node.rehearsal import Rehearsal
    except ModuleNotFoundError as error:
        raise no_ros(error) from error
    ship_file = folder / SHIP
    ship_file.write_bytes(files('shipdrag_ros').joinpath('data', SHIP).read_bytes())
    block, truth = simulated.make(Ship.load(ship_file), SAILED)
    yield RunStep('run: simulated ship', True, f'{len(block)} readings')
    with ended_by_sigterm(), onboard_node(ship_file, folder, folder / 'node.log', *_NODE) as node:
        with Rehearsal(lambda _: None) as rehearsal:
            sail(rehearsal, node, block, speed_up=_SPEED_UP)
        live = rehearsal.estimates
    yield RunStep('run: node', True, f'{live} estimates over ROS topics')
    bags = sorted(folder.glob('*.mcap'))
    if not bags:
        yield RunStep('run: bag', False, 'nothing was recorded', 'see node.log')
        return
    yield RunStep('run: bag', True, f'{bags[0].stat().st_size / 1e3:.0f} kB')
    (run,) = open_runs(bags)
    result = replay(run)
    recorded = result.recorded
    same = 0 < recorded.compared == recorded.identical
    yield RunStep('run: replay', same, words.recorded_sentence(recorded), _REPORT)
    yield _figures([each.estimate for each in result.coastdowns], truth)


def _figures(estimates: list[Estimate | None], truth: TrueCurve) -> RunStep:
    what = 'run: figures'
    if len(estimates) != 1 or estimates[0] is None:
        return RunStep(what, False, f'{len(estimates)} coastdowns, expected one', _REPORT)
    curve = estimates[0].valid_curve
    off = (curve.resistance_m_s2 - truth.at(curve.speed_m_s)) / curve.sigma_m_s2
    worst = float(np.nanmax(np.abs(off)))
    seen = f'at most {worst:.1f} standard deviations from the truth'
    return RunStep(what, worst <= _SIGMAS, seen, _REPORT)
