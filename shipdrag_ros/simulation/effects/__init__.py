# SPDX-License-Identifier: Apache-2.0
"""
The library of effects: declared in `data/effects.yaml`, or a module in this folder.

A new effect is an entry of that file, or where no formula of a term holds it a new module with an
`EFFECT`, of which all but what it does may stand in `data/effects_of_modules.yaml`; simulation,
command line, diagnosis and documentation find it here. A package installed beside this one adds
an effect of its own by an entry point of the group `shipdrag.effects`, `NAME = PACKAGE:EFFECT`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, lru_cache
from importlib import resources
from itertools import combinations

from shipdrag_ros.errors import EffectFileError, SimulationError
from shipdrag_ros.imports import load, points
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import LearntTerm, Ship, StatedEffect
from shipdrag_ros.ship.term import check_name
from shipdrag_ros.simulation.declared import effect_of, effects_in
from shipdrag_ros.simulation.effect import Action, Effect, Frame, Measure

GROUP = 'shipdrag.effects'


@cache
def _every() -> dict[str, Effect]:
    own = effects_in(resources.files('shipdrag_ros') / 'data' / 'effects.yaml')
    every = {effect.name: effect for effect in own}
    modules = points(GROUP, 'EFFECT', 'simulation/effects/[!_]*.py')
    every |= {name: effect for name, (_, effect) in load(modules, Effect, taken=every).items()}
    return dict(sorted(every.items()))


class _Library(Mapping[str, Effect]):
    """Read when it is first used, as a module of another package may import much of this one."""

    def __getitem__(self, name: str) -> Effect:
        return _every()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_every())

    def __len__(self) -> int:
        return len(_every())


LIBRARY: Mapping[str, Effect] = _Library()

_TERMS: dict[str, LearntTerm] = {}  # that this process has seen, by name
_effect_of = lru_cache(256)(effect_of)


def declared(term: LearntTerm) -> Effect:
    """
    Return a learnt term as an effect; of two terms of one name, `find` knows the later.

    Raises
    ------
    EffectFileError
        If it may not be called so.
    """
    check_name(term.name)
    _TERMS[term.name] = term
    return _effect_of(term)


@contextmanager
def using(terms: Sequence[LearntTerm]) -> Iterator[None]:
    """
    Have learnt terms in the library of this process, for a while.

    Raises
    ------
    EffectFileError
        If a name is taken.

    Examples
    --------
    >>> from shipdrag_ros.simulation.effects import using
    >>> with using([]):
    ...     pass
    """
    effects = {term.name: declared(term) for term in terms}
    if known := [name for name in effects if name in LIBRARY]:
        raise EffectFileError(known[0], ['name: there is an effect of this name; give another'])
    _every().update(effects)
    try:
        yield
    finally:
        for name in effects:
            del _every()[name]


def effects_of(ship: Ship) -> Mapping[str, Effect]:
    """
    Return the effects that a ship may have: the library, and the terms of her file.
    """
    learnt = {term.name: declared(term) for term in ship.learnt}
    return {**LIBRARY, **learnt} if learnt else LIBRARY


def terms(names: Collection[str] | None = None) -> tuple[LearntTerm, ...]:
    """
    Return the learnt terms among some effects; of None, those added to the library.
    """
    return tuple(_TERMS[name] for name in (LIBRARY if names is None else names) if name in _TERMS)


def carrying(ship: Ship, more: Sequence[LearntTerm] | None = None) -> Ship:
    """
    Return a ship whose file holds more learnt terms; None: those added to the library.
    """
    own = {term.name for term in ship.learnt}
    wanted = [term for term in (terms() if more is None else more) if term.name not in own]
    return replace(ship, learnt=(*ship.learnt, *wanted)) if wanted else ship


def find(name: str) -> Effect:
    """
    Return an effect by its name: of the library, or a learnt term that this process has seen.

    Raises
    ------
    SimulationError
        If there is none; the message lists what is known.
    """
    if name in LIBRARY:
        return LIBRARY[name]
    if name in _TERMS:
        return declared(_TERMS[name])
    raise SimulationError(f'effect {name!r} is not known; known are {", ".join(LIBRARY)}')


def confounders(name: str) -> tuple[str, ...]:
    """
    Return the effects that leave nearly the same trace.

    It is enough that one of two declares it.
    """
    declared_by = (other.name for other in LIBRARY.values() if name in other.confounders)
    return tuple(sorted({*find(name).confounders, *declared_by}))


def discriminating_measurements(one: str, other: str) -> tuple[Measure, ...]:
    """
    Return what separates two confounders; nothing: no record can.
    """
    both = (*find(one).confounders.get(other, ()), *find(other).confounders.get(one, ()))
    return tuple(dict.fromkeys(both))


def inseparable(
    effects: Sequence[Effect], *, measured: Collection[Measure] = tuple(Measure)
) -> tuple[frozenset[str], ...]:
    """
    Return pairs of confounders that some measurements do not separate.

    Parameters
    ----------
    effects
        That may be missing.
    measured
        What is measured; by default all that can be.

    Returns
    -------
    tuple of frozenset
        Pairs of names.
    """
    return tuple(
        frozenset((one.name, other.name))
        for one, other in combinations(effects, 2)
        if other.name in confounders(one.name)
        and not set(measured) & set(discriminating_measurements(one.name, other.name))
    )


def parse(text: str) -> StatedEffect:
    """
    Read `NAME=VALUE[,param=VALUE]...`, exactly known.

    Raises
    ------
    SimulationError
        If it cannot be read; whether a value is possible depends on the ship
        and is described by `action_of`.
    """
    name, separator, rest = text.partition('=')
    effect = find(name.strip())
    form = ','.join(f'{parameter.name}=VALUE' for parameter in effect.parameters[1:])
    usage = f'write {effect.name}=VALUE' + (f'[,{form}]' if form else '')
    if not separator:
        raise SimulationError(f'effect {text!r} has no value; {usage}')
    first, *others = rest.split(',')
    given = [(effect.parameters[0].name, first)]
    given += [(key.strip(), value) for key, _, value in (item.partition('=') for item in others)]
    known = {parameter.name: parameter for parameter in effect.parameters}
    values: dict[str, Parameter] = {}
    for key, word in given:
        if key not in known or key in values:
            what = 'is given twice' if key in values else 'is not known'
            raise SimulationError(f'effect {text!r}: parameter {key!r} {what}; {usage}')
        word = word.strip()
        try:
            value = known[key].words[word] if word in known[key].words else float(word)
        except ValueError as error:
            expected = f'{" or ".join(known[key].words) or "a number"} ({known[key].meaning})'
            raise SimulationError(
                f'effect {text!r}: {key} is {word!r}, expected {expected}'
            ) from error
        values[key] = Parameter(value, 0.0)
    return StatedEffect(effect.name, values)


def action_of(frame: Frame, stated: Sequence[StatedEffect]) -> Action:
    """
    Return what effects do together.

    Raises
    ------
    SimulationError
        Naming every effect and parameter that cannot be simulated.
    """
    total, known = Action(), effects_of(frame.ship)
    names = Counter(effect.name for effect in stated)
    problems = [
        f'{name} is given {count} times, expected once'
        for name, count in names.items()
        if count > 1
    ]
    problems += [
        f'{one.name} and {other.name} cannot be there at the same time'
        for one, other in combinations([known[name] for name in names if name in known], 2)
        if not one.goes_with(other)
    ]
    for item in stated:
        wrong = [*_problems(item, frame)]
        problems += wrong
        if not wrong:
            total += known[item.name].action(frame, *values_of(item, frame.ship).values())
    if total.mass_fraction <= -1.0 or 1.0 + float(frame.ship.n_r(0.0)) + total.n_r_change <= 0.0:
        problems.append(f'{", ".join(names)} leave the ship without inertia')
    if problems:
        raise SimulationError('effects: ' + '; '.join(problems))
    return total


def checked(ship: Ship) -> Ship:
    """
    Return a ship of whose effects all are known.

    Raises
    ------
    SimulationError
        Naming an effect or a parameter that is not.
    """
    if wrong := [text for stated in ship.effects for text in _not_known(stated, ship)]:
        raise SimulationError(f'effects: {"; ".join(wrong)}')
    return ship


def _not_known(stated: StatedEffect, ship: Ship) -> Iterator[str]:
    """Say which effect, or which of its parameters, no effect of a ship has."""
    effects = effects_of(ship)
    if stated.name not in effects:
        yield f'{stated.name!r} is not known; known are {", ".join(effects)}'
        return
    names = [parameter.name for parameter in effects[stated.name].parameters_of(ship)]
    for key in stated.parameters:
        if key not in names:
            yield f'{stated.name}: parameter {key!r} is not known; known are {", ".join(names)}'


def _problems(stated: StatedEffect, frame: Frame) -> Iterator[str]:
    effect = effects_of(frame.ship).get(stated.name)
    if effect is not None and (missing := effect.missing(frame.ship)):
        yield f'{effect.name} needs {", ".join(missing)} in the ship file'
        return
    yield from _not_known(stated, frame.ship)
    if effect is None:
        return
    for parameter in effect.parameters_of(frame.ship):
        given, place = stated.parameters.get(parameter.name), f'{effect.name}: {parameter.name}'
        if given is None and not parameter.is_given:
            yield f'{place} is missing, expected {parameter.expectation}'
        elif given is not None and not parameter.accepts(given.value):
            yield f'{place} is {given.value!r}, expected {parameter.expectation}'


def values_of(stated: StatedEffect, ship: Ship) -> dict[str, float]:
    """
    Return all parameters of an effect that was checked, defaults included.
    """
    parameters = effects_of(ship)[stated.name].parameters_of(ship)
    return {each.name: stated.parameters.get(each.name, each).value for each in parameters}
