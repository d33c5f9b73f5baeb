# SPDX-License-Identifier: Apache-2.0
"""
YAML without its traps, for files written by hand: a door over ruamel.yaml.

YAML 1.2, core schema: `no`, `on`, `1:30` and `2026-06-01` are text, `010` is 10,
`1e-6` is a number. Plain data alone: keys that repeat, aliases, tags, more than
`DEEPEST` levels and more than `LARGEST` bytes are refused, with their line.
"""

from __future__ import annotations

import re
from io import StringIO
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    CollectionEndEvent,
    DocumentStartEvent,
    MappingStartEvent,
    NodeEvent,
    ScalarEvent,
    SequenceStartEvent,
)
from ruamel.yaml.representer import SafeRepresenter

LARGEST = 1_000_000
"""Bytes of a text that is read."""
DEEPEST = 20
"""Levels of lists and mappings."""

_WORDS = {'': None, '~': None, 'null': None, 'true': True, 'false': False}
_WHOLE = re.compile(r'[-+]?[0-9]+')
_NUMBER = re.compile(r'[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?')
_NO_NUMBER = re.compile(r'[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)')
_MOST_DIGITS = 400  # of a whole number; any float is shorter


class _Mapping(dict[Any, Any]):
    """A mapping on its way: lines of its keys, and the key that waits for a value."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: dict[Any, int] = {}
        self.key: list[Any] = []


def load(text: str) -> Any:
    """
    Read one document as plain Python data.

    Parameters
    ----------
    text
        Of at most `LARGEST` bytes.

    Returns
    -------
    object
        None, bool, int, float, str, list and dict.

    Raises
    ------
    ValueError
        If it is not YAML, or more than plain data; with the line.

    Examples
    --------
    >>> from shipdrag_ros import strict_yaml
    >>> strict_yaml.load('name: no\\nwater: {kinematic_viscosity_m2_s: 1e-6}')
    {'name': 'no', 'water': {'kinematic_viscosity_m2_s': 1e-06}}
    """
    if len(text) > LARGEST:
        raise ValueError(f'{len(text)} characters, at most {LARGEST} are read')
    try:
        return _built(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark
        place = f'line {mark.line + 1}, column {mark.column + 1}: ' if mark else ''
        raise ValueError(f'not YAML: {place}{error.problem}') from error
    except YAMLError as error:
        raise ValueError(f'not YAML: {error}') from error


def _built(text: str) -> Any:
    """Put the events of a text together; a loop, so that no depth can exhaust the stack."""
    whole: list[Any] = []  # holds the document
    stack: list[Any] = [whole]
    repeated: list[str] = []
    documents = 0
    for event in YAML(typ='safe', pure=True).parse(text):
        if isinstance(event, DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise ValueError(f'line {_line(event)}: a second document; give one')
        elif isinstance(event, CollectionEndEvent):
            done = stack.pop()
            _put(stack[-1], dict(done) if isinstance(done, _Mapping) else done, event, repeated)
        elif isinstance(event, NodeEvent):
            _refuse(event, len(stack))
            if isinstance(event, MappingStartEvent):
                stack.append(_Mapping())
            elif isinstance(event, SequenceStartEvent):
                stack.append([])
            elif isinstance(event, ScalarEvent):
                plain = event.implicit[0]
                _put(stack[-1], _scalar(event) if plain else event.value, event, repeated)
    if repeated:
        raise ValueError('; '.join(repeated))
    return whole[0] if whole else None


def _refuse(event: NodeEvent, depth: int) -> None:
    """Refuse what is no plain data."""
    if isinstance(event, AliasEvent) or event.anchor is not None:
        raise ValueError(f'line {_line(event)}: an anchor or alias ({event.anchor}); write it out')
    tag = getattr(event, 'tag', None)
    if tag is not None:
        raise ValueError(f'line {_line(event)}: a tag ({tag}); leave it out')
    if depth > DEEPEST and not isinstance(event, ScalarEvent):
        raise ValueError(f'line {_line(event)}: more than {DEEPEST} levels')


def _put(into: Any, value: Any, event: Any, repeated: list[str]) -> None:
    """Add a value to the list or mapping that it stands in; in a mapping keys come first."""
    if not isinstance(into, _Mapping):
        into.append(value)
    elif into.key:
        into[into.key.pop()] = value
    elif isinstance(value, list | dict):
        raise ValueError(f'line {_line(event)}: a list or mapping as a key; give a name')
    else:
        line = _line(event)
        if value in into.lines:
            first = into.lines[value]
            repeated.append(f'{value}: given twice, lines {first} and {line}; keep one')
        into.lines[value] = line
        into.key.append(value)


def _scalar(event: ScalarEvent) -> Any:
    """Return what a plain word stands for."""
    word: str = event.value
    if word.lower() in _WORDS and word in (word.lower(), word.title(), word.upper()):
        return _WORDS[word.lower()]
    if _WHOLE.fullmatch(word):
        if len(word) > _MOST_DIGITS:
            raise ValueError(f'line {_line(event)}: a number of {len(word)} digits')
        return int(word)
    if _NUMBER.fullmatch(word):
        return float(word)
    if _NO_NUMBER.fullmatch(word):
        return float(word.replace('.', ''))
    return word


def _line(event: Any) -> int:
    return int(event.start_mark.line) + 1


class _Representer(SafeRepresenter):
    """Quotes what would not be read back as text."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_text(self, data: str) -> Any:
        # other styles lose rare line breaks
        event = ScalarEvent(None, None, (True, False), data)
        plain = data.isprintable() and isinstance(_scalar(event), str)
        return self.represent_scalar('tag:yaml.org,2002:str', data, style=None if plain else '"')


_Representer.add_representer(str, _Representer.represent_text)
_Representer.add_multi_representer(np.generic, lambda to, each: to.represent_data(each.item()))


def dump(data: Any) -> str:
    """
    Return the text that `load` reads back, in the order of the keys.
    """
    writer = YAML(typ='safe', pure=True)
    writer.Representer = _Representer
    writer.default_flow_style = False
    writer.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    into = StringIO()
    writer.dump(data, into)
    return into.getvalue()
