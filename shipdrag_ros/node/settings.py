# SPDX-License-Identifier: Apache-2.0
"""
Settings of the node: its own and those of the monitor and estimator.

Free of ROS, because the parameter file and the documentation are made from the
same list as the node's descriptors. `python -m shipdrag_ros.node.settings`
prints `config/parameters.yaml`.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from shipdrag_ros.bags.durable import PartLimits
from shipdrag_ros.errors import ParameterError, ShipdragError
from shipdrag_ros.fields import (
    Key,
    Kind,
    choice,
    flag,
    keys_of,
    number,
    read_keys,
    text,
    whole_number,
)
from shipdrag_ros.messages import TOPICS
from shipdrag_ros.nmea.address import FORMS as NMEA_FORMS
from shipdrag_ros.nmea.address import parse_addresses
from shipdrag_ros.parameters import Parameters

ParameterValue = bool | int | float | str


@dataclass(frozen=True)
class Setting:
    """One parameter of the node, as documented and as declared."""

    name: str
    default: ParameterValue
    text: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    kind: Kind | None = None  # how it is checked, where that is known elsewhere
    start_only: bool = False  # nobody on the network may say which files or lines are touched

    @property
    def key(self) -> Key:
        """How a value of it is checked."""
        return Key(self._kind, self.text, self.default)

    @property
    def _kind(self) -> Kind:
        if self.kind is not None:
            return self.kind
        if self.choices:
            return choice(*self.choices)
        if isinstance(self.default, bool):
            return flag()
        if isinstance(self.default, str):
            return text()
        assert self.low is not None
        assert self.high is not None
        if isinstance(self.default, int):
            return whole_number(int(self.low), int(self.high), self.unit)
        return number(self.low, self.high, self.unit)


OWN: tuple[Setting, ...] = (
    Setting('ship_file', '', 'path of the ship file (YAML); required', start_only=True),
    Setting('record', True, 'record inputs, outputs and events while active'),
    Setting(
        'output_directory',
        '.',
        'where recordings are written; made if missing, nothing there is ever overwritten',
        start_only=True,
    ),
    Setting(
        'nmea',
        '',
        f'where NMEA 0183 is heard, besides topics: any of {NMEA_FORMS}, separated by blanks',
        start_only=True,
    ),
    Setting(
        'nmea_transducer_m',
        -1.0,
        'depth of the echo sounder below the surface, added to DBT, and to DPT without an offset '
        'from the surface; negative: not known, and such a depth is not used',
        unit='m',
        low=-1.0,
        high=50.0,
    ),
    Setting(
        'part_size_bytes',
        PartLimits().size_bytes,
        'a recording goes on in a new file when one has grown to this; it is then rewritten '
        'several times smaller',
        unit='B',
        low=1e5,
        high=1e10,
    ),
    Setting(
        'part_duration_s',
        PartLimits().duration_s,
        'a recording goes on in a new file when one covers this time',
        unit='s',
        low=1.0,
        high=604800.0,
    ),
    Setting(
        'keep_days',
        0.0,
        'parts of a recording that are older are removed, unless they hold a coastdown; 0: none',
        unit='d',
        low=0.0,
        high=36500.0,
        start_only=True,
    ),
    Setting(
        'keep_bytes',
        0,
        'when all recordings are larger together, the oldest parts are removed, those that hold '
        'a coastdown last; 0: half of the disk, and none that holds a coastdown; 1e15: no limit',
        unit='B',
        low=0,
        high=1e15,
        start_only=True,
    ),
    Setting(
        'path_roots',
        '',
        'folders, separated by colons, in which ship_file and output_directory must lie; empty: '
        'any',
        start_only=True,
    ),
    Setting('autostart', True, 'configure and activate without being asked to'),
    Setting(
        'diagnose',
        True,
        'name the effect that is missing in the model after each coastdown, in a process of its '
        'own, if the ship file has a baseline',
    ),
)
TYPES: tuple[Setting, ...] = tuple(
    Setting(
        f'{name}.type',
        '',
        'message type of the topic; empty: the type found in the graph',
        choices=('', *accepted),
    )
    for name, accepted in TOPICS.items()
)
SETTINGS: tuple[Setting, ...] = (
    *OWN,
    *TYPES,
    *(
        Setting(
            name,
            key.default,
            key.text,
            unit=key.kind.unit,
            low=key.kind.low,
            high=key.kind.high,
            choices=key.kind.choices,
            kind=key.kind,
        )
        for name, key in keys_of(Parameters).items()
    ),
)


@dataclass(frozen=True)
class NodeSettings:
    """
    All settings of the node, checked.

    Attributes
    ----------
    types
        Message type fixed by the user, by input; inputs without one are absent.
    """

    ship_file: str
    record: bool
    output_directory: str
    nmea: str
    nmea_transducer_m: float
    part_size_bytes: int
    part_duration_s: float
    keep_days: float
    keep_bytes: int
    path_roots: str
    autostart: bool
    diagnose: bool
    types: Mapping[str, str]
    parameters: Parameters

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
        keys = {setting.name: setting.key for setting in SETTINGS}
        given = read_keys(keys, dict(values), '', problems)
        problems += _nmea_problems(given.get('nmea', ''))
        if problems:
            raise ParameterError(subject, problems)
        chosen = {name: given.get(name, key.default) for name, key in keys.items()}
        return cls(
            **{setting.name: chosen[setting.name] for setting in OWN},
            types={name: chosen[f'{name}.type'] for name in TOPICS if chosen[f'{name}.type']},
            parameters=Parameters(**{name: chosen[name] for name in keys_of(Parameters)}),
        )

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
        values: dict[str, ParameterValue] = {}
        for setting in SETTINGS:
            if setting.name.endswith('.type'):
                values[setting.name] = self.types.get(setting.name.removesuffix('.type'), '')
            else:
                owner = self if hasattr(self, setting.name) else self.parameters
                values[setting.name] = getattr(owner, setting.name)
        return values


def _nmea_problems(sources: object) -> list[str]:
    try:
        parse_addresses(str(sources))
    except ShipdragError as error:
        return [f'nmea: {error}']
    return []


def parameters_file() -> str:
    """
    Return the text of `config/parameters.yaml`: every default.
    """
    lines = [
        '# SPDX-License-Identifier: Apache-2.0',
        '# Every parameter of coastdown_node at its default; read-only once configured.',
        '# Made by `python -m shipdrag_ros.node.settings`.',
        '/**:',
        '  ros__parameters:',
    ]
    for setting in SETTINGS:
        about = setting.text
        if setting.unit:
            about += f' [{setting.unit}]'
        if setting.low is not None:
            about += f'; {setting.low:g} to {setting.high:g}'
        if setting.start_only:
            about += '; set at the start alone'
        if setting.choices:
            about += f'; one of {", ".join(choice for choice in setting.choices if choice)}'
        lines += textwrap.wrap(about, 99, initial_indent='    # ', subsequent_indent='    # ')
        lines.append(f'    {setting.name}: {_yaml(setting.default)}')
    return '\n'.join(lines) + '\n'


def _yaml(value: ParameterValue) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value)


if __name__ == '__main__':
    print(parameters_file(), end='')
