# SPDX-License-Identifier: Apache-2.0
"""
The one way to check a mapping: keys, each with what it may hold.

Ship files, parameters and the node's settings are read here. A section is a
dataclass whose fields are declared with a reader; reading a mapping collects
every problem in it, with its dotted path, before giving up. Their files are read so that no
pipe, device or endless file can hang or fill the reader.
"""

from __future__ import annotations

import difflib
import math
import os
import re
import reprlib
import stat
from array import array
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from functools import cache
from inspect import cleandoc
from os import PathLike
from types import MappingProxyType
from typing import Any

import numpy as np

from shipdrag_ros import strict_yaml
from shipdrag_ros.errors import ProblemsError


def read_small_text(path: str | PathLike[str], *, most_bytes: int) -> str:
    """
    Return the text of a regular file.

    Parameters
    ----------
    path
        The file; a link to one is followed.
    most_bytes
        Largest file that is read [bytes].

    Raises
    ------
    OSError
        If it is no regular file, too large, or cannot be read; `strerror` says why.
    ValueError
        If it is not UTF-8.
    """
    # a pipe without a writer would wait for ever without O_NONBLOCK
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(descriptor, 'rb') as file:
        about = os.fstat(descriptor)
        if stat.S_ISDIR(about.st_mode):
            raise IsADirectoryError(0, 'Is a directory')
        if not stat.S_ISREG(about.st_mode):
            raise OSError(0, 'no regular file')
        # one more than allowed: files of /proc say 0 and go on
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(0, f'more than {most_bytes} bytes, too many')
    return content.decode('utf-8-sig')


Problems = list[str]
Reader = Callable[[object, str, Problems], Any]

_ATTRIBUTE = re.compile(r'^(\w+)\n((?: +.+\n)+)', re.MULTILINE)
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60
_SHORT.maxlevel = 2  # lists that hold themselves would fill pages


class _Invalid:
    """What a reader returns for a value it has reported."""


INVALID = _Invalid()


def unexpected(value: object, path: str, problems: Problems, expectation: str) -> _Invalid:
    """
    Report a value that is not as expected.
    """
    problems.append(f'{path}: {show(value)}, expected {expectation}')
    return INVALID


@dataclass(frozen=True)
class Kind:
    """
    A reader and what it expects.

    Attributes
    ----------
    read
        From value, path and the list that problems are added to.
    expectation
        In words.
    unit, low, high
        Of numbers; '' for a pure one.
    choices
        Of words.
    """

    read: Reader
    expectation: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class Key:
    """
    A key of a mapping.

    Attributes
    ----------
    kind
    text
        What it means.
    default
        Where it is not given; MISSING: it must be.
    """

    kind: Kind
    text: str
    default: Any = MISSING


def declare(kind: Kind, text: str = '', *, default: Any = MISSING, hashed: bool = True) -> Any:
    """
    Declare a dataclass field that is read from a mapping.

    What it means may stand in the docstring of the dataclass instead, under `Attributes`.
    """
    metadata = {'key': Key(kind, text, default)}
    hash_ = None if hashed else False
    if default == {}:
        return field(default_factory=dict, metadata=metadata, hash=hash_)
    return field(default=default, metadata=metadata, hash=hash_)


def keys_of(cls: type[Any]) -> dict[str, Key]:
    """
    Return the declared fields of a dataclass, by name.
    """
    declared = {item.name: item.metadata['key'] for item in fields(cls) if 'key' in item.metadata}
    if all(key.text for key in declared.values()):
        return declared
    texts = _attributes(cls.__doc__ or '')  # python -OO drops it
    return {
        name: key if key.text else replace(key, text=texts.get(name, ''))
        for name, key in declared.items()
    }


@cache
def _attributes(doc: str) -> dict[str, str]:
    """Return what a docstring says of attributes, by name."""
    return {name: ' '.join(text.split()) for name, text in _ATTRIBUTE.findall(cleandoc(doc))}


def number(low: float, high: float, unit: str = '') -> Kind:
    """
    Expect a finite number in low..high.
    """
    expectation = f'{low:g}..{high:g} {unit}'.rstrip()

    def read(value: object, path: str, problems: Problems) -> float | _Invalid:
        if isinstance(value, bool) or not isinstance(
            value, int | float | np.integer | np.floating
        ):
            hint = ' without quotes or unit' if isinstance(value, str) else ''
            return unexpected(value, path, problems, f'a number{hint}, {expectation}')
        # an integer may be too large for a float; comparing it is safe
        if not (low <= value <= high):
            return unexpected(value, path, problems, expectation)
        return float(value)

    return Kind(read, expectation, unit, low, high)


def whole_number(low: int, high: int, unit: str = '') -> Kind:
    """
    Expect a whole number in low..high.
    """
    return _plain_value(
        lambda value: type(value) is int and low <= value <= high,
        f'a whole number, {low:g}..{high:g} {unit}'.rstrip(),
        *(unit, low, high),
    )


def flag() -> Kind:
    """
    Expect true or false.
    """
    return _plain_value(lambda value: isinstance(value, bool), 'true or false')


