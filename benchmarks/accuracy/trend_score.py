# SPDX-License-Identifier: Apache-2.0
"""
Trend on simulated fleets: cover of growth and level, cleanings found, false steps, cost.

The world here is not the trend's model: fouling saturates or grows in bursts in port,
seasons move the resistance, errors have long tails, some runs are junk. Beside the trend
stand a straight line through all runs, the difference of means before and after, as
ISO 19030 compares periods, and change points by `ruptures` where it is installed; all in
one table.

    python -m benchmarks.accuracy.trend_score --ships 40 --years 2.5 --seed 1
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks._asked import asked
from shipdrag_ros.trend.hull_state import Growth, HullState, Runs, Steps, search

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
    """Say whether the hull fouled by 2 % or more within a month around a step."""
    near = np.abs(world.runs.years - year) < 0.5 * MONTH
    return bool(near.any() and np.ptp(world.level[near]) > 0.02)


def steps_by_ruptures(runs: Runs) -> list[float] | None:
    """Return the change points of the runs less a straight line, by PELT; None without it."""
    try:
        import ruptures
    except ImportError:  # of peers.in; nothing else needs it
        return None
    rest = runs.added - np.polyval(np.polyfit(runs.years, runs.added, 1), runs.years)
    step = np.diff(rest)
    variance = float(np.median(np.abs(step)) / 0.6745) ** 2 / 2.0
    penalty = 3.0 * variance * np.log(len(rest))
    ends = ruptures.Pelt(model='l2', min_size=2, jump=1).fit(rest).predict(pen=penalty)[:-1]
    return [float(0.5 * (runs.years[end - 1] + runs.years[end])) for end in ends]


def growth_by_means(runs: Runs) -> float:
    """Return the growth by the means of the first and the last three months."""
    first, last = runs.years < 0.25, runs.years > runs.years[-1] - 0.25
    rise = runs.added[last].mean() - runs.added[first].mean()
    return float(rise / (runs.years[last].mean() - runs.years[first].mean()))


METHODS = {
    'trend': 'trend',
    'line': 'straight line',
    'means': 'difference of means',
    'ruptures': 'ruptures (PELT)',
}


def _rms(errors: list[float]) -> str:
    return f'{np.sqrt(np.mean(np.square(errors))):.1%}'


def _mean(shares: list[float]) -> str:
    return f'{np.mean(shares):.0%}'


def _sum(counts: list[int]) -> str:
    return str(sum(counts))


ROWS: dict[str, tuple[str, Callable[[list[Any]], str]]] = {
    'inside': ('growth inside its 95 % band', _mean),
    'off': ('growth, rms error a year', _rms),
    'level': ('level inside its 95 % band', _mean),
    'false': ('false steps in {years:.0f} ship-years', _sum),
    'bursts': ('sudden growth found beside them', _sum),
    'found': ('found and dated within a month', _mean),
    'size': ('size where its date is known, rms error', _rms),
}


class Score:
    """What is counted over ships of one kind, by row of the table and method."""

    def __init__(self) -> None:
        self.years = 0.0
        self.of: dict[str, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))

    def add(self, world: World, cleaning: float) -> None:
        """Score one ship."""
        runs, seen = world.runs, search(world.runs, Steps(), Growth())
        self.years += float(runs.years[-1])
        slope = seen.open.growth_per_year()
        fit, covariance = np.polyfit(runs.years, runs.added, 1, cov=True)
        for name, value, sd in (
            ('trend', float(slope.value[0]), float(slope.sd[0])),
            ('line', float(fit[0]), float(np.sqrt(covariance[0, 0]))),
            ('means', growth_by_means(runs), None),
        ):
            self.of['off'][name].append(value - world.growth)
            if sd is not None:
                self.of['inside'][name].append(abs(value - world.growth) < 1.96 * sd)
        band = seen.open.level(runs.years)
        held = float(np.mean(np.abs(band.value - world.level) < 1.96 * band.sd))
        self.of['level']['trend'].append(held)
        steps = {'trend': [step.year for step in seen.steps], 'ruptures': steps_by_ruptures(runs)}
        for name, years in steps.items():
            if years is None:
                continue
            near = [world.cleaned and abs(year - world.cleaned) < MONTH for year in years]
            jumps = [_is_jump(world, year) for year, right in zip(years, near) if not right]
            self.of['false'][name].append(len(jumps) - sum(jumps))
            if name == 'trend':
                self.of['bursts'][name].append(sum(jumps))
            if world.cleaned is not None:
                self.of['found'][name].append(any(near))
        if world.cleaned is not None:
            known = HullState(runs, Steps(np.array([world.cleaned])), Growth())
            self.of['size']['trend'].append(float(known.changes().value[0]) + cleaning)
            half = np.abs(runs.years - world.cleaned) < 0.25
            after = runs.years >= world.cleaned
            change = runs.added[half & after].mean() - runs.added[half & ~after].mean()
            self.of['size']['means'].append(float(change) + cleaning)

    def rows(self) -> Iterator[tuple[str, ...]]:
        """Yield what was counted: what, then of the trend and of each peer; '-': says nothing."""
        for row, (what, shown) in ROWS.items():
            if of := self.of.get(row):
                cells = (shown(of[name]) if name in of else '-' for name in METHODS)
                yield what.format(years=self.years), *cells


def show(rows: list[tuple[str, ...]]) -> None:
    """Print a table; a method that says nothing of something has a dash."""
    for what, *values in rows:
        print(f'{what:<50}' + ''.join(f'{value:>21}' for value in values))


def main() -> None:
    """Print the table."""
    options = asked(__doc__, ships=40, years=2.5, cleaning=0.05, seed=1)
    rng = np.random.default_rng(options.seed)
    show([(f'{options.ships} ships each, weekly runs, scatter 2 %', *METHODS.values())])
    for cleaning in (0.0, options.cleaning):
        score = Score()
        for _ in range(options.ships):
            score.add(ship(rng, options.years, cleaning), cleaning)
        what = f'one cleaning of {cleaning:.0%} that nobody noted:' if cleaning else 'no cleaning:'
        show([(what,), *score.rows()])


if __name__ == '__main__':
    main()
