# SPDX-License-Identifier: Apache-2.0
"""
The JSON document of `diagnose` and of `~/diagnosis`, written, and read for the next runs.

Others rely on its keys.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass
from functools import partial
from os import PathLike
from typing import Any, NoReturn

from shipdrag_ros.diagnosis import words
from shipdrag_ros.diagnosis.result import (
    DiagnosisResult,
    EffectEstimate,
    Gap,
    RunSize,
    SeenRun,
    WeighedEarlier,
    WeighedFact,
)
from shipdrag_ros.display import json_text
from shipdrag_ros.errors import DiagnosisError, SimulationError
from shipdrag_ros.fields import (
    INVALID,
    Key,
    Kind,
    Problems,
    flag,
    list_of,
    number,
    read_keys,
    read_small_text,
    show,
    whole_number,
)
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import find


def document(found: DiagnosisResult, ship: Ship | None) -> dict[str, Any]:
    """
    Return the document of a diagnosis.

    The candidate `none` says that nothing is missing, `unknown` that it is
    something without a name.
    """
    return {
        'sentence': words.sentence(found),
        'question': found.question or None,
        'verdict': str(found.verdict),
        'effects': sized(found.effects),
        'candidates': candidates(found),
        'would_decide': [each.measure for each in found.would_decide],
        'resolves': {each.measure: each.probability for each in found.would_decide},
        'advice': [
            {**asdict(each), 'text': line}
            for each, line in zip(found.would_decide, words.advice(found), strict=True)
        ],
        'limits': _limits(found),
        'where': None if found.where is None else asdict(found.where),
        'gap': {
            'before': _gap(found.before),
            'after': _gap(found.after) or {},
            'held_out_before': _gap(found.held_out_before),
            'held_out_after': _gap(found.held_out_after),
        },
        'baseline': found.baseline,
        'coastdowns_used': found.coastdowns_used,
        'examined': list(found.examined),
        'no_coastdown': found.no_coastdown or None,
        'notes': list(found.notes),
        'runs_differ': sizes_of_runs(found.runs_differ),
        'facts': [_fact(each) for each in found.facts],
        'ship': None
        if ship is None
        else {
            'name': ship.name,
            'length_m': ship.length_m,
            'effects': [effect.name for effect in ship.effects],
        },
        'runs': _runs(found.runs),
        'earlier': [_earlier(each) for each in found.earlier],
    }


def _limits(found: DiagnosisResult) -> dict[str, dict[str, Any]]:
    return {
        name: {
            'parameter': each.parameter,
            each.bound: each.value,
            'would_be_named': each.would_be_named,
            'percent_of_r': each.percent_of_r,
        }
        for name, each in found.limits.items()
    }


def _fact(weighed: WeighedFact) -> dict[str, Any]:
    return {
        **asdict(weighed.fact),
        'bag': weighed.run or None,
        'wrong': weighed.wrong,
        'contradicted': weighed.contradicted,
        'against': list(weighed.against),
    }


def _runs(runs: Sequence[SeenRun]) -> list[dict[str, Any]]:
    return [{'bag': run.name, 'time_ns': run.time_ns} for run in runs]


def _earlier(given: WeighedEarlier) -> dict[str, Any]:
    return {
        'file': given.name,
        'used': given.used,
        'runs': _runs((*given.runs, *given.before)),
        'effects': [{**asdict(each), 'contradicted': each.contradicted} for each in given.effects],
        'unused': list(given.unused),
    }


def sizes_of_runs(sizes: Sequence[RunSize]) -> list[dict[str, Any]]:
    """
    Return the size of an effect in each of some runs that differ.
    """
    return [
        {
            'bag': each.run,
            'effect': each.effect,
            'parameter': each.parameter,
            'value': each.size.value,
            'sd': each.size.sd,
        }
        for each in sizes
    ]


def sized(effects: Sequence[EffectEstimate]) -> list[dict[str, Any]]:
    """
    Return effects with their probabilities and sizes.
    """
    return [
        {
            'name': effect.name,
            'probability': effect.probability,
            'parameters': dict(_sizes(effect)),
        }
        for effect in effects
    ]


def _sizes(effect: EffectEstimate) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the sizes of an effect by name, as figures and in words."""
    declared = {quantity.name: quantity for quantity in find(effect.name).parameters}
    for name, size in effect.parameters.items():
        text = f'{words.quantity_text(declared[name])}: {words.size(declared[name], size)}'
        yield name, {'value': size.value, 'sd': size.sd, 'text': text}


def candidates(found: DiagnosisResult) -> list[dict[str, Any]]:
    """
    Return the candidates, each with its sizes.
    """
    return [
        {
            'names': list(each.names) or ['none'],
            'probability': each.probability,
            'effects': sized(each.effects),
        }
        for each in found.candidates
    ]