def _plain_value(accepts: Callable[[Any], bool], expectation: str, *about: Any) -> Kind:
    """Expect a value that is taken as it is; `about` it as in `Kind`."""

    def read(value: object, path: str, problems: Problems) -> Any:
        return value if accepts(value) else unexpected(value, path, problems, expectation)

    return Kind(read, expectation, *about)


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
        if not isinstance(value, list | tuple | array) or len(value) < minimum:
            return unexpected(value, path, problems, expectation)
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
    told = 'text; put it in quotes'
    return replace(_plain_value(lambda value: isinstance(value, str), told), expectation='text')


def choice(*values: str, former: Mapping[str, str] = MappingProxyType({})) -> Kind:
    """
    Expect one of some words; the error of a former one names its successor.
    """
    expectation = f'one of {", ".join(value for value in values if value)}'

    def read(value: object, path: str, problems: Problems) -> str | _Invalid:
        if isinstance(value, str) and value in values:
            return value
        known = former.get(value) if isinstance(value, str) else None
        now = '' if known is None else f'which is {known!r} now; '
        problems.append(f'{path}: {show(value)}, {now}expected {expectation}')
        return INVALID

    return Kind(read, expectation, choices=values)


def section(cls: type[Any], *, required: Collection[str] = ()) -> Kind:
    """
    Expect the keys of a dataclass; those required even where it has a default.
    """
    keys = {
        name: replace(key, default=MISSING) if name in required else key
        for name, key in keys_of(cls).items()
    }
    expectation = f'the keys {", ".join(keys)}'

    def read(value: object, path: str, problems: Problems) -> Any:
        before = len(problems)
        accepted = read_keys(keys, value, path, problems)
        return INVALID if len(problems) > before else cls(**accepted)

    return Kind(read, expectation)


def list_of(kind: Kind, *, minimum: int = 0, maximum: float = math.inf) -> Kind:
    """
    Expect a list of one kind.
    """
    most = f' of at most {maximum}' if maximum < math.inf else ''
    expectation = f'a list{most}, each with {kind.expectation}'

    def read(value: object, path: str, problems: Problems) -> tuple[Any, ...] | _Invalid:
        if not isinstance(value, list) or not minimum <= len(value) <= maximum:
            return unexpected(value, path, problems, expectation)
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
            return unexpected(value, path, problems, expectation)
        items = {
            name: kind.read(item, dotted(path, name), problems) for name, item in value.items()
        }
        return INVALID if any(item is INVALID for item in items.values()) else items

    return Kind(read, expectation)


def read_keys(
    known: Mapping[str, Key],
    value: object,
    path: str,
    problems: Problems,
    *,
    former: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Any]:
    """
    Check a mapping against the keys that are known; return what is given and valid.

    Parameters
    ----------
    known
        All keys, by name.
    value
        What should be a mapping.
    path
        Of the mapping in its file, '' for the file itself.
    problems
        Each finding is added, with the key it is about.
    former
        Keys of earlier versions, and what replaces each.

    Returns
    -------
    dict
        What is not given is left out, default or not.
    """
    if not isinstance(value, dict):
        found = 'empty' if value is None else show(value)
        problems.append(f'{path or "the file"}: {found}, expected the keys {", ".join(known)}')
        return {}
    for key in value:
        if key in former:
            problems.append(f'{dotted(path, str(key))}: no key any more; {former[key]}')
        elif key not in known:
            near = difflib.get_close_matches(str(key), known, n=1)
            hint = f'did you mean {near[0]}?' if near else f'known are {", ".join(known)}'
            problems.append(f'{dotted(path, str(key))}: unknown key; {hint}')
    accepted = {}
    for name, key in known.items():
        if name in value:
            result = key.kind.read(value[name], dotted(path, name), problems)
            if result is not INVALID:
                accepted[name] = result
        elif key.default is MISSING:
            problems.append(
                f'{dotted(path, name)}: missing, expected {key.kind.expectation} ({key.text})'
            )
    return accepted


def parse(text: str, *, subject: str, error: type[ProblemsError]) -> Any:
    """
    Return the data of a YAML text.

    Raises
    ------
    ProblemsError
        Of the kind given, if it cannot be read.
    """
    try:
        return strict_yaml.load(text)
    except ValueError as wrong:
        raise error(subject, [str(wrong)]) from wrong


def text_of(path: str | PathLike[str], *, what: str, error: type[ProblemsError]) -> str:
    """
    Return the text of a file that a user has written.

    Parameters
    ----------
    path
    what
        It should be, for the message.
    error
        To be raised.

    Raises
    ------
    ProblemsError
        Of the kind given, if it is no regular file of text, or too large.
    """
    try:
        return read_small_text(path, most_bytes=strict_yaml.LARGEST)
    except OSError as wrong:
        problem = f'cannot be read: {wrong.strerror or wrong}; give the path of {what}'
        raise error(str(path), [problem]) from wrong
    except ValueError as wrong:
        raise error(str(path), [f'is not a text file: {wrong}; save it as UTF-8']) from wrong


def plain(value: Any) -> Any:
    """
    Return a section as the mapping it is read from; what is None is left out.
    """
    if is_dataclass(value):
        return {
            name: plain(getattr(value, name))
            for name in keys_of(type(value)) or [item.name for item in fields(value)]
            if getattr(value, name) is not None
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
    return _SHORT.repr(value.tolist() if isinstance(value, array) else value)
