# SPDX-License-Identifier: Apache-2.0
"""
YAML without its traps, for files written by hand.

PyYAML keeps the last of two equal keys, reads `1e-6` as text and `010` as 8.
Here scalars follow the core schema of YAML 1.2 and a repeated key is reported.
"""

from __future__ import annotations

import re
from collections.abc import Hashable
from typing import Any

import yaml

_CORE_SCALARS = (
    ('null', r'~|null|Null|NULL|', '~nN\0'),
    ('bool', r'true|True|TRUE|false|False|FALSE', 'tTfF'),
    ('int', r'[-+]?(?:0|[1-9][0-9]*)', '-+0123456789'),
    (
        'float',
        r'[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?'
        r'|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)',
        '-+.0123456789',
    ),
)
_KINDS = ('null', 'bool', 'int', 'float', 'str', 'seq', 'map')


class _Loader(yaml.SafeLoader):
    """Core schema; remembers repeated keys."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012
    # plain data alone: a date or a set is not expected anywhere
    yaml_constructors = {  # noqa: RUF012
        tag: constructor
        for tag, constructor in yaml.SafeLoader.yaml_constructors.items()
        if tag is None or tag.removeprefix('tag:yaml.org,2002:') in _KINDS
    }

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.repeated: list[str] = []

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: dict[str, int] = {}
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                continue
            line = key_node.start_mark.line + 1
            if key_node.value in seen:
                first = seen[key_node.value]
                self.repeated.append(
                    f'{key_node.value}: given twice, lines {first} and {line}; keep one'
                )
            seen[key_node.value] = line
        return super().construct_mapping(node, deep=deep)


class _Dumper(yaml.SafeDumper):
    """Quotes what `_Loader` would not read back as text."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_text(self, data: str) -> yaml.ScalarNode:
        # PyYAML loses rare line breaks in other styles
        style = None if data.isprintable() else '"'
        return self.represent_scalar('tag:yaml.org,2002:str', data, style=style)


_Dumper.add_representer(str, _Dumper.represent_text)

for _kind, _pattern, _first in _CORE_SCALARS:
    for _class in (_Loader, _Dumper):
        _class.add_implicit_resolver(
            f'tag:yaml.org,2002:{_kind}',
            re.compile(f'^(?:{_pattern})$'),
            [character.replace('\0', '') for character in _first],
        )


def load(text: str) -> tuple[Any, list[str]]:
    """
    Read one document.

    Returns
    -------
    data
        Plain Python data.
    problems
        One line for each repeated key.

    Raises
    ------
    ValueError
        If the text is not YAML.
    """
    try:
        loader = _Loader(text)
        data = loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = f'line {mark.line + 1}, column {mark.column + 1}: ' if mark else ''
        raise ValueError(f'{place}{error.problem}') from error
    except (yaml.YAMLError, KeyError, RecursionError) as error:
        # the parser knows KeyError and RecursionError for `!!bool maybe` and `[[[[...`
        raise ValueError(str(error)) from error
    return data, loader.repeated


def dump(data: Any) -> str:
    """
    Return the text that `load` reads back, in the order of the keys.
    """
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True)
