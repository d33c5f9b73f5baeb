# SPDX-License-Identifier: Apache-2.0
"""
Fields of a ship file, each with what it may hold.

A section is a dataclass whose fields are declared with a reader; reading a
mapping collects every problem in it, with its dotted path, before giving up.
"""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Any

Problems = list[str]
Reader = Callable[[object, str, Problems], Any]

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60
_SHORT.maxlevel = 2  # lists that hold themselves would fill pages


class _Invalid:
    """What a reader returns for a value it has reported."""


INVALID = _Invalid()


@dataclass(frozen=True)
class Kind:
    """A reader and what it expects, in words."""

    read: Reader
    expectation: str


def declare(kind: Kind, text: str, *, default: Any = MISSING, hashed: bool = True) -> Any:
    """
    Declare a dataclass field of a ship file.
    """
    metadata = {'kind': kind, 'text': text}
    return field(default=default, metadata=metadata, hash=None if hashed else False)


def number(low: float, high: float, unit: str = '') -> Kind:
    """
    Expect a finite number in low..high.
    """
    expectation = f'{low:g}..{high:g} {unit}'.rstrip()

    def read(value: object, path: str, problems: Problems) -> float | _Invalid:
        if isinstance(value, bool) or not isinstance(value, int | float):
            hint = ' without quotes or unit' if isinstance(value, str) else ''
            problems.append(f'{path}: {show(value)}, expected a number{hint}, {expectation}')
            return INVALID
        # an integer may be too large for a float; comparing it is safe
        if not (low <= value <= high):
            problems.append(f'{path}: {show(value)}, expected {expectation}')
            return INVALID
        return float(value)

    return Kind(read, expectation)


def numbers(
    low: float, high: float, unit: str = '', *, ascending: bool = False, minimum: int = 2
) -> Kind:
    """
    Expect a list of finite numbers in low..high.
    """
    one = number(low, high, unit)
    order = 'ascending ' if ascending else ''
    expectation = f'a list of {minimum} or more {order}numbers, {one.expectation}'

    def read(value: object, path: str, problems: Problems) -> tuple[float, ...] | _Invalid:
        if not isinstance(value, list) or len(value) < minimum:
            problems.append(f'{path}: {show(value)}, expected {expectation}')
            return INVALID
        row = [one.read(item, f'{path}[{i}]', problems) for i, item in enumerate(value)]
        if any(item is INVALID for item in row):
            return INVALID
        for i in range(1, len(row)):
            if ascending and not row[i] > row[i - 1]:
                problems.append(
                    f'{path}[{i}]: {row[i]!r} after {row[i - 1]!r}, expected ascending values'
                )
                return INVALID
        return tuple(row)

    return Kind(read, expectation)


def text() -> Kind:
    """
    Expect a string.
    """

    def read(value: object, path: str, problems: Problems) -> str | _Invalid:
        if isinstance(value, str):
            return value
        problems.append(f'{path}: {show(value)}, expected text; put it in quotes')
        return INVALID

    return Kind(read, 'text')


def choice(*values: str) -> Kind:
    """
    Expect one of some words.
    """
    expectation = f'one of {", ".join(values)}'

    def read(value: object, path: str, problems: Problems) -> str | _Invalid:
        if isinstance(value, str) and value in values:
            return value
        problems.append(f'{path}: {show(value)}, expected {expectation}')
        return INVALID

    return Kind(read, expectation)


def section(cls: type[Any]) -> Kind:
    """
    Expect the keys of a dataclass.
    """
    expectation = f'the keys {", ".join(item.name for item in fields(cls))}'

    def read(value: object, path: str, problems: Problems) -> Any:
        before = len(problems)
        accepted = read_keys(cls, value, path, problems)
        return INVALID if len(problems) > before else cls(**accepted)

    return Kind(read, expectation)


def list_of(kind: Kind, *, minimum: int = 0) -> Kind:
    """
    Expect a list of one kind.
    """
    expectation = f'a list, each with {kind.expectation}'

    def read(value: object, path: str, problems: Problems) -> tuple[Any, ...] | _Invalid:
        if not isinstance(value, list) or len(value) < minimum:
            problems.append(f'{path}: {show(value)}, expected {expectation}')
            return INVALID
        items = tuple(kind.read(item, f'{path}[{i}]', problems) for i, item in enumerate(value))
        return INVALID if any(item is INVALID for item in items) else items

    return Kind(read, expectation)


def named(kind: Kind) -> Kind:
    """
    Expect names, each with one kind.
    """
    expectation = f'names, each with {kind.expectation}'

    def read(value: object, path: str, problems: Problems) -> dict[str, Any] | _Invalid:
        if not isinstance(value, dict) or not all(isinstance(name, str) for name in value):
            problems.append(f'{path}: {show(value)}, expected {expectation}')
            return INVALID
        items = {
            name: kind.read(item, dotted(path, name), problems) for name, item in value.items()
        }
        return INVALID if any(item is INVALID for item in items.values()) else items

    return Kind(read, expectation)


def read_keys(cls: type[Any], value: object, path: str, problems: Problems) -> dict[str, Any]:
    """
    Read the fields of a dataclass; return those that are valid.
    """
    known = {item.name: item for item in fields(cls)}
    if not isinstance(value, dict):
        found = 'empty' if value is None else show(value)
        problems.append(f'{path or "the file"}: {found}, expected the keys {", ".join(known)}')
        return {}
    for key in value:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, n=1)
            hint = f'did you mean {near[0]}?' if near else f'known are {", ".join(known)}'
            problems.append(f'{dotted(path, str(key))}: unknown key; {hint}')
    accepted = {}
    for name, item in known.items():
        kind: Kind = item.metadata['kind']
        if name in value:
            result = kind.read(value[name], dotted(path, name), problems)
            if result is not INVALID:
                accepted[name] = result
        elif item.default is MISSING:
            problems.append(
                f'{dotted(path, name)}: missing, expected {kind.expectation} '
                f'({item.metadata["text"]})'
            )
    return accepted


def plain(value: Any) -> Any:
    """
    Return a section as the mapping it is read from; what is None is left out.
    """
    if is_dataclass(value):
        return {
            item.name: plain(getattr(value, item.name))
            for item in fields(value)
            if getattr(value, item.name) is not None
        }
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    return value


def dotted(path: str, name: str) -> str:
    """
    Join a path and a key.
    """
    return f'{path}.{name}' if path else name


def show(value: object) -> str:
    """
    Return a value for a message, however large it is.
    """
    return _SHORT.repr(value)
