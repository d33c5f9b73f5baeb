# SPDX-License-Identifier: Apache-2.0
"""
Error and coverage of the live estimator beside S1's three problems.

Simulated coastdowns of three hulls, in view of which what is expected of r was
chosen (unseen_hulls.py has others); log
and position with n samples each. Errors of r(v) are over the valid range of
each estimate, in percent of the true r at the start; `top` is where that range
ends, in percent of the speed at the start. Where something disturbs slowly, the
half hour before the stop is given too.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from _coasts import COURSE_RAD, STEADY_S, errors
from rich.console import Console
from rich.progress import track
from rich.table import Table

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import (
    START_NS,
    GaussMarkov,
    Scenario,
    Sensor,
    Truth,
    sense,
    simulate,
)

CONFIG = Path(__file__).parents[1] / 'config'
ESTIMATORS = ('log_time', 's1_joint', 's1_speed', 's1_position')


@dataclass(frozen=True)
class Hull:
    """A ship, its coastdown and its sensors."""

    file: str
    speed_m_s: float
    duration_s: float
    log_sd: float
    position_sd: float


HULLS = (
    Hull('vitus_bering', 8.2, 1500.0, 0.05, 10.0),
    Hull('kvlcc2', 7.5, 1500.0, 0.05, 10.0),
    Hull('yacht', 3.08, 300.0, 0.02, 1.0),
)


@dataclass(frozen=True)
class Case:
    """
    What is disturbed; speeds are fractions of that at the start.

    Attributes
    ----------
    n
        Samples of each input.
    current
        Along the track.
    coloured
        Slow noise of the log as large as its white one, 60 s.
    water
        Slow speed of the water, 300 s.
    outliers
        Share of log readings that are wrong by 1 to 3 m/s, in 8.2.
    gap
        No samples for a tenth of the record, early.
    log_scale
        Factor of the log, less 1.
    run_down
        The thrust runs down.
    """

    name: str
    n: int = 500
    current: float = 0.0
    coloured: bool = False
    water: float = 0.0
    outliers: float = 0.0
    gap: bool = False
    log_scale: float = 0.0
    run_down: bool = False

    @property
    def lead_in_s(self) -> float:
        """Length of the record before the stop."""
        return STEADY_S if self.coloured or self.water else 0.0


CASES = (
    Case('n = 100', n=100),
    Case('n = 500'),
    Case('n = 2000', n=2000),
    Case('current 3 %', current=0.03),
    Case('log reads 2 % high', log_scale=0.02),
    Case('outliers 3 %', outliers=0.03),
    Case('gap', gap=True),
    Case('thrust runs down', run_down=True),
    Case('coloured log, 60 s', coloured=True),
    Case('water 0.6 %, 300 s', water=0.006),
)


def truth_of(hull: Hull, case: Case, seed: int) -> Truth:
    """
    Simulate one coastdown; the seed is that of the water.
    """
    ship = Ship.load(CONFIG / f'{hull.file}.yaml')
    if not case.run_down:
        ship = replace(ship, propulsion=None)
    current = case.current * hull.speed_m_s
    water = GaussMarkov(case.water * hull.speed_m_s, 300.0) if case.water else None
    scenario = Scenario(
        speed_m_s=hull.speed_m_s,
        lead_in_s=case.lead_in_s,
        duration_s=hull.duration_s,
        heading_rad=COURSE_RAD,
        current_m_s=(current * np.cos(COURSE_RAD), current * np.sin(COURSE_RAD)),
        water_speed=water,
        seed=seed,
    )
    return simulate(ship, scenario)


def read(truth: Truth, hull: Hull, case: Case, seed: int) -> Window:
    """
    Read it with log and position.
    """
    length_s = hull.duration_s
    # a trifle more, so that the last sample is not lost to rounding
    rate_hz = (case.n - 1 + 1e-6) / length_s
    start_s = case.lead_in_s
    gaps = ((start_s + 0.1 * length_s, start_s + 0.2 * length_s),) if case.gap else ()
    log = Sensor(
        channel=Channel.SPEED_THROUGH_WATER,
        rate_hz=rate_hz,
        sd=hull.log_sd,
        coloured=GaussMarkov(hull.log_sd, 60.0) if case.coloured else None,
        outlier_fraction=case.outliers,
        outlier_size=2.0 / 8.2 * hull.speed_m_s,
        gaps_s=gaps,
    )
    position = Sensor(channel=Channel.POSITION, rate_hz=rate_hz, sd=hull.position_sd, gaps_s=gaps)
    block = sense(truth, (log, position), seed=seed)
    scaled = block.value.copy()
    scaled[block.channel == Channel.SPEED_THROUGH_WATER, 0] *= 1.0 + case.log_scale
    block = replace(block, value=scaled)
    start_ns = START_NS + round(start_s * 1e9)
    return Window.from_block(
        block,
        start_ns,
        start_ns + round(length_s * 1e9),
        before_ns=START_NS if start_s else None,
    )


def windows(hull: Hull, case: Case, runs: int) -> Iterator[tuple[Truth, Window]]:
    """
    Yield truth and window of every run; seeds count from 0.
    """
    truth = truth_of(hull, case, 0)
    for seed in range(runs):
        if case.water:
            truth = truth_of(hull, case, seed)
        yield truth, read(truth, hull, case, seed)


def cells(hull: Hull, case: Case, runs: int) -> list[list[str]]:
    """
    Run one case; return a row of figures an estimator.
    """
    found: dict[str, list[tuple[float, float, float, float]]] = {name: [] for name in ESTIMATORS}
    for truth, window in track(
        windows(hull, case, runs),
        total=runs,
        description=f'{hull.file} {case.name}',
        console=Console(stderr=True),
        transient=True,
    ):
        for name in ESTIMATORS:
            try:
                result = estimate(window, truth.ship, Parameters(estimator=name))
            except EstimationError:
                continue
            one = errors(result, truth)
            top = result.valid_curve.speed_m_s[-1] / hull.speed_m_s
            found[name].append((one.rmse, one.at_top, one.covered, top))
    rows = []
    for name in ESTIMATORS:
        rmse, at_top, covered, top = np.array(found[name]).T
        rows.append(
            [
                name,
                f'{100.0 * np.sqrt(np.mean(rmse**2)):.2f}',
                f'{100.0 * np.sqrt(np.mean(at_top**2)):.1f}',
                f'{100.0 * covered.mean():.0f}',
                f'{100.0 * top.mean():.0f}',
                str(runs - len(rmse)) if len(rmse) < runs else '',
            ]
        )
    return rows


def main() -> None:
    """
    Print a table for each hull.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=200, help='of each case')
    parser.add_argument('--hull', choices=[hull.file for hull in HULLS], help='this one alone')
    options = parser.parse_args()
    for hull in HULLS:
        if options.hull not in (None, hull.file):
            continue
        table = Table(
            title=f'{hull.file}, {hull.speed_m_s} m/s, {hull.duration_s:g} s, log '
            f'{hull.log_sd} m/s, position {hull.position_sd:g} m; {options.runs} runs, seeds 0..'
        )
        table.add_column('case')
        table.add_column('estimator')
        for heading in ('RMSE %', 'at top %', 'cover %', 'top %', 'refused'):
            table.add_column(heading, justify='right')
        for case in CASES:
            for i, row in enumerate(cells(hull, case, options.runs)):
                table.add_row('' if i else case.name, *row)
            table.add_section()
        Console(width=100).print(table)


if __name__ == '__main__':
    main()
