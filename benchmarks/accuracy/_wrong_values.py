# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis says when a value of the ship file is wrong and nothing else is amiss."""

from __future__ import annotations

import math

from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.display import Table
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.studies.sensitivity.coast import particulars

ERRORS = (-0.2, -0.1, 0.1, 0.25)  # of the file, relative to the truth
LEAD_IN_S, COAST_S, SPEED_M_S = 1200.0, 1500.0, 8.0
_SHOWN = 0.05  # probability from which a candidate is shown


def verdicts(ship: Ship) -> Table:
    """
    Show the answers to two reciprocal coastdowns, log and positions at 1 Hz.
    """
    rows = []
    for one in particulars(ship, speed_m_s=SPEED_M_S):
        answers = []
        for error in ERRORS:
            truth = one.scaled(ship, 1.0 / (1.0 + error))
            runs = [_run(truth, heading, seed) for seed, heading in enumerate((0.0, math.pi))]
            answers.append(_answer(diagnose(runs, ship, Parameters())))
        rows.append((one.key, *answers))
    return Table(('the file is wrong by', *(f'{error:+.0%}' for error in ERRORS)), tuple(rows))


def _run(truth: Ship, heading_rad: float, seed: int) -> CoastRun:
    scenario = Scenario(
        speed_m_s=SPEED_M_S, lead_in_s=LEAD_IN_S, duration_s=COAST_S, heading_rad=heading_rad
    )
    sensors = standard_sensors(inputs=('speed_through_water', 'position'))
    block = sense(simulate(truth, scenario), sensors, seed=seed)
    stop = START_NS + round(LEAD_IN_S * 1e9)
    first, last = int(block.stamp_ns.min()), int(block.stamp_ns.max())
    return CoastRun(f'run {seed}', Window.from_block(block, stop, last, before_ns=first))


def _answer(found: DiagnosisResult) -> str:
    shown = [
        f'{" + ".join(each.names) or "nothing"} {each.probability:.0%}'
        for each in found.candidates
        if each.probability >= _SHOWN
    ]
    return f'{found.verdict}: {", ".join(shown)}' if shown else str(found.verdict)
