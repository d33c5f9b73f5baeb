# SPDX-License-Identifier: Apache-2.0
"""
Whether what is advised decides as often as is predicted.

Effects of the library are drawn, simulated and diagnosed from one coastdown with
log and positions; wherever that leaves a set, the first three measurements that a
probability is given for are made in the simulation, and the diagnosis repeated.
The baseline is off by what it states, the formulas of the effects are right.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np

from shipdrag_ros.diagnosis import CoastRun, DiagnosisResult, Verdict, diagnose
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors
from shipdrag_ros.simulation.effect import Measure, Scope
from shipdrag_ros.simulation.effects import LIBRARY

SEED = 11
SHIP = Ship.load(Path(__file__).parents[1] / 'config' / 'vitus_bering.yaml')
LEAD_IN_S, COAST_S = 1200.0, 1500.0
SPEED_M_S, HEADING_RAD = 8.0, 0.3
MOTION = ('speed_through_water', 'position')
INSTRUMENTS = {
    Measure.WIND: 'wind_apparent',
    Measure.DEPTH: 'depth',
    Measure.HEADING: 'heading',
    Measure.SHAFT: 'shaft',
}
TRIED = 3  # of what is advised with a probability
EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)


@dataclass(frozen=True)
class Case:
    """What is hidden, and the ship as she is."""

    seed: int
    effect: StatedEffect
    ship: Ship


@dataclass(frozen=True)
class Trial:
    """A measurement that was advised, whether something was named, and the truth at that."""

    seed: int
    effect: str
    measure: str
    place: int
    predicted: float
    named: bool
    right: bool


def case(seed: int) -> Case:
    """Draw an effect of the library, and a baseline within what it states."""
    rng = np.random.default_rng([SEED, seed])
    effect = list(LIBRARY.values())[int(rng.integers(len(LIBRARY)))]
    values = {}
    for quantity in effect.parameters_of(SHIP):
        drawn = quantity.prior.draw(rng)
        if not quantity.words:
            drawn = float(np.clip(drawn, quantity.low, quantity.high))
        values[quantity.name] = Parameter(drawn, 0.0)
    baseline = SHIP.baseline
    friction = 1.0 + baseline.relative_sd.friction * rng.standard_normal()
    wave = 1.0 + baseline.relative_sd.wave * rng.standard_normal()
    there = replace(
        baseline,
        form_factor=friction * (1.0 + baseline.form_factor) - 1.0,
        correlation_allowance=friction * baseline.correlation_allowance,
        wave_coefficient=tuple(wave * c for c in baseline.wave_coefficient),
    )
    return Case(seed, StatedEffect(effect.name, values), replace(SHIP, baseline=there))


def run(
    case: Case, which: int, *, heading: float, speed: float, inputs: tuple[str, ...]
) -> CoastRun:
    """Simulate a coastdown and read it; what belongs to a single run is in the first alone."""
    scenario = Scenario(
        speed_m_s=speed, lead_in_s=LEAD_IN_S, duration_s=COAST_S, heading_rad=heading
    )
    single = LIBRARY[case.effect.name].scope is Scope.RUN
    effects = [] if single and which else [case.effect]
    truth = simulate(case.ship, scenario, effects=effects, reference_rad=HEADING_RAD)
    block = sense(
        truth, standard_sensors(rate_hz=0.5, inputs=inputs), seed=1000 * case.seed + which
    )
    first = int(block.stamp_ns.min())
    stop = first + round(LEAD_IN_S * 1e9)
    window = Window.from_block(block, stop, int(block.stamp_ns.max()), before_ns=first)
    return CoastRun(f'run {which}', window)


def first_run(case: Case, *more: str) -> CoastRun:
    """The run that is there, with instruments besides."""
    return run(case, 0, heading=HEADING_RAD, speed=SPEED_M_S, inputs=(*MOTION, *more))


def after(case: Case, measure: Measure) -> DiagnosisResult:
    """Diagnose again, with what a measurement adds."""
    if measure in INSTRUMENTS:
        return diagnose([first_run(case, INSTRUMENTS[measure])], SHIP, Parameters())
    heading = HEADING_RAD + (math.pi if measure is Measure.RECIPROCAL_RUN else 0.0)
    speed = SPEED_M_S * (0.6 if measure is Measure.OTHER_SPEED else 1.0)
    second = run(case, 1, heading=heading, speed=speed, inputs=MOTION)
    return diagnose([first_run(case), second], SHIP, Parameters())


def trials(seed: int) -> list[Trial]:
    """Try all that is advised with a probability."""
    hidden = case(seed)
    try:
        found = diagnose([first_run(hidden)], SHIP, Parameters())
    except ShipdragError:  # too large to be simulated
        return []
    if found.verdict is not Verdict.ONE_OF:
        return []
    rows = []
    known = [advised for advised in found.would_decide if advised.probability is not None]
    for place, advised in enumerate(known[:TRIED]):
        again = after(hidden, Measure(advised.measure))
        named = [effect.name for effect in again.effects]
        assert advised.probability is not None
        rows.append(
            Trial(
                seed,
                hidden.effect.name,
                advised.measure,
                place,
                advised.probability,
                bool(named),
                named == [hidden.effect.name],
            )
        )
    return rows


def _bins(rows: list[Trial]) -> Iterator[tuple[float, float, list[Trial]]]:
    for low, high in pairwise(EDGES):
        inside = [row for row in rows if low <= row.predicted < high or row.predicted == high == 1]
        if inside:
            yield low, high, inside


def table(rows: list[Trial]) -> None:
    """Print predicted against what happened."""
    print(f'{"predicted":>12} {"tests":>6} {"mean":>6} {"named":>6}')
    error = 0.0
    for low, high, inside in _bins(rows):
        mean = float(np.mean([row.predicted for row in inside]))
        named = float(np.mean([row.named for row in inside]))
        error += abs(mean - named) * len(inside) / len(rows)
        print(f'{low:5.1f} .. {high:3.1f} {len(inside):6d} {mean:6.2f} {named:6.2f}')
    print(f'expected calibration error {error:.3f}')


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--count', type=int, default=160, help='cases that are drawn')
    parser.add_argument('--all', action='store_true', help='print each test')
    options = parser.parse_args()
    rows = []
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        for found in pool.map(trials, range(options.count)):
            rows += found
            for row in found if options.all else ():
                text = f'{row.seed:5d} {row.effect:22} {row.predicted:5.2f} {row.named!s:5}'
                print(f'{text} {row.measure}', flush=True)
    sets = {row.seed for row in rows}
    print(f'{options.count} effects drawn from seed {SEED}, {len(sets)} of them left a set')
    print('\nall that was tried')
    table(rows)
    print('\nthe first of it alone')
    table([row for row in rows if row.place == 0])
    resolvable = {row.seed for row in rows if row.right}
    first = {row.seed for row in rows if row.right and row.place == 0}
    print(f'\nsets that any of it resolves: {len(resolvable)}; that the first does: {len(first)}')


if __name__ == '__main__':
    main()
