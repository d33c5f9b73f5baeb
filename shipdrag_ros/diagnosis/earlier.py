# SPDX-License-Identifier: Apache-2.0
"""A diagnosis of a ship as it was found in earlier runs, to be given to the next one."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, NoReturn

from shipdrag_ros.diagnosis.result import DiagnosisResult, SeenRun
from shipdrag_ros.display import utc
from shipdrag_ros.errors import DiagnosisError, EarlierError, SimulationError
from shipdrag_ros.fields import read_small_text
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import find

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


_LARGEST = 1_000_000  # bytes of a file
_MOST = 1000  # runs or candidates
_LATEST_NS = 2**62
_NOTHING, _UNKNOWN = 'none', 'unknown'
_EXPECTED = 'give what `shipdrag diagnose` wrote as JSON with --earlier FILE'


class _Wrong(Exception):
    """What is wrong with a document, and where."""


def read_earlier(path: str | PathLike[str]) -> EarlierDiagnosis:
    """
    Read what a diagnosis found.

    Parameters
    ----------
    path
        JSON that `shipdrag diagnose` wrote.

    Returns
    -------
    EarlierDiagnosis

    Raises
    ------
    DiagnosisError
        If it cannot be read, or is no such file; the message says what is wrong.
    """
    try:
        text = read_small_text(path, most_bytes=_LARGEST)
        document = json.loads(text, parse_constant=_refuse)
    except OSError as error:
        raise DiagnosisError(f'{path}: {error.strerror}; {_EXPECTED}') from error
    except RecursionError as error:
        raise DiagnosisError(f'{path}: nested too deeply; {_EXPECTED}') from error
    except ValueError as error:
        raise DiagnosisError(f'{path}: not JSON: {error}; {_EXPECTED}') from error
    try:
        return _diagnosis(document, str(path))
    except _Wrong as error:
        raise DiagnosisError(f'{path}: {error}; {_EXPECTED}') from error


def _refuse(word: str) -> NoReturn:
    raise ValueError(f'{word} is no number')


def _diagnosis(document: Any, name: str) -> EarlierDiagnosis:
    whole = _mapping(document, 'the document')
    ship = whole.get('ship')
    length_m: float | None = None
    stated: tuple[str, ...] = ()
    called = ''
    if ship is not None:
        of_ship = _mapping(ship, 'ship')
        called = _text(of_ship.get('name'), 'ship.name')
        length_m = _number(of_ship.get('length_m'), 'ship.length_m', 1e-3, 1e4)
        effects = _list(of_ship.get('effects'), 'ship.effects')
        stated = tuple(_known(each, 'ship.effects') for each in effects)
    runs = _runs(whole.get('runs'), 'runs')
    if not runs:
        raise _Wrong('runs: empty, and when it was made is not known')
    before: list[SeenRun] = []
    for i, each in enumerate(_list(whole.get('earlier'), 'earlier')):
        place = f'earlier[{i}]'
        given = _mapping(each, place)
        if given.get('used') is True:
            before += _runs(given.get('runs'), f'{place}.runs')
    of_force = whole.get('baseline') == 'stated'
    candidates = _candidates(whole.get('candidates'), all_sized=of_force)
    return EarlierDiagnosis(
        name, called, length_m, runs, tuple(before), candidates, of_force, stated
    )


def _runs(value: Any, path: str) -> tuple[SeenRun, ...]:
    found = []
    for i, each in enumerate(_list(value, path)):
        run = _mapping(each, f'{path}[{i}]')
        time_ns = run.get('time_ns')
        if type(time_ns) is not int or not 0 <= time_ns <= _LATEST_NS:
            raise _Wrong(f'{path}[{i}].time_ns: {_shown(time_ns)}, expected ns since the epoch')
        found.append(SeenRun(_text(run.get('bag'), f'{path}[{i}].bag'), time_ns))
    return tuple(found)


def _candidates(value: Any, *, all_sized: bool) -> tuple[EarlierCandidate, ...]:
    found = []
    listed = _list(value, 'candidates')
    for i, each in enumerate(listed):
        place = f'candidates[{i}]'
        candidate = _mapping(each, place)
        probability = _number(candidate.get('probability'), f'{place}.probability', 0.0, 1.0)
        names = _list(candidate.get('names'), f'{place}.names')
        sizes = _sizes(candidate.get('effects'), f'{place}.effects')
        if names == [_UNKNOWN]:
            continue
        named = set() if names == [_NOTHING] else set(map(str, names))
        # without a baseline, an effect that could not be seen has no size
        if not names or ((sizes or all_sized) and named != set(sizes)):
            raise _Wrong(f'{place}: the names are {_shown(names)}, and the effects others')
        found.append(EarlierCandidate(probability, sizes))
    total = math.fsum(each.probability for each in found)
    if not listed or total > 1.0 + 1e-6:
        raise _Wrong(f'candidates: {len(listed)} of probability {total:g} in all')
    return tuple(found)


def _sizes(value: Any, path: str) -> dict[str, dict[str, Parameter]]:
    found = {}
    for i, each in enumerate(_list(value, path)):
        effect = _mapping(each, f'{path}[{i}]')
        name = _known(effect.get('name'), f'{path}[{i}].name')
        given = _mapping(effect.get('parameters'), f'{path}[{i}].parameters')
        sizes = {}
        for quantity in find(name).parameters:
            place = f'{path}[{i}].parameters.{quantity.name}'
            size = _mapping(given.get(quantity.name), place)
            number = _number(size.get('value'), f'{place}.value', -1e12, 1e12)
            sd = size.get('sd', 'missing')  # null: it could not be found
            sizes[quantity.name] = Parameter(
                number, math.nan if sd is None else _number(sd, f'{place}.sd', 0.0, 1e12)
            )
        found[name] = sizes
    return found


def _known(value: Any, path: str) -> str:
    try:
        return find(str(value)).name
    except SimulationError as error:
        raise _Wrong(f'{path}: {_shown(value)} is no effect that this version knows') from error


def _mapping(value: Any, path: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise _Wrong(f'{path}: {_shown(value)}, expected names with values')
    return value


def _list(value: Any, path: str) -> list[Any]:
    if not isinstance(value, list) or len(value) > _MOST:
        raise _Wrong(f'{path}: {_shown(value)}, expected a list of at most {_MOST}')
    return value


def _text(value: Any, path: str) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise _Wrong(f'{path}: {_shown(value)}, expected a line of text')
    return value


def _number(value: Any, path: str, low: float, high: float) -> float:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not low <= value <= high:
        raise _Wrong(f'{path}: {_shown(value)}, expected a number in {low:g}..{high:g}')
    return float(value)


def _shown(value: Any) -> str:
    if value is None:
        return 'missing'
    if isinstance(value, dict | list):
        return f'{type(value).__name__} of {len(value)}'
    text = repr(value)
    return text if len(text) <= 60 else f'{text[:57]}...'
