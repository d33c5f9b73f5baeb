# SPDX-License-Identifier: Apache-2.0
"""
Time of the live estimator, from Python, one thread.

First all orders up to 12 of one input, compiled, beside the QR decomposition of
numpy on the same columns; then a whole estimate, from a window to r(v) with
weights and averages, beside S1's joint problem. The best of several rounds.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import numpy as np
from _coasts import coast, read
from rich.console import Console
from rich.table import Table

from shipdrag_ros.estimation import estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.regression.refit import refit
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

SHIP_FILE = Path(__file__).parents[1] / 'config' / 'vitus_bering.yaml'
COUNTS = (100, 200, 500, 1_000, 2_000, 5_000, 10_000)
ORDER = 12
ROUNDS = 15
ROUND_S = 0.05


def best_us(call: Callable[[], object]) -> float:
    """
    Return the time of one call in the best round [us].
    """
    call()
    start = time.perf_counter()
    call()
    repeats = max(1, int(ROUND_S / (time.perf_counter() - start)))
    best = np.inf
    for _ in range(ROUNDS):
        start = time.perf_counter()
        for _ in range(repeats):
            call()
        best = min(best, (time.perf_counter() - start) / repeats)
    return 1e6 * best


def numpy_orders(times: Float64, value: Float64) -> Float64:
    """
    Residual sums of all orders by QR; the triangle's last column holds them.
    """
    columns = np.polynomial.legendre.legvander(times, ORDER - 1)
    triangle = np.linalg.qr(np.column_stack([columns, value]), mode='r')
    sse: Float64 = np.cumsum(triangle[::-1, -1] ** 2)[::-1][1:]
    return sse


def main() -> None:
    """
    Print the table.
    """
    ship = Ship.load(SHIP_FILE)
    truth = coast(ship, speed_m_s=8.2, duration_s=1500.0)
    table = Table(title=f'microseconds, best of {ROUNDS} rounds')
    for heading in (
        'n of each input',
        f'refit, order {ORDER}',
        'numpy QR',
        'ratio',
        'warped',
        's1_joint',
        'ratio',
    ):
        table.add_column(heading, justify='right')
    rows = []
    for n in COUNTS:
        times = np.linspace(-1.0, 1.0, n)
        value = np.exp(-times) + 0.05 * np.random.default_rng(0).normal(size=n)
        refitted, plain = refit(times, value, ORDER)[-1], numpy_orders(times, value)
        np.testing.assert_allclose(refitted, plain, rtol=1e-12)
        window = read(truth, n, seed=0)
        row = [
            best_us(lambda t=times, v=value: refit(t, v, ORDER)),
            best_us(lambda t=times, v=value: numpy_orders(t, v)),
            *(
                best_us(lambda w=window, p=parameters: estimate(w, ship, p))
                for parameters in (
                    Parameters(estimator='warped'),
                    Parameters(estimator='s1_joint'),
                )
            ),
        ]
        rows.append(row)
        quick, qr, warped, s1 = row
        table.add_row(
            str(n),
            f'{quick:.1f}',
            f'{qr:.0f}',
            f'{qr / quick:.0f}',
            f'{warped:.0f}',
            f'{s1:.0f}',
            f'{s1 / warped:.1f}',
        )
    slopes = np.log(np.divide(rows[-1], rows[-4])) / np.log(COUNTS[-1] / COUNTS[-4])
    quick, qr, warped, s1 = (f'{slope:.2f}' for slope in slopes)
    table.add_section()
    table.add_row(f'slope from {COUNTS[-4]}', quick, qr, '', warped, s1, '')
    Console(width=100).print(table)


if __name__ == '__main__':
    main()
