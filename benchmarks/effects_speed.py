# SPDX-License-Identifier: Apache-2.0
"""
What a column of the batched simulation costs, and how exact it is.

    python benchmarks/effects_speed.py

150 m ship from 8.2 m/s, 600 s of steady sailing and a coast of 1500 s, read at 420 times. Columns:
the clean ship; each effect at 4 draws of its priors (seed 0); all of them together. CPU time of
the process, the best of 7 calls of 400 columns. Error: against steps of 0.05 s.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from importlib.resources import files
from itertools import cycle, islice

import numpy as np

from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action, Frame, Scenario, simulate, simulate_columns
from shipdrag_ros.simulation.effects import LIBRARY

SCENARIO = Scenario(speed_m_s=8.2, lead_in_s=600.0, duration_s=1500.0)
TIME_S = np.arange(0.0, 2100.0, 5.0)
COLUMNS = 400
ROUNDS = 7
DRAWS = 4
FINE_S = 0.05


def main() -> None:
    """Print the table."""
    text = files('shipdrag_ros').joinpath('data', 'vitus_bering.yaml').read_text()
    ship = Ship.from_yaml(text, subject='vitus_bering.yaml')
    frame = Frame(ship, SCENARIO, SCENARIO.heading_rad)
    rng = np.random.default_rng(0)
    groups: dict[str, list[Action]] = {'clean ship': [Action()]}
    for effect in LIBRARY.values():
        quantities = effect.parameters_of(ship)
        groups[effect.name] = [
            effect.action(frame, *(quantity.prior.draw(rng) for quantity in quantities))
            for _ in range(DRAWS)
        ]
    groups['all together'] = [action for group in groups.values() for action in group]
    print(f'{"columns":24s}{"ms a column":>12s}{"mm/s":>10s}{"mm":>10s}')
    for name, actions in groups.items():
        speed, position = errors(ship, actions)
        print(f'{name:24s}{cost_ms(ship, actions):12.3f}{speed:10.1e}{position:10.1e}')
    begin = time.process_time()
    simulate(ship, SCENARIO)
    alone = 1e3 * (time.process_time() - begin)
    print(f'one simulation by `simulate`, for comparison: {alone:.1f} ms')


def cost_ms(ship: Ship, actions: Sequence[Action]) -> float:
    """Return the CPU time of a column."""
    columns = list(islice(cycle(actions), COLUMNS))
    times = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        simulate_columns(ship, SCENARIO, columns, TIME_S)
        times.append(time.process_time() - begin)
    return 1e3 * min(times) / COLUMNS


def errors(ship: Ship, actions: Sequence[Action]) -> tuple[float, float]:
    """Return the largest error of speed and position [mm/s, mm]."""
    chosen = simulate_columns(ship, SCENARIO, actions, TIME_S)
    fine = simulate_columns(ship, SCENARIO, actions, TIME_S, step_s=FINE_S)
    speed = chosen.speed_through_water_m_s - fine.speed_through_water_m_s
    position = chosen.position_m - fine.position_m
    return 1e3 * float(np.max(np.abs(speed))), 1e3 * float(np.max(np.abs(position)))


if __name__ == '__main__':
    main()
