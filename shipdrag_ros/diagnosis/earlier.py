# SPDX-License-Identifier: Apache-2.0
"""A diagnosis of a ship as it was found in earlier runs, to be given to the next one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from shipdrag_ros.diagnosis.result import DiagnosisResult, SeenRun
from shipdrag_ros.display import utc
from shipdrag_ros.errors import EarlierError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import Ship

_SAME_NS = 60 * 10**9  # stops of one ship so near to each other are one
_LENGTHS = 0.01  # relative, by which the lengths of one ship differ


@dataclass(frozen=True)
class EarlierCandidate:
    """
    What may have been missing.

    Attributes
    ----------
    probability
    effects
        Their sizes by the names of the parameters, by name; none: nothing was missing.
    """

    probability: float
    effects: Mapping[str, Mapping[str, Parameter]]


@dataclass(frozen=True)
class EarlierDiagnosis:
    """
    What a diagnosis found in runs of before.

    Attributes
    ----------
    name
        Of the file, for the user.
    ship
        Her name; '' where it is not known.
    length_m
        Of the ship; None where it is not known.
    runs
        That it rests on.
    before
        Runs of the diagnoses that were given to it, which it holds already.
    candidates
        With a name, or nothing; what their probabilities leave to 1 says nothing.
    of_force
        Whether the force was held against a stated baseline, so that it speaks of the hull.
    stated
        Effects that the ship file stated, so that they were not missing.
    """

    name: str
    ship: str
    length_m: float | None
    runs: tuple[SeenRun, ...]
    before: tuple[SeenRun, ...]
    candidates: tuple[EarlierCandidate, ...]
    of_force: bool
    stated: tuple[str, ...] = ()

    @classmethod
    def of(cls, found: DiagnosisResult, ship: Ship | None, *, name: str) -> EarlierDiagnosis:
        """
        Return what a result says of later runs.

        Parameters
        ----------
        found
            Of runs whose times are known.
        ship
            That they were of; None where none is known.
        name
            For the user.
        """
        return cls(
            name,
            '' if ship is None else ship.name,
            None if ship is None else ship.length_m,
            found.runs,
            tuple(run for each in found.earlier for run in (*each.runs, *each.before)),
            tuple(
                EarlierCandidate(
                    each.probability, {effect.name: effect.parameters for effect in each.effects}
                )
                for each in found.candidates
            ),
            found.baseline == 'stated',
            () if ship is None else tuple(effect.name for effect in ship.effects),
        )

    @property
    def last_ns(self) -> int:
        """When its last run was stopped [ns since the epoch]."""
        return max((run.time_ns for run in self.runs), default=0)

    def probability(self, name: str) -> float:
        """Return how probable it was that an effect was there."""
        return math.fsum(each.probability for each in self.candidates if name in each.effects)


def check(latest_first: Sequence[EarlierDiagnosis], ship: Ship, runs: Sequence[SeenRun]) -> None:
    """
    Refuse what cannot count for the runs at hand.

    Parameters
    ----------
    latest_first
        Earlier diagnoses.
    ship
        Of the runs.
    runs
        That are diagnosed.

    Raises
    ------
    EarlierError
        If one is of another ship or of later runs, or holds a run that would count twice.
    """
    for each in latest_first:
        if not each.runs:
            raise EarlierError(f'{each.name}: when its runs were is not known; leave it out')
        _refuse_other_ship(each, ship)
    _refuse_twice(latest_first, runs)
    first_ns = min(run.time_ns for run in runs)
    for each in latest_first:
        if each.last_ns > first_ns:
            raise EarlierError(
                f'{each.name}: its run of {utc(each.last_ns)} is later than the first one '
                f'diagnosed here, {utc(first_ns)}; give diagnoses of runs of before with '
                '--earlier FILE'
            )


def _refuse_other_ship(earlier: EarlierDiagnosis, ship: Ship) -> None:
    other = bool(earlier.ship and ship.name) and earlier.ship != ship.name
    if earlier.length_m is not None:
        other = other or abs(earlier.length_m / ship.length_m - 1.0) > _LENGTHS
    if other:
        length = '' if earlier.length_m is None else f' of {earlier.length_m:g} m'
        raise EarlierError(
            f'{earlier.name}: it is of the ship {earlier.ship!r}{length}, and these runs are of '
            f'{ship.name!r} of {ship.length_m:g} m; give diagnoses of one ship with --earlier FILE'
        )


def _refuse_twice(earlier: Sequence[EarlierDiagnosis], runs: Sequence[SeenRun]) -> None:
    """Refuse a run that would count twice."""
    known: list[tuple[SeenRun, str]] = [(run, 'here') for run in runs]
    for each in earlier:
        own = (*each.runs, *each.before)
        for run in own:
            twice = [
                where for other, where in known if abs(other.time_ns - run.time_ns) < _SAME_NS
            ]
            if twice:
                raise EarlierError(
                    f'{each.name}: it holds the run of {utc(run.time_ns)} ({run.name}), which '
                    f'counts {twice[0]} already; a run counts once, so leave one of them out'
                )
        known += [(run, f'in {each.name}') for run in own]
