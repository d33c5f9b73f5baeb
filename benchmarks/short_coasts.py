# SPDX-License-Identifier: Apache-2.0
"""
Error and cover of the final figure on made-up coasts of small craft, of 10 to 60 s.

    python benchmarks/short_coasts.py --count 200 --seed 0

Craft of 1 to 12 m at Froude numbers of 0.03 to 0.35, which lose 15 to 85 % of their speed; speed
through water, position or both at 2 to 20 Hz, behind filters of 0.1 to 1 s, with slow errors;
light gusts. No steady record before. Nothing of it is drawn from what the fit expects.
"""

from __future__ import annotations

import os

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import math
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table
from unseen_hulls import VISCOSITY, G

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS

STEP_S = 0.01
WIDE = 2.0
NINE_TENTHS = 0.9
_MAIN_HUMP_FROUDE = 0.5


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """
    Draw a number whose logarithm is uniform.
    """
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def wander(rng: np.random.Generator, n: int, correlation_s: float) -> Float64:
    """
    Draw an error of standard deviation 1 that goes over in a time, in steps of `STEP_S`.
    """
    decay = math.exp(-STEP_S / correlation_s)
    found = rng.standard_normal(n)
    found[1:] *= math.sqrt(1.0 - decay * decay)
    for i in range(1, n):
        found[i] += decay * found[i - 1]
    result: Float64 = found
    return result


def _read(rng: np.random.Generator, time_s: Float64, v: Float64) -> tuple[str, list[Block]]:
    """Return which inputs there are, and their readings of a motion."""
    n = len(time_s)
    way = np.concatenate([[0.0], np.cumsum(0.5 * STEP_S * (v[1:] + v[:-1]))])
    inputs = ('log', 'position', 'log, position')[rng.choice(3, p=(0.5, 0.15, 0.35))]
    blocks = []
    if 'log' in inputs:
        every = max(1, round(1.0 / (rng.choice([2.0, 5.0, 10.0, 20.0]) * STEP_S)))
        noise = wander(rng, n, log_uniform(rng, 0.1, 1.0))
        slow = wander(rng, n, log_uniform(rng, 5.0, 100.0))
        read = v + v[0] * (
            log_uniform(rng, 0.003, 0.03) * noise + log_uniform(rng, 5e-4, 5e-3) * slow
        )
        read += 0.3 * v[0] * 0.01 * rng.standard_normal(n)
        stamps = START_NS + np.round(time_s[::every] * 1e9).astype(np.int64)
        blocks.append(Block.of(Channel.SPEED_THROUGH_WATER, stamps, read[::every]))
    if 'position' in inputs:
        every = max(1, round(1.0 / (rng.choice([2.0, 5.0, 10.0, 20.0]) * STEP_S)))
        sd = log_uniform(rng, 0.003, 0.05)
        slow = log_uniform(rng, 0.2, 2.0) * wander(rng, n, log_uniform(rng, 10.0, 200.0))
        quick = wander(rng, n, log_uniform(rng, 0.1, 0.6))
        along = way + sd * (slow + quick)
        across = sd * wander(rng, n, 0.3)
        stamps = START_NS + np.round(time_s[::every] * 1e9).astype(np.int64)
        both = np.column_stack([along, across])[::every]
        blocks.append(Block.of(Channel.POSITION, stamps, both))
    return inputs, blocks


@dataclass(frozen=True)
class Coast:
    """
    A made-up craft and what was read of its coast.

    Attributes
    ----------
    ship, window
    speed_m_s, resistance_m_s2 : (100,)
        The truth, over the speeds of the coast.
    inputs
        What was read.
    """

    ship: Ship
    window: Window
    speed_m_s: Float64
    resistance_m_s2: Float64
    inputs: str

    @classmethod
    def drawn(cls, seed: int, number: int, fast: bool = False) -> Coast:
        """
        Draw one.
        """
        rng = np.random.default_rng([seed, number])
        length = log_uniform(rng, 1.0, 12.0)
        froude = rng.uniform(0.5, 1.3) if fast else rng.uniform(0.03, 0.35)
        start = froude * math.sqrt(G * length)
        ship = Ship(length_m=length, displaced_volume_m3=length**3 * rng.uniform(0.004, 0.02))
        share = rng.uniform(0.0, 1.0) * min(0.6, 0.5 * (froude / 0.25) ** 3)
        power, linear = rng.uniform(3.0, 8.0), rng.uniform(0.0, 0.3)
        duration, left = rng.uniform(10.0, 60.0), rng.uniform(0.15, 0.85)
        # so that she loses what she shall, roughly, by quadratic drag
        largest = 1.1 * start * (1.0 / left - 1.0) / duration

        def making(s: Float64) -> Float64:
            if not fast:
                return s ** (power + 2.0)
            # the main hump at a Froude number of 0.5, and the fall above it
            x, top = s * froude / _MAIN_HUMP_FROUDE, froude / _MAIN_HUMP_FROUDE
            return s**6 * (1.0 + top**7) / (1.0 + x**7)

        def resists(v: Float64) -> Float64:
            s = np.maximum(v, 1e-6) / start
            reynolds = np.log10(np.maximum(s * start * length / VISCOSITY, 1e3)) - 2.0
            top = math.log10(max(start * length / VISCOSITY, 1e3)) - 2.0
            smooth = (1.0 - linear) * (s * top / reynolds) ** 2 + linear * s
            result: Float64 = largest * ((1.0 - share) * smooth + share * making(s))
            return result

        n = round(duration / STEP_S) + 1
        time_s = np.arange(n) * STEP_S
        gust = largest * log_uniform(rng, 0.002, 0.04)
        push = gust * wander(rng, n, log_uniform(rng, 3.0, 60.0))
        v = np.empty(n)
        v[0] = start
        inertia = 1.0 + float(ship.n_r(start))
        for i in range(1, n):
            rate = (push[i - 1] - float(resists(v[i - 1 : i])[0])) / inertia
            v[i] = max(v[i - 1] + STEP_S * rate, 1e-3 * start)
        inputs, blocks = _read(rng, time_s, v)
        window = Window.from_block(
            in_arrival_order(blocks), START_NS, START_NS + round(duration * 1e9)
        )
        speed = np.linspace(v[-1], start, 100)
        return cls(ship, window, speed, resists(speed), inputs)


