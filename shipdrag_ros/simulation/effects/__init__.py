# SPDX-License-Identifier: Apache-2.0
"""
The library of effects: every module in this folder is one.

A new effect is a new module with an `EFFECT`; simulation, command line,
diagnosis and documentation find it here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from itertools import combinations
from pkgutil import iter_modules
from types import MappingProxyType

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import Effect, Frame, Measure

__all__ = [
    'LIBRARY',
    'action_of',
    'added',
    'confounders',
    'discriminating_measurements',
    'find',
    'inseparable',
    'parse',
    'values_of',
]


def _found() -> Iterator[Effect]:
    for module in iter_modules(__path__):
        effect = import_module(f'{__name__}.{module.name}').EFFECT
        assert isinstance(effect, Effect)
        yield effect


_EVERY = {effect.name: effect for effect in _found()}
LIBRARY: Mapping[str, Effect] = MappingProxyType(_EVERY)


@contextmanager
def added(effects: Sequence[Effect]) -> Iterator[None]:
    """
    Have more effects in the library of this process, for a while.

    Raises
    ------
    SimulationError
        If a name is taken.
    """
    taken = [effect.name for effect in effects if effect.name in _EVERY]
    if taken:
        raise SimulationError(
            f'effect {taken[0]!r}: the library has one of this name; give it another'
        )
    _EVERY.update({effect.name: effect for effect in effects})
    try:
        yield
    finally:
        for effect in effects:
            del _EVERY[effect.name]


def find(name: str) -> Effect:
    """
    Return an effect by its name.

    Raises
    ------
    SimulationError
        If there is none; the message lists what is known.
    """
    if name not in LIBRARY:
        raise SimulationError(f'effect {name!r} is not known; known are {", ".join(LIBRARY)}')
    return LIBRARY[name]


def confounders(name: str) -> tuple[str, ...]:
    """
    Return the effects that leave nearly the same trace.

    It is enough that one of two declares it.
    """
    declared_by = (other.name for other in LIBRARY.values() if name in other.confounders)
    return tuple(sorted({*LIBRARY[name].confounders, *declared_by}))


def discriminating_measurements(one: str, other: str) -> tuple[Measure, ...]:
    """
    Return what separates two confounders; nothing: no record can.
    """
    declared = (*LIBRARY[one].confounders.get(other, ()), *LIBRARY[other].confounders.get(one, ()))
    return tuple(dict.fromkeys(declared))


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
            raise SimulationError(
                f'effect {text!r}: {key} is {word!r}, expected '
                f'{" or ".join(known[key].words) or "a number"} ({known[key].meaning})'
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
    problems: list[str] = []
    total = Action()
    names = [effect.name for effect in stated]
    for name in dict.fromkeys(names):
        if names.count(name) > 1:
            problems.append(f'{name} is given {names.count(name)} times, expected once')
    for item in stated:
        if item.name not in LIBRARY:
            problems.append(f'{item.name!r} is not known; known are {", ".join(LIBRARY)}')
            continue
        effect = LIBRARY[item.name]
        before = len(problems)
        problems.extend(_problems(effect, item, frame))
        if len(problems) == before:
            total += effect.action(frame, *values_of(item, frame.ship).values())
    if problems:
        raise SimulationError('effects: ' + '; '.join(problems))
    return total


def _problems(effect: Effect, stated: StatedEffect, frame: Frame) -> Iterator[str]:
    missing = effect.missing(frame.ship)
    if missing:
        yield f'{effect.name} needs {", ".join(missing)} in the ship file'
        return
    known = {parameter.name: parameter for parameter in effect.parameters_of(frame.ship)}
    for key in stated.parameters:
        if key not in known:
            yield f'{effect.name}: parameter {key!r} is not known; known are {", ".join(known)}'
    for parameter in known.values():
        given = stated.parameters.get(parameter.name)
        if given is None:
            if not parameter.is_given:
                expected = parameter.expectation
                yield f'{effect.name}: {parameter.name} is missing, expected {expected}'
        elif not parameter.accepts(given.value):
            yield (
                f'{effect.name}: {parameter.name} is {given.value!r}, '
                f'expected {parameter.expectation}'
            )


def values_of(stated: StatedEffect, ship: Ship) -> dict[str, float]:
    """
    Return all parameters of an effect that was checked, defaults included.
    """
    values = {}
    for parameter in find(stated.name).parameters_of(ship):
        given = stated.parameters.get(parameter.name)
        values[parameter.name] = parameter.value if given is None else given.value
    return values
