# SPDX-License-Identifier: Apache-2.0
"""
r(v) by several instruments of a kind: one log, two, and one of them 5 % off.

    python -m benchmarks.accuracy.several_instruments --runs 20 --seed 0

Simulated coastdowns with half an hour before the stop. Each log has a scale, drawn anew for each
run from the prior of docs/model.md, and wanders by itself; the one that is off reads 5 % too much
instead.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks._asked import asked
from benchmarks._tables import along, table
from benchmarks.accuracy._coasts import cut
from shipdrag_ros.estimation import estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import priors
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, Sensor, sense, simulate
from shipdrag_ros.simulation.scenario import GaussMarkov

LEAD_S, COAST_S, SPEED_M_S = 1800.0, 1500.0, 8.2
LOG_SD, WANDER, POSITION_SD = 0.05, GaussMarkov(0.02, 60.0), 5.0
OFF = 0.05
LOGS = (
    Channel.SPEED_THROUGH_WATER,
    Channel.SPEED_THROUGH_WATER_2,
    Channel.SPEED_THROUGH_WATER_3,
)


class Case(NamedTuple):
    """What is on board: logs, of which the first may be off, and receivers of positions."""

    name: str
    logs: int
    positions: int = 0
    off: bool = False


CASES = (
    Case('one log', 1),
    Case('two logs', 2),
    Case('one log, 5 % off', 1, off=True),
    Case('one of two logs 5 % off', 2, off=True),
    Case('one of three logs 5 % off', 3, off=True),
    Case('one log, positions', 1, 1),
    Case('two logs, positions twice', 2, 2),
    Case('one of two logs 5 % off, positions', 2, 1, off=True),
)


def readings(case: Case, ship: Ship, seed: int) -> Block:
    """Simulate a run as its instruments read it; the noise of one does not depend on others."""
    scenario = Scenario(speed_m_s=SPEED_M_S, lead_in_s=LEAD_S, duration_s=COAST_S, seed=seed)
    sensors = [Sensor(channel=log, sd=LOG_SD, coloured=WANDER) for log in LOGS[: case.logs]]
    places = (Channel.POSITION, Channel.POSITION_2)
    sensors += [Sensor(channel=each, sd=POSITION_SD) for each in places[: case.positions]]
    block = sense(simulate(ship, scenario), sensors, seed=seed)
    value = block.value.copy()
    scales = priors.LOG_SCALE.sd * np.random.default_rng(seed).standard_normal(len(LOGS))
    if case.off:
        scales[0] = OFF
    for log, scale in zip(LOGS, scales):
        value[block.channel == log] *= 1.0 + scale
    return replace(block, value=value)


def score(case: Case, ship: Ship, seed: int) -> tuple[float, float, float]:
    """
    Return mean square error, mean variance (of the largest r) and cover of a run.
    """
    window = cut(readings(case, ship, seed), LEAD_S, COAST_S)
    found = estimate_final(window, ship, Parameters()).valid_calm
    speed = np.minimum(found.speed_m_s, ship.baseline_range_m_s[1])
    true = ship.resistance_n(speed) / ship.mass_kg
    largest = float(ship.resistance_n(SPEED_M_S)) / ship.mass_kg
    error = (found.resistance_m_s2 - true) / largest
    sigma = found.sigma_m_s2 / largest
    cover = np.mean(np.abs(error) <= 2.0 * sigma)
    return float(np.mean(error**2)), float(np.mean(sigma**2)), float(cover)


def main() -> None:
    """
    Simulate, estimate, print.
    """
    options = asked(__doc__, runs=20, seed=0)
    ship = replace(Ship.example(), effects=())
    rows, seeds = [], range(options.seed, options.seed + options.runs)
    for case in CASES:
        each = np.array([score(case, ship, seed) for seed in along(seeds, case.name)])
        error, sigma = 100.0 * np.sqrt(each[:, :2].mean(axis=0))
        rows.append((case.name, f'{error:.2f}', f'{sigma:.2f}', f'{100 * each[:, 2].mean():.0f}'))
    print(f'N = {options.runs} runs a row, seeds from {options.seed}; of the largest r')
    print(*table(('instruments', 'rmse [%]', 'sigma [%]', 'cover [%]'), rows), sep='\n')


if __name__ == '__main__':
    main()
