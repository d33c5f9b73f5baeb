# SPDX-License-Identifier: Apache-2.0
"""
Trend on simulated fleets: cover of growth and level, cleanings found, false steps, cost.

The world here is not the trend's model: fouling saturates or grows in bursts in port,
seasons move the resistance, errors have long tails, some runs are junk. Beside the trend
stand a straight line through all runs and the difference of means before and after, as
ISO 19030 compares periods.

    python benchmarks/trend_score.py --ships 40 --years 2.5 --seed 1
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # small matrices; threads only wait

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.trend.change_points import search
from shipdrag_ros.trend.hull_state import Growth, HullState, Runs, Steps

WEEK = 7.0 / 365.25
MONTH = 31.0 / 365.25


@dataclass(frozen=True)
class World:
    """A ship's runs and the truth behind them."""

    runs: Runs
    level: np.ndarray
    growth: float
    cleaned: float | None


def ship(rng: np.random.Generator, years: float, cleaning: float) -> World:
    """Simulate weekly runs; `cleaning` is what a cleaning takes away, 0 for none."""
    at = np.arange(0.0, years, WEEK) + rng.uniform(0.0, 0.5 * WEEK)
    at = at[rng.uniform(size=len(at)) < 0.9]
    if rng.uniform() < 0.5:
        level = rng.uniform(0.15, 0.5) * (1.0 - np.exp(-at / rng.uniform(1.0, 4.0)))
    else:  # bursts: months in warm ports
        bursts = rng.gamma(1.0, 0.12 / 12.0, len(at)) * (rng.uniform(size=len(at)) < 0.3)
        level = np.cumsum(bursts + 0.06 * WEEK)
    growth = float(level[-1] - level[0]) / float(at[-1] - at[0])
    when = None
    if cleaning:
        when = float(rng.uniform(0.2, 0.8) * years)
        level = level - cleaning * (at >= when)
    season = 0.004 * np.sin(2.0 * np.pi * (at + rng.uniform()))
    sd = rng.uniform(0.006, 0.012, len(at))
    error = sd * rng.normal(size=len(at)) + 0.0175 * np.sqrt(3 / 5) * rng.standard_t(5, len(at))
    error += (rng.uniform(size=len(at)) < 0.02) * rng.normal(0.0, 0.2, len(at))
    seen = Runs(at - at[0], level + season + error, sd, np.zeros((len(at), 0)))
    return World(seen, level, growth, None if when is None else when - float(at[0]))


def _is_jump(world: World, year: float) -> bool:
    """Tell whether the hull fouled by 2 % or more within a month around a step."""
    near = np.abs(world.runs.years - year) < 0.5 * MONTH
    return bool(near.any() and np.ptp(world.level[near]) > 0.02)


def first_noticed(world: World) -> float | None:
    """Return how many days after a cleaning it is first found and dated, week by week."""
    assert world.cleaned is not None
    years = world.runs.years
    for last in np.flatnonzero(years > world.cleaned + WEEK)[::2]:
        part = Runs(
            *(
                each[: last + 1]
                for each in (years, world.runs.added, world.runs.sd, world.runs.covariates)
            )
        )
        steps = search(part, Steps(), Growth()).steps
        if any(abs(step.year - world.cleaned) < MONTH for step in steps):
            return float(years[last] - world.cleaned) * 365.25
    return None


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--ships', type=int, default=40)
    parser.add_argument('--years', type=float, default=2.5)
    parser.add_argument('--cleaning', type=float, default=0.05)
    parser.add_argument('--noticed', type=int, default=5, help='ships followed week by week')
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    growth, level, false, jumps = [], [], 0, 0
    line = []
    for _ in range(options.ships):
        world = ship(rng, options.years, 0.0)
        found_all = search(world.runs, Steps(), Growth())
        state, steps = found_all.open, found_all.steps
        false += sum(not _is_jump(world, step.year) for step in steps)
        jumps += sum(_is_jump(world, step.year) for step in steps)
        found = state.growth_per_year()
        growth.append(abs(found.value[0] - world.growth) < 1.96 * found.sd[0])
        band = state.level(world.runs.years)
        level.append(np.mean(np.abs(band.value - world.level) < 1.96 * band.sd))
        fit, covariance = np.polyfit(world.runs.years, world.runs.added, 1, cov=True)
        line.append(abs(fit[0] - world.growth) < 1.96 * np.sqrt(covariance[0, 0]))
    years = options.ships * options.years
    print(f'{options.ships} ships, {years:.0f} ship-years without a cleaning, weekly, 2 %')
    print(
        f'  growth inside its 95 % band: {np.mean(growth):.0%} (straight line {np.mean(line):.0%})'
    )
    print(f'  level inside its 95 % band: {np.mean(level):.0%} of runs')
    print(f'  false steps: {false} in {years:.0f} ship-years; true bursts found: {jumps}')
    hit, size, means, noticed, growth = 0, [], [], [], []
    for number in range(options.ships):
        world = ship(rng, options.years, options.cleaning)
        found_all = search(world.runs, Steps(), Growth())
        state, steps = found_all.open, found_all.steps
        near = [step for step in steps if abs(step.year - world.cleaned) < MONTH]
        hit += bool(near)
        slope = state.growth_per_year()
        growth.append(abs(slope.value[0] - world.growth) < 1.96 * slope.sd[0])
        known = HullState(world.runs, Steps(np.array([world.cleaned])), Growth())
        size.append(float(known.changes().value[0]) + options.cleaning)
        half = np.abs(world.runs.years - world.cleaned) < 0.25
        after = world.runs.years >= world.cleaned
        means.append(
            world.runs.added[half & after].mean()
            - world.runs.added[half & ~after].mean()
            + options.cleaning
        )
        if number < options.noticed:
            noticed.append(first_noticed(world))
    print(f'{options.ships} ships with one cleaning of {options.cleaning:.0%} that nobody noted')
    print(f'  found and dated within a month: {hit / options.ships:.0%}')
    print(f'  growth inside its 95 % band: {np.mean(growth):.0%}')
    print(
        f'  first noticed after (days, {options.noticed} ships): '
        f'{[day and round(day) for day in noticed]}'
    )
    print(
        '  its size where it is known, rms error: '
        f'{np.sqrt(np.mean(np.square(size))):.2%}; difference of means of three months '
        f'{np.sqrt(np.mean(np.square(means))):.2%}'
    )


if __name__ == '__main__':
    main()
