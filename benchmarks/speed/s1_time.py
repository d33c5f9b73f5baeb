# SPDX-License-Identifier: Apache-2.0
"""
Time of one estimate against the number of samples.

All orders up to 20 with table, curve and band, from a window to the result;
the median of several, processor time, log and position with n samples each.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.accuracy._coasts import coast, read
from shipdrag_ros.estimation import Window, estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

SHIP_FILE = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
COUNTS = (100, 500, 2_000, 10_000, 100_000)
PROBLEMS = ('s1_speed', 's1_position', 's1_joint')


def median_ms(window: Window, ship: Ship, problem: str, *, repeats: int) -> float:
    """
    Return the median processor time of one estimate [ms].
    """
    parameters = Parameters(estimator=problem)
    taken = []
    for _ in range(repeats):
        start = time.process_time()
        estimate(window, ship, parameters)
        taken.append(time.process_time() - start)
    return 1e3 * float(np.median(taken))


def main() -> None:
    """
    Print the table.
    """
    ship = Ship.load(SHIP_FILE)
    truth = coast(ship, speed_m_s=8.2, duration_s=1500.0)
    table = Table(title='ms of processor time an estimate')
    table.add_column('n of each input', justify='right')
    for problem in PROBLEMS:
        table.add_column(problem, justify='right')
    rows = []
    for n in COUNTS:
        window = read(truth, n, seed=0)
        repeats = max(3, min(100, 200_000 // n))
        rows.append([median_ms(window, ship, name, repeats=repeats) for name in PROBLEMS])
        table.add_row(str(n), *(f'{ms:.2f}' for ms in rows[-1]))
    slopes = np.log(np.divide(rows[-1], rows[-2])) / np.log(COUNTS[-1] / COUNTS[-2])
    table.add_row('last slope', *(f'{slope:.2f}' for slope in slopes))
    Console().print(table)


if __name__ == '__main__':
    main()
