# SPDX-License-Identifier: Apache-2.0
"""
Error and coverage of S1's three problems on simulated coastdowns.

The cargo ship of config/vitus_bering.yaml from 8.2 m/s, 1500 s, n samples of
log (white, 0.05 m/s) and position (white, 10 m) each; prints, for each
problem, the error of r(v) over the valid range.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks.accuracy._coasts import Errors, coast, errors, read
from shipdrag_ros.estimation import estimate
from shipdrag_ros.estimation.result import FroudeMax
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Truth

SHIP_FILE = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
PROBLEMS = ('s1_speed', 's1_position', 's1_joint')
CASES = (
    # name, n, log [m/s], position [m], run-down of the thrust
    ('base', 500, 0.05, 10.0, False),
    ('n = 100', 100, 0.05, 10.0, False),
    ('n = 2000', 2000, 0.05, 10.0, False),
    ('good position', 500, 0.1, 1.0, False),
    ('thrust runs down', 500, 0.05, 10.0, True),
)


def rms(values: list[float]) -> float:
    """
    Return the root mean square in percent.
    """
    return 100.0 * float(np.sqrt(np.mean(np.square(values))))


def row(
    truth: Truth, problem: str, case: tuple[str, int, float, float, bool], runs: int
) -> list[str]:
    """
    Run one problem on one case; return the cells of its row.
    """
    name, n, speed_sd, position_sd, _ = case
    found: list[Errors] = []
    orders: Counter[int] = Counter()
    tops, stated, inflections = [], [], 0
    for seed in track(range(runs), description=f'{name} {problem}', console=Console(stderr=True)):
        window = read(truth, n, seed=seed, speed_sd=speed_sd, position_sd=position_sd)
        result = estimate(window, truth.ship, Parameters(estimator=problem))
        found.append(errors(result, truth))
        orders[result.order or 0] += 1
        tops.append(result.froude_valid[1])
        stated.append(result.max_relative_sigma)
        inflections += result.froude_max_by is FroudeMax.INFLECTION
    usual = ' '.join(f'{order}:{count}' for order, count in sorted(orders.items()))
    return [
        name,
        problem,
        f'{rms([e.rmse for e in found]):.2f}',
        f'{rms([e.at_top for e in found]):.1f}',
        f'{100 * np.mean([e.covered for e in found]):.0f}',
        f'{100 * np.median(stated):.2f}',
        f'{np.median(tops):.3f}',
        f'{100 * inflections / runs:.0f}',
        usual,
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Print the table.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=200, help='coastdowns of each case')
    runs = parser.parse_args(arguments).runs
    ship = Ship.load(SHIP_FILE)
    table = Table(title=f'S1 on simulated coastdowns, N = {runs}, seeds 0..{runs - 1}')
    for heading in ('case', 'problem'):
        table.add_column(heading)
    for heading in (
        'RMSE %',
        'at top %',
        'cover %',
        'median w %',
        'Fr_max',
        'inflections %',
        'orders chosen',
    ):
        table.add_column(heading, justify='right')
    for case in CASES:
        truth = coast(ship, speed_m_s=8.2, duration_s=1500.0, run_down=case[4])
        for problem in PROBLEMS:
            table.add_row(*row(truth, problem, case, runs))
        table.add_section()
    Console(width=140).print(table)
    print(
        'RMSE, at top: of r over the valid range, evenly in speed, and at its upper end, in % of '
        'the true r at 8.2 m/s.\n'
        'cover: share of the range where +-2 sigma (repeatable) holds the truth. '
        "w: S1's max sigma_r / max r."
    )


if __name__ == '__main__':
    main()
