# SPDX-License-Identifier: Apache-2.0
"""The coastdowns of one ship, from all bags, as one result; or why they are not one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from shipdrag_ros.display import ship_speed, utc
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.force import Force, usual_speed_m_s
from shipdrag_ros.estimation.reciprocal import Combined, combine, comparable
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.ship import Ship

_CAMPAIGN_NS = 2 * 86_400 * 1_000_000_000  # runs closer than that show one state of the hull
_DIFFER_SD = 3.0
_ALL_SHOWN = 3  # dates that a sentence has room for
_RUN_TO_RUN = 0.02  # of r: wind and sea that the band of a run does not hold


@dataclass(frozen=True)
class Together:
    """
    Several coastdowns together.

    Attributes
    ----------
    combined
        Their one r(v); None where there is none.
    why_not
        Why there is none; empty where there was nothing to combine.
    """

    combined: Combined | None
    why_not: str = ''


def together(runs: Sequence[RunResult]) -> Together:
    """
    Combine all coastdowns that gave an estimate, if they are of one ship in one state.

    Parameters
    ----------
    runs
        What each bag gave.

    Notes
    -----
    Runs more than two days apart are held against each other first. Where two
    such campaigns differ by more than three standard deviations (run-to-run
    scatter of 2 % counted), they show two states of the ship and stay apart.
    """
    found = [
        (part.estimate, part.heading_rad)
        for run in runs
        for part in run.coastdowns
        if part.estimate is not None
    ]
    if len(found) < 2:
        return Together(None)
    if len({run.ship for run in runs}) > 1:
        return Together(None, 'the bags are of different ships, so nothing is combined')
    twice = _twice(runs)
    if twice:
        return Together(None, f'windows of {twice!r} overlap, and what they share is one run')
    apart = _differ([part[0] for part in found], runs[0].ship)
    if apart:
        return Together(None, apart)
    try:
        return Together(combine([part[0] for part in found], [part[1] for part in found]))
    except EstimationError as error:
        return Together(None, str(error))


def _differ(estimates: Sequence[Estimate], ship: Ship) -> str:
    """Say that campaigns differ, by how much; '' where one state of the hull fits all."""
    campaigns: list[list[tuple[Estimate, ResistanceCurve]]] = []
    usable = [each for each in estimates if len(each.valid_curve)]
    curves = comparable(usable)
    for each in sorted(zip(usable, curves, strict=True), key=lambda one: one[0].start_ns):
        if campaigns and each[0].start_ns - campaigns[-1][-1][0].end_ns < _CAMPAIGN_NS:
            campaigns[-1].append(each)
        else:
            campaigns.append([each])
    if len(campaigns) < 2:
        return ''
    low = max(curve.speed_m_s[0] for curve in curves)
    high = min(curve.speed_m_s[-1] for curve in curves)
    if low > high:
        return ''  # no speed in common: `combine` says so
    speed = float(np.clip(usual_speed_m_s(usable, ship), low, high))
    means = [_mean([curve for _, curve in campaign], speed) for campaign in campaigns]
    far = max(
        abs(one[0] - other[0]) / np.hypot(one[1], other[1])
        for one, other in combinations(means, 2)
    )
    if far <= _DIFFER_SD:
        return ''
    parts = []
    shown, of_many = campaigns, ''
    if len(campaigns) > _ALL_SHOWN:  # the table has all of them
        r = [mean[0] for mean in means]
        shown = [campaigns[int(np.argmin(r))], campaigns[int(np.argmax(r))]]
        of_many = f'of {len(campaigns)} dates the least and the most: '
    for (first, curve), *_ in shown:
        force = Force.of(curve, ship)
        _, resistance, _, over = force.cells(force.near(speed))
        parts.append(f'{utc(first.start_ns)[:10]}: {", ".join(filter(None, (resistance, over)))}')
    return (
        f'these runs differ at {ship_speed(speed, ship.mass_kg)} ({of_many}{"; ".join(parts)}), '
        f'by {far:.1f} standard deviations: one state of the hull does not fit all. Give the runs '
        'of one state at a time to combine them'
    )


def _mean(curves: Sequence[ResistanceCurve], speed_m_s: float) -> tuple[float, float]:
    """Return the mean of r at a speed, and its sd without what all runs share."""
    r, sd = np.array(
        [
            [
                np.interp(speed_m_s, curve.speed_m_s, curve.resistance_m_s2),
                np.interp(speed_m_s, curve.speed_m_s, curve.sigma_repeatable_m_s2),
            ]
            for curve in curves
        ]
    ).T
    sd = np.hypot(sd, _RUN_TO_RUN * r)
    return float(np.mean(r)), float(np.sqrt(np.sum(sd**2)) / len(r))


def _twice(runs: Sequence[RunResult]) -> str:
    """Return a bag of which two windows share a part; '' for none."""
    seen: list[tuple[str, int, int]] = []
    for run in runs:
        for each in run.coastdowns:
            if each.estimate is None:
                continue
            for bag, start_ns, end_ns in seen:
                if bag == run.bag and each.start_ns < end_ns and start_ns < each.end_ns:
                    return bag
            seen.append((run.bag, each.start_ns, each.end_ns))
    return ''