def scored(coast: Coast) -> tuple[str, float, float, float, float, float]:
    """
    Return the estimator, RMSE, that below nine tenths of the first speed, cover, chi^2, sigma.

    RMSE and sigma in % of the largest r.

    Raises
    ------
    EstimationError
        If there is no estimate.
    """
    found = estimate_final(coast.window, coast.ship, Parameters(froude_min=0.001))
    curve = found.curve
    use = (coast.speed_m_s >= curve.speed_m_s[0]) & (coast.speed_m_s <= curve.speed_m_s[-1])
    speed, true = coast.speed_m_s[use], coast.resistance_m_s2[use]
    if len(speed) < 2:
        raise EstimationError('the curve has none of the speeds')
    r = np.interp(speed, curve.speed_m_s, curve.resistance_m_s2)
    sigma = np.interp(speed, curve.speed_m_s, curve.sigma_repeatable_m_s2)
    off, largest = r - true, coast.resistance_m_s2[-1]
    below = speed < NINE_TENTHS * coast.speed_m_s[-1]
    lower = off[below] if below.any() else off
    return (
        found.estimator,
        100.0 * float(np.sqrt(np.mean(off**2))) / largest,
        100.0 * float(np.sqrt(np.mean(lower**2))) / largest,
        100.0 * float(np.mean(np.abs(off) <= WIDE * sigma)),
        float(np.mean((off / sigma) ** 2)),
        100.0 * float(np.mean(sigma)) / largest,
    )


def main() -> None:
    """
    Print the table.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--count', type=int, default=200)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--fast', action='store_true', help='from Froude numbers of 0.5 to 1.3')
    parser.add_argument('--each', action='store_true', help='print each coast')
    options = parser.parse_args()
    rows: list[tuple[str, str, float, float, float, float, float]] = []
    failed = 0
    for number in range(options.count):
        coast = Coast.drawn(options.seed, number, options.fast)
        try:
            rows.append((coast.inputs, *scored(coast)))
        except EstimationError as error:
            failed += 1
            if options.each:
                print(number, coast.inputs, error)
            continue
        if options.each:
            print(number, *(f'{x:.3g}' if isinstance(x, float) else x for x in rows[-1]))
    table = Table(title=f'{options.count} made-up coasts, seed {options.seed}; {failed} failed')
    heads = 'N', 'RMSE, median', 'nine in ten', 'below 0.9, median', 'nine in ten', 'cover'
    for heading in ('', *heads, 'cover below 50', 'chi^2, median', 'sigma, median'):
        table.add_column(heading, justify='right')
    names = sorted({row[0] for row in rows} | {row[1] for row in rows})
    for name in ('all', *names):
        chosen = [row[2:] for row in rows if name in ('all', row[0], row[1])]
        rmse, lower, cover, chi2, sigma = np.array(chosen).T
        table.add_row(
            name,
            str(len(chosen)),
            *(
                f'{np.quantile(of, at):.2f}'
                for of, at in ((rmse, 0.5), (rmse, 0.9), (lower, 0.5), (lower, 0.9))
            ),
            f'{cover.mean():.1f}',
            f'{100.0 * np.mean(cover < 50.0):.1f}',
            f'{np.median(chi2):.2f}',
            f'{np.median(sigma):.2f}',
        )
    Console(width=140).print(table)


if __name__ == '__main__':
    main()
