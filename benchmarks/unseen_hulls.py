# SPDX-License-Identifier: Apache-2.0
"""
Error and coverage on made-up hulls that no constant was chosen on.

N = 300 hulls of 10 to 300 m from Froude number 0.10 to 0.33, seeds 5000 to 5299: ITTC-57
friction, and wave making that rises by the fifth to the eleventh power with humps of up to half
of it; n samples of log and position each, white noise. Every hull is read once.
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

from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS

SEEDS = range(5000, 5300)
G, VISCOSITY = 9.81, 1.19e-6
METHODS = {
    'final': (estimate_final, 'one'),
    'live': (estimate, 'one'),
    'S1 joint': (estimate, 's1_joint'),
}


@dataclass(frozen=True)
class Hull:
    """
    A made-up hull and what was read of its coastdown.

    Attributes
    ----------
    ship, window
    speed_m_s, resistance_m_s2 : (200,)
        The truth, from the end of the coastdown, or Froude number 0.05, to the stop.
    """

    ship: Ship
    window: Window
    speed_m_s: Float64
    resistance_m_s2: Float64

    @classmethod
    def drawn(cls, seed: int, n: int) -> Hull:
        """
        Draw one.
        """
        rng = np.random.default_rng(seed)
        length = math.exp(rng.uniform(math.log(10.0), math.log(300.0)))
        froude = rng.uniform(0.1, 0.33)
        start = froude * math.sqrt(G * length)
        ship = Ship(length_m=length, displaced_volume_m3=length**3 * rng.uniform(0.003, 0.009))
        share = rng.uniform(0.0, 1.0) * min(0.65, 0.5 * (froude / 0.25) ** 3)
        power, hump = rng.uniform(3.0, 9.0), rng.uniform(0.0, 0.5)
        waves, phase = rng.uniform(0.5, 1.0), rng.uniform(0.0, 2.0 * math.pi)
        largest = start**2 / (math.exp(rng.uniform(math.log(8.0), math.log(40.0))) * length)
        end = start * rng.uniform(0.25, 0.45)

        def friction(v: Float64) -> Float64:
            result: Float64 = v**2 / (np.log10(np.maximum(v * length / VISCOSITY, 1e3)) - 2.0) ** 2
            return result

        def making(v: Float64) -> Float64:
            at = v / math.sqrt(G * length)
            humps = 1.0 + hump * np.cos(waves / np.maximum(at, 0.03) ** 2 + phase)
            result: Float64 = (at / froude) ** power * humps * v**2
            return result

        def resists(v: Float64) -> Float64:
            top = np.array(start)
            smooth, rough = friction(v) / friction(top), making(v) / making(top)
            result: Float64 = largest * ((1.0 - share) * smooth + share * rough)
            return result

        v = np.linspace(start, end, 4001)
        slow = (1.0 + ship.n_r(v)) / resists(v)

        def summed(rate: Float64) -> Float64:
            steps = 0.5 * (rate[1:] + rate[:-1]) * -np.diff(v)
            return np.concatenate([[0.0], np.cumsum(steps)])

        time_s, distance = summed(slow), summed(slow * v)
        stamps = START_NS + np.round(np.linspace(0.0, time_s[-1], n) * 1e9).astype(np.int64)
        at_s = (stamps - START_NS) * 1e-9
        log = np.interp(at_s, time_s, v) + 0.006 * start * rng.normal(size=n)
        along = np.interp(at_s, time_s, distance)[:, None] * [math.cos(0.7), math.sin(0.7)]
        sd = distance[-1] * rng.uniform(0.001, 0.008)
        block = in_arrival_order(
            [
                Block.of(Channel.SPEED_THROUGH_WATER, stamps, log),
                Block.of(Channel.POSITION, stamps, along + sd * rng.normal(size=(n, 2))),
            ]
        )
        window = Window.from_block(block, START_NS, int(stamps[-1]))
        speed = np.linspace(max(end, float(ship.speed(0.05))), start, 200)
        return cls(ship, window, speed, resists(speed))


def main() -> None:
    """
    Print the table.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--n', type=int, default=500, help='samples of each input')
    n = parser.parse_args().n
    hulls = [Hull.drawn(seed, n) for seed in SEEDS]
    table = Table(title=f'{len(hulls)} made-up hulls, n = {n}, in % of the largest r')
    for heading in ('', 'RMSE', 'median of hulls', 'one in ten exceeds', 'at the top', 'cover'):
        table.add_column(heading, justify='right')
    for name, (method, estimator) in METHODS.items():
        errors, held = [], []
        for hull in hulls:
            curve = method(hull.window, hull.ship, Parameters(estimator=estimator)).curve
            r = np.interp(hull.speed_m_s, curve.speed_m_s, curve.resistance_m_s2)
            sigma = np.interp(hull.speed_m_s, curve.speed_m_s, curve.sigma_repeatable_m_s2)
            off = r - hull.resistance_m_s2
            errors.append(off / hull.resistance_m_s2[-1])
            held.append(np.abs(off) <= 2.0 * sigma)
        error = 100.0 * np.array(errors)
        of_hull = np.sqrt(np.mean(error**2, axis=1))
        table.add_row(
            name,
            f'{np.sqrt(np.mean(error**2)):.2f}',
            f'{np.median(of_hull):.2f}',
            f'{np.quantile(of_hull, 0.9):.2f}',
            f'{np.sqrt(np.mean(error[:, -1] ** 2)):.1f}',
            f'{100.0 * np.mean(held):.0f}',
        )
    Console(width=120).print(table)


if __name__ == '__main__':
    main()
