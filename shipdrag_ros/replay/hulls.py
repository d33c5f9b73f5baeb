# SPDX-License-Identifier: Apache-2.0
"""
Hulls ranked by Fr_max: the later a hull makes wave, the better.

After S1, by which the Froude number of the steepest rise of r belongs to the
hull and not to the speed it started from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.curve import froude_max
from shipdrag_ros.estimation.result import Estimate, FroudeMax, ResistanceCurve
from shipdrag_ros.replay.run_result import RunResult


@dataclass(frozen=True)
class RankedHull:
    """
    One hull in the ranking.

    Attributes
    ----------
    label
        Name of the ship, with its bag where names repeat.
    froude_max
        Of the coastdown that is shown.
    found_by
        Which rule gave it; by `BRANCH_TOP` it is only a lower bound.
    others
        Fr_max of the other coastdowns found by the same rule.
    curve
        r(v) inside the valid range.
    """

    label: str
    froude_max: float
    found_by: FroudeMax
    others: tuple[float, ...]
    curve: ResistanceCurve


@dataclass(frozen=True)
class Ranking:
    """Hulls, the highest Fr_max first, and what may be concluded."""

    hulls: tuple[RankedHull, ...]
    notes: tuple[str, ...]


def rank(runs: Sequence[RunResult]) -> Ranking:
    """
    Rank the hulls of several bags, each bag a hull of its own.

    Raises
    ------
    EstimationError
        If fewer than two bags gave an estimate.
    """
    names = [run.ship.name for run in runs]
    hulls = []
    missing = []
    for run in runs:
        estimates = [part.estimate for part in run.coastdowns if part.estimate is not None]
        if not estimates:
            missing.append(run.bag)
            continue
        unique = bool(run.ship.name) and names.count(run.ship.name) == 1
        hulls.append(_hull(run.ship.name if unique else f'{run.ship.name} {run.bag}', estimates))
    if len(hulls) < 2:
        raise EstimationError(
            f'compare: {len(hulls)} of {len(runs)} bag(s) gave an estimate, at least 2 are '
            f'needed; without one: {missing}; give bags that contain a coastdown'
        )
    hulls.sort(key=lambda hull: hull.froude_max, reverse=True)
    return Ranking(tuple(hulls), _notes(hulls, missing))


def _hull(label: str, estimates: Sequence[Estimate]) -> RankedHull:
    # the rule of S1 whatever the estimator: one that is valid to the top has a steepest rise too
    tops = [(*froude_max(item.curve), item.valid_curve) for item in estimates]
    # a steepest rise is a property of the hull; a branch top only bounds it from below
    found = [item for item in tops if item[1] is FroudeMax.INFLECTION]
    candidates = sorted(found or tops, key=lambda item: item[0])
    # of several: the middle one of those found, the best of the bounds
    shown = candidates[len(candidates) // 2] if found else candidates[-1]
    top, found_by, curve = shown
    return RankedHull(
        label=label.strip(),
        froude_max=top,
        found_by=found_by,
        others=tuple(item[0] for item in candidates if item is not shown),
        curve=curve,
    )


def _notes(hulls: Sequence[RankedHull], missing: Sequence[str]) -> tuple[str, ...]:
    notes = []
    bounds = [hull.label for hull in hulls if hull.found_by is FroudeMax.BRANCH_TOP]
    if bounds:
        notes.append(
            f'No steepest rise of r was found for {", ".join(bounds)}: its Fr_max is only the '
            'highest speed of the fit, a lower bound. Such a hull may stand higher than '
            'shown, never lower; a coastdown from a higher speed would show it.'
        )
    notes.append(
        'Fr_max ranks the onset of wave making and nothing else: a hull with more resistance at '
        'every speed can have the higher Fr_max.'
    )
    if missing:
        notes.append(f'Without an estimate, and so not ranked: {", ".join(missing)}.')
    return tuple(notes)
