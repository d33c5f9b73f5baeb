# SPDX-License-Identifier: Apache-2.0
"""
Time of the estimators for one window, from Python, one thread.

First all orders up to 12 of one input, compiled, beside the QR decomposition of
numpy on the same columns; then whole estimates, from a window to r(v), while a
coastdown runs and after it, beside S1's joint problem. Process time, the best of several rounds.
"""

from __future__ import annotations

import cProfile
import pstats
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks._tables import grid
from benchmarks.accuracy._coasts import Case, coasts
from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.estimation.distance import refit
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64

COUNTS = (100, 300, 500, 1_000, 3_000, 10_000)
SLOPE_FROM = 1_000
ORDER = 12
ROUNDS = 15
ROUND_S = 0.05
BUDGET_S = 3.0  # of a cell: slow calls get fewer rounds, two at least
PLAIN = Case('without steady record')
STEADY = Case('with steady record', steady=True, gust_m_s=0.05)


def best_us(call: Callable[[], object]) -> float:
    """
    Return the time of one call in the best round [us].
    """
    call()
    start = time.process_time()
    call()
    once = max(time.process_time() - start, 1e-7)
    repeats = max(1, int(ROUND_S / once))
    rounds = min(ROUNDS, max(1, int(BUDGET_S / (once * repeats))))
    best = once
    for _ in range(rounds):
        start = time.process_time()
        for _ in range(repeats):
            call()
        best = min(best, (time.process_time() - start) / repeats)
    return 1e6 * best


def numpy_orders(times: Float64, value: Float64) -> Float64:
    """
    Residual sums of all orders by QR; the triangle's last column holds them.
    """
    columns = np.polynomial.legendre.legvander(times, ORDER - 1)
    triangle = np.linalg.qr(np.column_stack([columns, value]), mode='r')
    sse: Float64 = np.cumsum(triangle[::-1, -1] ** 2)[::-1][1:]
    return sse


def one_input(n: int) -> dict[str, Callable[[], object]]:
    """
    Return calls that fit all orders of one input.
    """
    times = np.linspace(-1.0, 1.0, n)
    value = np.exp(-times) + 0.05 * np.random.default_rng(0).normal(size=n)
    refitted, plain = refit(times, value, ORDER)[-1], numpy_orders(times, value)
    np.testing.assert_allclose(refitted, plain, rtol=1e-12)
    return {
        f'refit of all orders to {ORDER}, one input': partial(refit, times, value, ORDER),
        'the same by QR in numpy': partial(numpy_orders, times, value),
    }


def whole(n: int) -> dict[str, Callable[[], object]]:
    """
    Return calls that estimate r(v) from n samples of log and position.
    """
    plain, steady = (next(coasts(replace(case, n=n), 1)) for case in (PLAIN, STEADY))

    def of(estimator: str, method: Callable[..., object], window: Window) -> Callable[[], object]:
        return partial(method, window, plain.truth.ship, Parameters(estimator=estimator))

    return {
        'live': of('one', estimate, plain.window),
        'live, steady record of 30 min': of('one', estimate, steady.window),
        'final': of('one', estimate_final, plain.window),
        'final, steady record of 30 min': of('one', estimate_final, steady.window),
        'S1 joint': of('s1_joint', estimate, plain.window),
    }


def diagnosed(count: int) -> tuple[float, int]:
    """
    Return the time [us] and the Python calls of a diagnosis of so many runs.
    """
    found = list(coasts(replace(STEADY, n=1000), count))
    runs = [CoastRun(f'run {k}', each.window) for k, each in enumerate(found)]
    call = partial(diagnose, runs, found[0].truth.ship, Parameters())
    took = best_us(call)
    with cProfile.Profile() as profile:
        call()
    return took, int(pstats.Stats(profile).total_calls)  # type: ignore[attr-defined]


def shown(time_us: float) -> str:
    """
    Show a time in the unit that suits it.
    """
    for unit, size in (('s', 1e6), ('ms', 1e3)):
        if time_us >= size:
            return f'{time_us / size:.3g} {unit}'
    return f'{time_us:.3g} µs'


def main() -> None:
    """
    Print the table.
    """
    times: dict[str, list[float]] = {}
    for n in COUNTS:
        for name, call in {**one_input(n), **whole(n)}.items():
            times.setdefault(name, []).append(best_us(call))
    tail, rows = COUNTS.index(SLOPE_FROM), []
    for name, took in times.items():
        slope, _ = np.polyfit(np.log(COUNTS[tail:]), np.log(took[tail:]), 1)
        rows.append((name, *map(shown, took), f'{slope:.2f}'))
    title = f'process time, best of up to {ROUNDS} rounds'
    heads = ('n of each input', *map(str, COUNTS), f'slope from {SLOPE_FROM}')
    grid(title, heads, rows, width=120)
    for count in (1, 2):
        took, calls = diagnosed(count)
        print(f'a diagnosis of {count} run(s), n = 1000: {shown(took)}, {calls:,} Python calls')


if __name__ == '__main__':
    main()
