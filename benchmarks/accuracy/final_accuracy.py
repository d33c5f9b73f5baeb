# SPDX-License-Identifier: Apache-2.0
"""
Error and coverage of the final figure on simulated coastdowns.

On three hulls, n samples of log and position each; disturbances of 300 s are learnt from
1800 s of steady record, never given. `--no-baseline`: the ship file has length and volume alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks._asked import asked
from benchmarks._tables import along, grid
from benchmarks.accuracy._coasts import TANKER, YACHT, Case, Compared, coasts, rms
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.estimators import named
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

CASES = (
    Case('white noise'),
    Case('n = 100', n=100),
    Case('n = 2000', n=2000),
    Case('tanker', hull=TANKER),
    Case('yacht with a hump', hull=YACHT),
    Case('current 0.25 m/s', current_m_s=0.25),
    Case('3 % outliers', outliers=0.03),
    Case('steady record', steady=True),
    Case('steady record, shaft', steady=True, shaft=True),
    Case('the log wanders 0.05 m/s', steady=True, log_m_s=0.05),
    Case('the same, shaft', steady=True, shaft=True, log_m_s=0.05),
    Case('gusts of 0.05 m/s', steady=True, gust_m_s=0.05),
    Case('the same, shaft', steady=True, shaft=True, gust_m_s=0.05),
)
HEADS = ['n', 'RMSE', 'bias', 'spread', 'at top', 'bias', 'at bottom', 'cover %', 'ms', 'failed']


def without_baseline(method: Callable[..., Estimate]) -> Callable[..., Estimate]:
    """Return an estimator that is not shown the baseline of the ship file."""

    def bare(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
        return method(window, replace(ship, baseline=None), parameters)

    return bare


def row(case: Case, runs: int, method: Callable[..., Estimate]) -> list[str]:
    """Run one case; return the cells of its row."""
    largest = float(next(coasts(case, 1)).resists(np.array(case.hull.speed_m_s)))
    seen = along(coasts(case, runs), case.name, runs)
    found = Compared.of(
        method, largest, ((each.window, each.truth.ship, each.resists) for each in seen)
    )
    error = found.error
    bias = error.mean(axis=0)
    return [
        case.name,
        f'{case.n}',
        f'{100 * rms(error):.2f}',
        f'{100 * rms(bias):.2f}',
        f'{100 * rms(error - bias):.2f}',
        f'{100 * rms(error[:, -1]):.1f}',
        f'{100 * bias[-1]:+.1f}',
        f'{100 * rms(error[:, 0]):.2f}',
        f'{100 * found.covered:.0f}',
        f'{1e3 * np.median(found.took_s):.1f}',
        f'{found.failed}',
    ]


def main() -> None:
    """
    Print the table.
    """
    options = asked(__doc__, runs=200, estimator='one', no_baseline=False)
    runs = options.runs
    method = named(options.estimator).estimate
    if options.no_baseline:
        method = without_baseline(method)
    grid(
        f'Final figure on simulated coastdowns, N = {runs}, seeds 0..{runs - 1}; '
        'in % of the largest r',
        ['case', *HEADS],
        [row(case, runs, method) for case in CASES],
        width=140,
    )
    print(
        'RMSE over the valid range, evenly in speed; at top, at bottom: at its ends. cover: share '
        'of the range\nwhere +-2 sigma (repeatable) holds the truth. bound: Cramer-Rao, of '
        'v .. v^4 with the noise known.'
    )


if __name__ == '__main__':
    main()
