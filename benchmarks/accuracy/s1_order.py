# SPDX-License-Identifier: Apache-2.0
"""
The order rule: how often it chooses wrongly, and what that costs.

First polynomials of known degree, n = 100, white noise, where a choice is right
or wrong. Then coastdowns, where no degree is right and too low costs more than
too high: the base case of s1_accuracy.py, speed and position together.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks.accuracy._coasts import coast, errors, read
from shipdrag_ros.estimation import estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies import order
from shipdrag_ros.studies.order import OrderTable, fit_orders
from shipdrag_ros.studies.orthogonal import OrthogonalBasis

SHIP_FILE = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
TRUE_ORDER = 5
SIZES = (3.0, 4.0, 6.0)  # of the last true coefficient, in its standard deviations
RULES = tuple((p, steps) for p in (0.001, 0.01, 0.05, 0.1) for steps in (1, 2, 3))


def tables(size: float, runs: int) -> list[OrderTable]:
    """
    Order tables of polynomials of `TRUE_ORDER` in unit noise, seed 1.
    """
    rng = np.random.default_rng(1)
    basis = OrthogonalBasis.on(np.linspace(-1.0, 1.0, 100), 20)
    decay = size * 3.0 ** np.arange(TRUE_ORDER - 1, -1, -1)
    truth = (decay / np.sqrt(basis.squared_norm[:TRUE_ORDER])) @ basis.columns[:TRUE_ORDER]
    return [fit_orders(basis, truth + noise)[1] for noise in rng.normal(size=(runs, 100))]


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Print the table.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=2000, help='polynomials of each size')
    parser.add_argument('--coasts', type=int, default=100, help='coastdowns')
    options = parser.parse_args(arguments)
    kept = order.SIGNIFICANCE, order.NEIGHBOURS
    ship = Ship.load(SHIP_FILE)
    truth = coast(ship, speed_m_s=8.2, duration_s=1500.0)
    windows = [read(truth, 500, seed=seed) for seed in range(options.coasts)]
    known = {size: tables(size, options.runs) for size in SIZES}

    result = Table(
        title=f'Order rule: {options.runs} polynomials of order {TRUE_ORDER} (seed 1), '
        f'{options.coasts} coastdowns (seeds 0..{options.coasts - 1}); in use: p < {kept[0]}, '
        f'{kept[1]} steps'
    )
    result.add_column('p <')
    result.add_column('steps')
    result.add_column('too high %', justify='right')
    for size in SIZES:
        result.add_column(f'too low % at {size:g} sd', justify='right')
    for heading in ('RMSE %', 'at top %', 'cover %'):
        result.add_column(heading, justify='right')
    for p, steps in track(RULES, console=Console(stderr=True)):
        order.SIGNIFICANCE, order.NEIGHBOURS = p, steps
        chosen = {
            size: np.array(
                [t.coefficients[OrderTable(t.coefficients, t.sse, t.rows).plateau()] for t in some]
            )
            for size, some in known.items()
        }
        found = [
            errors(estimate(window, ship, Parameters(estimator='s1_joint')), truth)
            for window in windows
        ]
        result.add_row(
            f'{p:g}',
            str(steps),
            f'{100 * np.mean(chosen[SIZES[-1]] > TRUE_ORDER):.1f}',
            *(f'{100 * np.mean(chosen[size] < TRUE_ORDER):.1f}' for size in SIZES),
            f'{100 * np.sqrt(np.mean([e.rmse**2 for e in found])):.2f}',
            f'{100 * np.sqrt(np.mean([e.at_top**2 for e in found])):.1f}',
            f'{100 * np.mean([e.covered for e in found]):.0f}',
        )
    order.SIGNIFICANCE, order.NEIGHBOURS = kept
    Console(width=120).print(result)


if __name__ == '__main__':
    main()
