# SPDX-License-Identifier: Apache-2.0
"""Earlier diagnoses read from the JSON that `shipdrag diagnose` wrote of them."""

from __future__ import annotations

import json
import math
from os import PathLike
from typing import Any, NoReturn

from shipdrag_ros.diagnosis.earlier import EarlierCandidate, EarlierDiagnosis
from shipdrag_ros.diagnosis.result import SeenRun
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.plain_file import read_small_text
from shipdrag_ros.simulation.effects import LIBRARY

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
        for quantity in LIBRARY[name].parameters:
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
    if not isinstance(value, str) or value not in LIBRARY:
        raise _Wrong(f'{path}: {_shown(value)} is no effect that this version knows')
    return value


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
