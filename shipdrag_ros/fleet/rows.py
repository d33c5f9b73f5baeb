# SPDX-License-Identifier: Apache-2.0
"""
What the store holds of a bag and of a coastdown: the columns, and one row of each.

Curves stand on one grid of Froude numbers, the same in all rows, so that runs
of years compare without a fit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipdrag_ros import __version__
from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown
from shipdrag_ros.diagnosis.document import candidates, sized
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

FROUDE: Float64 = np.round(np.linspace(0.02, 0.40, 77), 3)
"""Of every curve in the store."""

SHORT_S = 300.0
_ENDED = {
    EndedBy.TURN: 'turned',
    EndedBy.ENGINE: 'engine',
    EndedBy.ASTERN: 'engine',
    EndedBy.BRAKE: 'braked',
    EndedBy.DATA_STOP: 'data_stop',
    EndedBy.SILENCE: 'data_stop',
    EndedBy.RESET: 'data_stop',
}

Row = dict[str, Any]


@dataclass(frozen=True)
class BagResult:
    """
    What one bag gave.

    Attributes
    ----------
    bag
        The row of `bags`.
    coastdowns
        The rows of `coastdowns`.
    ship_file
        Text of the ship file that was used; '' without one.
    """

    bag: Row
    coastdowns: tuple[Row, ...] = ()
    ship_file: str = ''


def bag_row(root: str, bag: str, digest: str, *, error: str | None = None) -> Row:
    """
    Return the row of a bag of which nothing is read yet, or nothing can be.
    """
    return {
        'root': root,
        'bag': bag,
        'content_hash': digest,
        'software_version': __version__,
        'ship': None,
        'coastdowns': 0,
        'messages': 0,
        'warnings': [],
        'error': error,
    }


def coastdown_row(
    coastdown: EndedCoastdown,
    ship: Ship,
    *,
    diagnosis: DiagnosisResult | None,
    context: Mapping[str, Any],
    flags: Sequence[str] = (),
) -> Row:
    """
    Return the row of a coastdown.

    Parameters
    ----------
    coastdown
        As the replay found it.
    ship
        As she was in the run.
    diagnosis
        Of this coastdown alone; None where there is none.
    context
        Columns that all coastdowns of the bag share: `bag`, `content_hash`,
        `software_version`, `water_temperature_c`, `facts`.
    flags
        What else a trend may weigh.
    """
    estimate = None if coastdown.withdrawn else coastdown.estimate
    own_flags = (*flags, *_flags(coastdown), *(() if diagnosis else ('no_diagnosis',)))
    return {
        **context,
        'time_ns': coastdown.start_ns,
        'end_ns': coastdown.end_ns,
        'ended_by': coastdown.ended_by.value,
        'heading_rad': coastdown.heading_rad,
        'froude': FROUDE,
        'speed_m_s': ship.speed(FROUDE),
        **_curve(estimate),
        'clean_m_s2': clean(ship),
        'length_m': ship.length_m,
        'draught_m': ship.draught_m,
        'displaced_volume_m3': ship.displaced_volume_m3,
        'water_density_kg_m3': ship.water.density_kg_m3,
        'verdict': None if diagnosis is None else diagnosis.verdict.value,
        'effects': None if diagnosis is None else _json(sized(diagnosis.effects)),
        'candidates': None if diagnosis is None else _json(candidates(diagnosis)),
        'flags': sorted(set(own_flags)),
        'error': _error(coastdown),
    }


def same_time(rows: Sequence[Mapping[str, Any]]) -> dict[int, int]:
    """
    Return which coastdowns of one ship were recorded at the same time as another.

    A copied folder, a part of a bag and two recorders aboard give one run several rows.

    Parameters
    ----------
    rows
        Of one ship.

    Returns
    -------
    dict
        Place of a row to the place of the one that stands for it: the longest, then one that
        is not damaged, then the one of which most is known.
    """
    start = np.array([row['time_ns'] for row in rows], np.int64)
    end = np.array([row.get('end_ns') or row['time_ns'] for row in rows], np.int64)
    known = [
        sum(row.get(name) is not None for name in ('water_temperature_c', 'verdict', 'draught_m'))
        - 9 * ('damaged' in (row.get('flags') or ()))
        for row in rows
    ]
    order = sorted(range(len(rows)), key=lambda n: (start[n] - end[n], -known[n], rows[n]['bag']))
    kept: list[int] = []
    found = {}
    for number in order:
        together = np.minimum(end[kept], end[number]) - np.maximum(start[kept], start[number])
        at_once = np.flatnonzero((together > 0) | (start[kept] == start[number]))
        if len(at_once):
            found[number] = kept[int(at_once[0])]
        else:
            kept.append(number)
    return found


def clean(ship: Ship) -> Float64 | None:
    """
    Return r of the clean hull on the grid [m/s^2]; NaN outside the baseline's table.

    None without a baseline.
    """
    if ship.baseline is None:
        return None
    low, high = ship.baseline_range_m_s
    speed = ship.speed(FROUDE)
    inside = (speed >= low) & (speed <= high)
    found = np.full(len(FROUDE), np.nan)
    found[inside] = ship.resistance_n(speed[inside]) / ship.mass_kg
    return found


def _curve(estimate: Estimate | None) -> Row:
    names = ('resistance_m_s2', 'sigma_m_s2', 'sigma_repeatable_m_s2')
    of_conditions = ('conditions_resistance_m_s2', 'conditions_sigma_m_s2')
    if estimate is None:
        return {
            'estimator': None,
            'speed_at_stop_m_s': None,
            **{name: np.full(len(FROUDE), np.nan) for name in (*names, *of_conditions)},
            'reference': None,
            'froude_valid_min': None,
            'froude_valid_max': None,
        }
    (low, high) = estimate.froude_valid
    inside = (low <= FROUDE) & (high >= FROUDE)
    on_grid = {}
    for name in (*names, *of_conditions):
        whole = estimate.conditions if name in of_conditions else estimate.calm
        of_curve = getattr(whole, name.removeprefix('conditions_'))
        value = np.interp(FROUDE, whole.froude, of_curve, left=np.nan, right=np.nan)
        on_grid[name] = np.where(inside, value, np.nan)
    return {
        'estimator': estimate.estimator,
        'speed_at_stop_m_s': float(estimate.calm.speed_m_s[-1]),
        **on_grid,
        'reference': json.dumps(vars(estimate.reference)),
        'froude_valid_min': low,
        'froude_valid_max': high,
    }


def _flags(coastdown: EndedCoastdown) -> list[str]:
    found = []
    if coastdown.withdrawn:
        found.append('withdrawn')
    if coastdown.cuts:
        found.append('cut')
    if coastdown.ended_by in _ENDED:
        found.append(_ENDED[coastdown.ended_by])
    if coastdown.end_ns - coastdown.start_ns < SHORT_S * 1e9:
        found.append('short')
    if coastdown.estimate is None:
        found.append('no_estimate')
    return found


def _error(coastdown: EndedCoastdown) -> str | None:
    if coastdown.withdrawn:
        why = '; '.join(f'{cut.reason.value}: {cut.text}' for cut in coastdown.cuts)
        return f'withdrawn: {why or "it turned out to be no coastdown"}'
    if coastdown.estimate is None:
        return coastdown.failure or 'no estimate was possible'
    return None


def _json(value: object) -> str:
    return json.dumps(value, sort_keys=True)
