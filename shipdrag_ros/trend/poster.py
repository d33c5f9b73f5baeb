# SPDX-License-Identifier: Apache-2.0
"""
Stopping without engine: time and way from speed to speed, of all runs of a ship.

One page to hang beside the wheelhouse poster of IMO Resolution A.601(15), Appendix 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student

from shipdrag_ros.display import Section, Table, clock, day, ship_speed, speed_unit, way
from shipdrag_ros.fleet.store import same_time
from shipdrag_ros.forecast.foretell import GUST
from shipdrag_ros.forecast.result import Band, Z
from shipdrag_ros.report.document import write_page
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.trend.series import known

_STEP_KN, _STEP_M_S = 2.0, 0.1  # from speed to speed, of a ship and of a model
_FINE = 40  # parts of a step


@dataclass(frozen=True)
class SpeedStep:
    """From a speed to a lower one: the time and the way through water, of how many runs."""

    from_m_s: float
    to_m_s: float
    runs: int
    time_s: Band
    way_m: Band


@dataclass(frozen=True)
class Poster:
    """
    The table of a ship, the fastest step first; `runs` are their times [ns], each run once.
    """

    ship: Ship
    runs: tuple[int, ...]
    steps: tuple[SpeedStep, ...]


def poster(ship: Ship, rows: Sequence[Mapping[str, Any]]) -> Poster:
    """
    Return the table of a ship from her rows of the store.

    Parameters
    ----------
    ship
        For n_r.
    rows
        From `fleet.store.read_coastdowns`.

    Notes
    -----
    A band of 90 % is that of the next stop: what runs differ by (Student's t), their own sigma,
    and gusts.
    """
    used = [row for row in rows if row['resistance_m_s2'] is not None and not row['error']]
    copies = same_time(used)
    used = [row for number, row in enumerate(used) if number not in copies]
    unit, name = speed_unit(ship.mass_kg)
    step = (_STEP_KN if name == 'knots' else _STEP_M_S) * unit
    tops = [_known(row)[0].max(initial=0.0) for row in used]
    levels = step * np.arange(np.floor(max(tops, default=0.0) / step), 0.0, -1.0)
    steps = []
    for high, low in pairwise(levels):
        found = [each for row in used if (each := _passage(ship, row, high, low)) is not None]
        if found:
            time, distance, sigma = np.array(found).T
            bands = _band(time, sigma), _band(distance, sigma)
            steps.append(SpeedStep(float(high), float(low), len(found), *bands))
    return Poster(ship, tuple(int(row['time_ns']) for row in used), tuple(steps))


def _known(row: Mapping[str, Any]) -> tuple[Float64, Float64, Float64]:
    speed, r, sigma = known(row, 'resistance_m_s2', 'sigma_m_s2')
    return speed[r > 0.0], r[r > 0.0], sigma[r > 0.0]


def _passage(
    ship: Ship, row: Mapping[str, Any], high: float, low: float
) -> tuple[float, float, float] | None:
    """Return time, way and relative sigma of one run; None where it does not cover both speeds."""
    speed, r, sigma = _known(row)
    if len(speed) < 2 or not speed[0] <= low < high <= speed[-1]:
        return None
    u = np.linspace(low, high, _FINE + 1)
    per_a = (1.0 + ship.n_r(u)) / np.interp(u, speed, r)
    relative = float(np.mean(np.interp(u, speed, sigma / r)))
    return float(np.trapezoid(per_a, u)), float(np.trapezoid(u * per_a, u)), relative


def _band(values: Float64, sigma: Float64) -> Band:
    n = len(values)
    logs = np.log(values)
    own = Z * np.hypot(float(np.sqrt(np.mean(sigma**2))), GUST.sd)
    scatter = 0.0
    if n > 1:
        scatter = float(student.ppf(0.95, n - 1) * logs.std(ddof=1) * np.sqrt(1.0 + 1.0 / n))
    median, spread = float(np.exp(logs.mean())), float(np.hypot(own, scatter))
    return Band(median, median * np.exp(-spread), median * np.exp(spread))


def table(found: Poster) -> Table:
    """
    Show a line a step, with time and way from the highest speed on.
    """
    mass = found.ship.mass_kg
    rows, time, distance = [], 0.0, 0.0
    for each in found.steps:
        ways = partial(way, mass_kg=mass, largest_m=each.way_m.high)
        time, distance = time + each.time_s.median, distance + each.way_m.median
        rows.append(
            (
                f'{ship_speed(each.from_m_s, mass)} to {ship_speed(each.to_m_s, mass)}',
                '{} ({} to {})'.format(*map(clock, each.time_s)),
                '{} ({} to {})'.format(*map(ways, each.way_m)),
                clock(time),
                ways(distance),
                f'{each.runs}',
            )
        )
    head = ('speed', 'time [min:s] (90 %)', 'way (90 %)', 'time so far', 'way so far', 'runs')
    return Table(head, tuple(rows))


def write_poster(path: Path, posters: Sequence[Poster]) -> None:
    """
    Write the page, a section a ship (HTML); an existing one is replaced.
    """
    sections = [
        Section(
            heading=each.ship.name or 'a ship without a name',
            quiet=f'{len(each.runs)} coastdowns, {day(min(each.runs))} to {day(max(each.runs))}'
            if each.runs
            else 'no coastdown',
            tables=[('', table(each))],
        )
        for each in posters
    ]
    write_page(
        path,
        'Stopping without engine',
        sections,
        sentence='Engine stopped, helm amidships, through water, in calm deep water. '
        'Beside the wheelhouse poster of IMO Resolution A.601(15), Appendix 2; it does not '
        'replace it. In wind, shallow water, another loading or hull: other figures.',
    )
