# SPDX-License-Identifier: Apache-2.0
"""
Settings of the node: its own and those of the monitor and estimator.

Free of ROS, because the parameter file and the documentation are made from the
same list as the node's descriptors. `python -m shipdrag_ros.node.settings`
prints `config/parameters.yaml`.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from shipdrag_ros.bags.durable import PartLimits
from shipdrag_ros.errors import ParameterError, ShipdragError
from shipdrag_ros.fields import (
    Key,
    choice,
    declare,
    flag,
    keys_of,
    number,
    read_keys,
    text,
    whole_number,
)
from shipdrag_ros.messages import TOPICS
from shipdrag_ros.nmea.live import FORMS as NMEA_FORMS
from shipdrag_ros.nmea.live import parse_addresses
from shipdrag_ros.parameters import FORMER_KEYS, Parameters

ParameterValue = bool | int | float | str | list[float]


@dataclass(frozen=True)
class NodeSettings:
    """
    All settings of the node, checked.

    Attributes
    ----------
    types
        Message type fixed by the user, by input; inputs without one are absent.
    """

    ship_file: str = declare(
        text(),
        'path of the ship file (YAML); required, without it the node does not start',
        default='',
    )
    record: bool = declare(
        flag(),
        'record inputs, outputs and events while active; false: a coastdown can be neither '
        'replayed nor diagnosed again',
        default=True,
    )
    output_directory: str = declare(
        text(),
        'where recordings are written; made if missing, nothing there is ever overwritten',
        default='.',
    )
    nmea: str = declare(
        text(),
        f'where NMEA 0183 is received, besides topics: any of {NMEA_FORMS}, separated by blanks; '
        'whoever reaches such an address can feed the node',
        default='',
    )
    nmea_transducer_m: float = declare(
        number(-1.0, 50.0, 'm'),
        'depth of the echo sounder below the surface, added to DBT, and to DPT without an offset '
        'from the surface; negative: not known, and such a depth is not used',
        default=-1.0,
    )
    part_size_bytes: int = declare(
        whole_number(int(1e5), int(1e10), 'B'),
        'a recording goes on in a new file when one has grown to this; it is then rewritten '
        'several times smaller; larger: fewer files, and a longer work on the disk at the end',
        default=PartLimits().size_bytes,
    )
    part_duration_s: float = declare(
        number(1.0, 604800.0, 's'),
        'a recording goes on in a new file when one covers this time; files are removed as a '
        'whole',
        default=PartLimits().duration_s,
    )
    keep_days: float = declare(
        number(0.0, 36500.0, 'd'),
        'parts of a recording that are older are removed, unless they hold a coastdown; 0: none',
        default=0.0,
    )
    keep_bytes: int = declare(
        whole_number(0, int(1e15), 'B'),
        'when all recordings are larger together, the oldest parts are removed, those that hold '
        'a coastdown last; 0: half of the disk, and none that holds a coastdown; 1e15: no limit',
        default=0,
    )
    path_roots: str = declare(
        text(),
        'folders, separated by colons, in which ship_file and output_directory must lie; empty: '
        'any',
        default='',
    )
    autostart: bool = declare(
        flag(),
        'configure and activate without being asked to; false: nothing is recorded or estimated '
        'until a lifecycle manager asks for both',
        default=True,
    )
    diagnose: bool = declare(
        flag(),
        'name the effect that is missing in the model after each coastdown, in a process of its '
        'own, if the ship file has a baseline; takes a core for some seconds and 300 MB',
        default=True,
    )
    types: Mapping[str, str] = field(default_factory=dict)
    parameters: Parameters = field(default_factory=Parameters)

    @classmethod
    def from_mapping(cls, values: Mapping[str, object], *, subject: str) -> NodeSettings:
        """
        Build from names and values; what is not named keeps its default.

        Raises
        ------
        ParameterError
            Naming every unknown key and every bad value at once.
        """
        problems: list[str] = []
        given = read_keys(KEYS, dict(values), '', problems, former=FORMER_KEYS)
        try:
            parse_addresses(given.get('nmea', ''))
        except ShipdragError as error:
            problems.append(f'nmea: {error}')
        if problems:
            raise ParameterError(subject, problems)
        types = {name: given.pop(f'{name}.type', '') for name in TOPICS}
        own = {name: given.pop(name) for name in keys_of(cls) if name in given}
        fixed = {name: kind for name, kind in types.items() if kind}
        return cls(**own, types=fixed, parameters=Parameters(**given))

    def paths(self) -> tuple[Path, Path]:
        """
        Return the ship file and the folder of recordings, links resolved.

        Raises
        ------
        ParameterError
            If one lies outside of `path_roots`.
        """
        roots = [Path(root).resolve() for root in self.path_roots.split(':') if root]
        found = (Path(self.ship_file).resolve(), Path(self.output_directory).resolve())
        problems = [
            f'{name}: {str(path)!r} lies outside of path_roots {self.path_roots!r}'
            for name, path in zip(('ship_file', 'output_directory'), found)
            if roots and not any(path.is_relative_to(root) for root in roots)
        ]
        if problems:
            raise ParameterError('node parameters', problems)
        return found

    def to_mapping(self) -> dict[str, ParameterValue]:
        """
        Return the value in effect of every setting, by name.
        """
        return {
            **{name: getattr(self, name) for name in keys_of(type(self))},
            **{f'{name}.type': self.types.get(name, '') for name in TOPICS},
            **{name: getattr(self.parameters, name) for name in keys_of(Parameters)},
            'forecast_speeds': list(self.parameters.forecast_speeds),
        }


KEYS: Mapping[str, Key] = {
    **keys_of(NodeSettings),
    **{
        f'{name}.type': Key(
            choice('', *accepted),
            'message type of the topic; empty: the type found in the graph; fixed: another one '
            'is never received, even where this one is silent',
            '',
        )
        for name, accepted in TOPICS.items()
    },
    **keys_of(Parameters),
}
"""Every parameter of the node, by name."""
START_ONLY = frozenset(
    ('ship_file', 'output_directory', 'nmea', 'keep_days', 'keep_bytes', 'path_roots')
)
"""Nobody on the network may say which files or lines are touched."""


def about(name: str) -> str:
    """
    Return what a parameter means and what follows of it, its unit behind.
    """
    key = KEYS[name]
    return f'{key.text} [{key.kind.unit}]' if key.kind.unit else key.text


def sections(tree: object, path: str = '') -> Iterator[tuple[str, Mapping[str, object]]]:
    """
    Yield the sections of a parameter file of ROS: the node that each is for, and its parameters.
    """
    for key, branch in tree.items() if isinstance(tree, dict) else ():
        if key == 'ros__parameters':
            yield path, branch if isinstance(branch, dict) else {}
        else:
            yield from sections(branch, f'{path}/{str(key).strip("/")}')


def parameters_file() -> str:
    """
    Return the text of `config/parameters.yaml`: every default, and what follows of it.
    """
    lines = [
        '# SPDX-License-Identifier: Apache-2.0',
        '# Every parameter of coastdown_node at its default; read-only once configured.',
        '# Made by `python -m shipdrag_ros.node.settings`.',
        '/**:',
        '  ros__parameters:',
    ]
    for name, key in KEYS.items():
        said = about(name)
        if key.kind.low is not None:
            said += f'; {key.kind.low:g} to {key.kind.high:g}'
        if name in START_ONLY:
            said += '; set at the start alone'
        if key.kind.choices:
            said += f'; one of {", ".join(filter(None, key.kind.choices))}'
        lines += textwrap.wrap(said, 99, initial_indent='    # ', subsequent_indent='    # ')
        value = str(key.default).lower() if isinstance(key.default, bool) else repr(key.default)
        if isinstance(key.default, tuple):
            value = repr(list(key.default))
        lines.append(f'    {name}: {value}')
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    print(parameters_file(), end='')
