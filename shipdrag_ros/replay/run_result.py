# SPDX-License-Identifier: Apache-2.0
"""
What one bag gave, and several of one ship together, as page, terminal and JSON show it.

With the true curve of a simulation, as its bag carries it in `truth.yaml`. Hulls are ranked by
Fr_max, the later a hull makes wave the better: after S1, by which the Froude number of the
steepest rise of r belongs to the hull and not to the speed it started from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros import strict_yaml
from shipdrag_ros.coastdown.events import NotCoastdown
from shipdrag_ros.display import ship_speed, short_repr, utc
from shipdrag_ros.errors import BagError, EstimationError
from shipdrag_ros.estimation.force import Force, usual_speed_m_s
from shipdrag_ros.estimation.reciprocal import Combined, combine
from shipdrag_ros.estimation.result import Estimate, FroudeMax, ResistanceCurve, froude_max
from shipdrag_ros.replay import ReplayResult, words
from shipdrag_ros.replay.coasts import why_no_coastdown
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship, Water

ATTACHMENT = 'truth.yaml'
_READ_AGAIN = 2_000_000  # messages: all their samples are held at once


@dataclass(frozen=True)
class TrueCurve:
    """
    Specific resistance that the simulation used, ascending in speed.

    Attributes
    ----------
    speed_m_s : (m,)
    resistance_m_s2 : (m,)
        r = R / m, retarding positive [m/s^2 = N/kg].
    settings
        What the simulation was asked for, names carrying their units.
    """

    __repr__ = short_repr

    speed_m_s: Float64
    resistance_m_s2: Float64
    settings: Mapping[str, Any]

    def at(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return r at these speeds [m/s^2]; NaN outside the curve.
        """
        return np.interp(
            np.asarray(speed_m_s, np.float64),
            self.speed_m_s,
            self.resistance_m_s2,
            left=np.nan,
            right=np.nan,
        )

    def to_yaml(self) -> str:
        """
        Return the text that `from_yaml` reads back, digit for digit.
        """
        return strict_yaml.dump(
            {
                'settings': dict(self.settings),
                'speed_m_s': self.speed_m_s.tolist(),
                'resistance_m_s2': self.resistance_m_s2.tolist(),
            }
        )

    @classmethod
    def from_yaml(cls, text: str, *, subject: str) -> TrueCurve:
        """
        Read the text of a `truth.yaml`.

        Raises
        ------
        BagError
            If it is not one.
        """
        try:
            values = strict_yaml.load(text)
            speed = np.array(values['speed_m_s'], np.float64)
            resistance = np.array(values['resistance_m_s2'], np.float64)
            settings = dict(values['settings'])
        except (KeyError, TypeError, ValueError) as error:
            raise BagError(
                f'{subject}: {ATTACHMENT} cannot be read ({error}); '
                'write the bag anew with `shipdrag simulate`'
            ) from error
        if speed.ndim != 1 or speed.shape != resistance.shape or not np.all(np.diff(speed) > 0):
            raise BagError(
                f'{subject}: {ATTACHMENT} has {speed.shape} speeds and {resistance.shape} '
                'resistances, expected as many of each, the speeds ascending'
            )
        return cls(speed, resistance, settings)


@dataclass(frozen=True)
class RunResult(ReplayResult):
    """
    What a run gave, with what is said of it.

    Attributes
    ----------
    warnings
        What is wrong with the run, a sentence each.
    truth
        The true curve, where the record is simulated.
    why_none
        What the speed did where nothing was even nearly a coastdown; '' where there is
        something.
    """

    __repr__ = short_repr

    warnings: tuple[str, ...] = ()
    truth: TrueCurve | None = None
    why_none: str = ''

    @property
    def bag(self) -> str:
        """Name of the bag, as the user gave it."""
        return self.run.name

    @property
    def dismissed(self) -> tuple[NotCoastdown, ...]:
        """What is no coastdown, without what is named as cut off one."""
        cuts = [cut for coastdown in self.coastdowns for cut in coastdown.cuts]
        return tuple(one for one in self.not_coastdowns if one not in cuts)

    def summary(self) -> tuple[str, ...]:
        """
        Say what each coastdown gave, or why there is none.

        Returns
        -------
        tuple of str
            A paragraph each, the engineer's units first.
        """
        if not self.coastdowns:
            dismissed = len(self.not_coastdowns)
            return (words.no_coastdown_sentence(self.steady_lead_s, dismissed, self.why_none),)
        return tuple(line for part in self.coastdowns for line in words.summary(part, self.ship))

    @classmethod
    def of(cls, result: ReplayResult) -> RunResult:
        """
        Take what a replay gave, and the truth if the bag holds it.

        Raises
        ------
        BagError
            If the truth in the bag cannot be read.
        """
        text = result.run.attachments.get(ATTACHMENT)
        return cls(
            **vars(result),
            warnings=words.run_warnings(result),
            truth=None if text is None else TrueCurve.from_yaml(text, subject=result.run.name),
            why_none=_why_none(result),
        )


def _why_none(result: ReplayResult) -> str:
    """Say what the speed did, where that is not said by anything else."""
    messages = sum(counts.messages for counts in result.inputs.values())
    if result.coastdowns or result.not_coastdowns:
        return ''
    if messages > _READ_AGAIN:
        return (
            f'nothing in it looked like one; what the speed did was not looked at, as {messages} '
            'messages are too many to be read twice: give a part of it, BAG@START:END'
        )
    return why_no_coastdown(result)


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
    if not of_one_ship(runs):
        return Together(
            None,
            'the bags are of different ships, or of one loaded otherwise: nothing is combined',
        )
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


def of_one_ship(runs: Sequence[RunResult]) -> bool:
    """
    Say whether all runs are of one ship, as deep; what is known of each, and how warm the water
    was, may differ.
    """
    ships = {
        replace(ship, facts=(), water=Water(ship.water.density_kg_m3))
        for ship in (run.ship for run in runs)
    }
    return len(ships) == 1


def _differ(estimates: Sequence[Estimate], ship: Ship) -> str:
    """Say that campaigns differ, by how much; '' where one state of the hull fits all."""
    campaigns: list[list[Estimate]] = []
    usable = [each for each in estimates if len(each.valid_calm)]
    for each in sorted(usable, key=lambda one: one.start_ns):
        if campaigns and each.start_ns - campaigns[-1][-1].end_ns < _CAMPAIGN_NS:
            campaigns[-1].append(each)
        else:
            campaigns.append([each])
    if len(campaigns) < 2:
        return ''
    low = max(each.valid_calm.speed_m_s[0] for each in usable)
    high = min(each.valid_calm.speed_m_s[-1] for each in usable)
    if low > high:
        return (
            'these runs are of different dates, and no speed is common to all: whether one '
            'state of the hull fits them is not shown. Give the runs of one date at a time to '
            'combine them'
        )
    speed = float(np.clip(usual_speed_m_s(usable, ship), low, high))
    means = [_mean([each.valid_calm for each in campaign], speed) for campaign in campaigns]
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
    for first, *_ in shown:
        force = Force.of(first.valid_calm, ship)
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