def _gap(gap: Gap | None) -> dict[str, Any] | None:
    return None if gap is None else asdict(gap)


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

        Raises
        ------
        DiagnosisError
            If its verdict waits for an answer, or no run is known.
        """
        return _diagnosis(json.loads(json_text(document(found, ship))), name)

    @property
    def last_ns(self) -> int:
        """When its last run was stopped [ns since the epoch]."""
        return max((run.time_ns for run in self.runs), default=0)

    def probability(self, name: str) -> float:
        """Return how probable it was that an effect was there."""
        return math.fsum(each.probability for each in self.candidates if name in each.effects)


_LARGEST = 1_000_000  # bytes of a file
_MOST = 1000  # runs or candidates
_LATEST_NS = 2**62
_NOTHING, _UNKNOWN = 'none', 'unknown'
_EXPECTED = 'give what `shipdrag diagnose` wrote as JSON with --earlier FILE'


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
        given = json.loads(text, parse_constant=_refuse)
    except OSError as error:
        raise _wrong(path, error.strerror) from error
    except RecursionError as error:
        raise _wrong(path, 'nested too deeply') from error
    except ValueError as error:
        raise _wrong(path, f'not JSON: {error}') from error
    return _diagnosis(given, str(path))


def _wrong(name: str | PathLike[str], why: str | None) -> DiagnosisError:
    return DiagnosisError(f'{name}: {why}; {_EXPECTED}')


def _refuse(word: str) -> NoReturn:
    raise ValueError(f'{word} is no number')


def _object(make: Callable[..., Any] = dict, /, **kinds: Kind) -> Kind:
    """Expect names with values, of which is made what is read; others are passed over."""
    keys = {name: Key(kind, 'of the result', MISSING) for name, kind in kinds.items()}
    expectation = 'names with values'

    def read(value: object, path: str, problems: Problems) -> Any:
        if not isinstance(value, dict):
            problems.append(f'{path or "the document"}: {show(value)}, expected {expectation}')
            return INVALID
        before = len(problems)
        given = {name: value[name] for name in keys if name in value}
        found = read_keys(keys, given, path, problems)
        return INVALID if len(problems) > before else make(**found)

    return Kind(read, expectation)


def _or_null(kind: Kind, instead: Any) -> Kind:
    """Expect a kind, or null for what is not known."""

    def read(value: object, path: str, problems: Problems) -> Any:
        return instead if value is None else kind.read(value, path, problems)

    return Kind(read, kind.expectation)


def _read_line(value: object, path: str, problems: Problems) -> Any:
    if isinstance(value, str) and value.isprintable():
        return value
    problems.append(f'{path}: {show(value)}, expected a line of text')
    return INVALID


def _read_name(value: object, path: str, problems: Problems) -> Any:
    try:
        return find(str(value)).name
    except SimulationError:
        problems.append(f'{path}: {show(value)} is no effect that this version knows')
        return INVALID


def _read_effect(value: object, path: str, problems: Problems) -> Any:
    """Return name and sizes; what is of its day says nothing today, and may lack them."""
    found = _object(name=_NAME).read(value, path, problems)
    if found is INVALID:
        return INVALID
    effect = find(found['name'])
    sizes = {q.name: _SIZE for q in effect.parameters} if effect.lasts_s > 0.0 else {}
    given = _object(parameters=_object(**sizes)).read(value, path, problems)
    return INVALID if given is INVALID else (effect.name, given['parameters'])


_many = partial(list_of, maximum=_MOST)
_LINE, _NAME = Kind(_read_line, 'a line of text'), Kind(_read_name, 'the name of an effect')
_SIZE = _object(Parameter, value=number(-1e12, 1e12), sd=_or_null(number(0.0, 1e12), math.nan))
_RUNS = _many(
    _object(
        lambda bag, time_ns: SeenRun(bag, time_ns),
        bag=_LINE,
        time_ns=whole_number(0, _LATEST_NS, 'ns since the epoch'),
    )
)
_CANDIDATE = _object(
    probability=number(0.0, 1.0),
    names=_many(_LINE),
    effects=_many(Kind(_read_effect, 'name and parameters')),
)
_DOCUMENT = _object(
    runs=_RUNS,
    ship=_or_null(
        _object(name=_LINE, length_m=number(1e-3, 1e4), effects=_many(_NAME)),
        {'name': '', 'length_m': None, 'effects': ()},
    ),
    earlier=_many(_object(runs=_RUNS, used=flag())),
    candidates=_many(_CANDIDATE),
)


def _diagnosis(read: Any, name: str) -> EarlierDiagnosis:
    problems: Problems = []
    given = {'ship': None, **read} if isinstance(read, dict) else read
    found = _DOCUMENT.read(given, '', problems)
    if problems:
        raise _wrong(name, problems[0])
    if not found['runs']:
        raise _wrong(name, 'runs: empty, and when it was made is not known')
    if given.get('question'):
        asked = f'{show(given["question"])}; diagnose its runs again'
        raise _wrong(name, f'question: its verdict waits for the answer: {asked}')
    of_force, ship = given.get('baseline') == 'stated', found['ship']
    return EarlierDiagnosis(
        name,
        ship['name'],
        ship['length_m'],
        found['runs'],
        tuple(run for each in found['earlier'] if each['used'] for run in each['runs']),
        _candidates(found['candidates'], name, all_sized=of_force),
        of_force,
        ship['effects'],
    )


def _candidates(
    listed: Sequence[Mapping[str, Any]], name: str, *, all_sized: bool
) -> tuple[EarlierCandidate, ...]:
    found = []
    for i, each in enumerate(listed):
        names = each['names']
        sizes = dict(each['effects'])
        if names == (_UNKNOWN,):
            continue
        named = set() if names == (_NOTHING,) else set(names)
        # without a baseline, an effect that could not be seen has no size
        if not names or ((sizes or all_sized) and named != set(sizes)):
            why = f'candidates[{i}]: the names are {show(list(names))}, and the effects others'
            raise _wrong(name, why)
        found.append(EarlierCandidate(each['probability'], sizes))
    total = math.fsum(each.probability for each in found)
    if not listed or total > 1.0 + 1e-6:
        raise _wrong(name, f'candidates: {len(listed)} of probability {total:g} in all')
    return tuple(found)
