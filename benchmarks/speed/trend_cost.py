# SPDX-License-Identifier: Apache-2.0
"""
What the advised date of a cleaning costs, beside the date chosen in hindsight.

A clean hull fouls by the laws of `trend_score.py`. Every two months the trend is asked
when cleaning pays, from what was measured so far; the hull is cleaned once that date has
come. The cost is fuel and cleaning a year over the time between cleanings; in hindsight
it is least on another date. Beside it stand a straight line through all runs with the
same rule, and a cleaning every two years whatever was measured.

    python -m benchmarks.speed.trend_cost --ships 20 --seed 1
"""

from __future__ import annotations

import numpy as np

from benchmarks._asked import asked
from benchmarks.accuracy.trend_score import World, ship
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship.sections import Economics
from shipdrag_ros.trend.hull_state import Growth, Runs, Steps, search
from shipdrag_ros.trend.ship_trend import CleaningDate, cleaning_date

YEARS = 5.0
ASKED_EVERY = 1.0 / 6.0
PER_UNIT = 1e6  # USD a year for an added resistance of 1


def prices(cleaning_usd: float) -> Economics:
    """Return prices of which only that of a cleaning counts here."""
    return Economics(
        fuel_usd_per_t=600.0,
        sfoc_g_per_kwh=180.0,
        propulsive_efficiency=0.65,
        days_at_sea_per_year=240.0,
        cleaning_usd=cleaning_usd,
    )


def yearly(world: World, cleaning_usd: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times since the first run, and the cost a year if cleaned at each."""
    years = world.runs.years
    added = world.level - world.level[0]
    fouling = np.concatenate([[0.0], np.cumsum(0.5 * (added[1:] + added[:-1]) * np.diff(years))])
    late = years > 0.25
    return years[late], (cleaning_usd + PER_UNIT * fouling[late]) / years[late]


def by_trend(runs: Runs, economics: Economics) -> CleaningDate | None:
    """Return when cleaning pays, as the trend has it."""
    found = search(runs, Steps(), Growth())
    added = found.open.level(runs.years[-1:]).first
    growth = found.state.growth_since_last_step().first
    return cleaning_date(economics, PER_UNIT, added, growth)


def by_line(runs: Runs, economics: Economics) -> CleaningDate | None:
    """Return when cleaning pays, by a straight line through all runs."""
    fit, covariance = np.polyfit(runs.years, runs.added, 1, cov=True)
    sd = np.sqrt(np.diag(covariance))
    added = Parameter(float(np.polyval(fit, runs.years[-1])), float(sd[1]))
    return cleaning_date(economics, PER_UNIT, added, Parameter(float(fit[0]), float(sd[0])))


def cleaned_at(world: World, economics: Economics, advice: object) -> float:
    """Return when the hull is cleaned by an advice that is asked for every two months."""
    years = world.runs.years
    for now in np.arange(0.5, YEARS, ASKED_EVERY):
        seen = years <= now
        runs = Runs(
            years[seen], world.runs.added[seen], world.runs.sd[seen], np.zeros((seen.sum(), 0))
        )
        date = advice(runs, economics)
        if date is not None and date.years < ASKED_EVERY:
            return float(now + date.years)
    return float(years[-1])


def main() -> None:
    """Print the table."""
    options = asked(__doc__, ships=20, seed=1)
    rng = np.random.default_rng(options.seed)
    above: dict[str, list[float]] = {'trend': [], 'straight line': [], 'every two years': []}
    for _ in range(options.ships):
        world = ship(rng, YEARS, 0.0)
        due = rng.uniform(1.0, 3.0)  # a price for which this is about the best date
        economics = prices(PER_UNIT * 0.5 * world.growth * due**2)
        years, cost = yearly(world, economics.cleaning_usd)
        for name, advice in (('trend', by_trend), ('straight line', by_line)):
            when = cleaned_at(world, economics, advice)
            above[name].append(float(np.interp(when, years, cost) / cost.min() - 1.0))
        above['every two years'].append(float(np.interp(2.0, years, cost) / cost.min() - 1.0))
    print(f'{options.ships} ships: cost a year above that of the best date in hindsight')
    for name, each in above.items():
        print(
            f'  {name}: mean {np.mean(each):.1%}, median {np.median(each):.1%}, '
            f'worst {np.max(each):.1%}'
        )


if __name__ == '__main__':
    main()
