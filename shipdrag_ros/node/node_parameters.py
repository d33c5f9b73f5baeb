# SPDX-License-Identifier: Apache-2.0
"""
ROS parameters of the node, declared from the one list in `settings`.

ROS ignores what it does not know: a misspelt key, a file whose sections are for
another node. Here both are errors.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from shipdrag_ros.errors import ParameterError
from shipdrag_ros.fields import parse, text_of
from shipdrag_ros.node.settings import SETTINGS, NodeSettings, Setting

ROS_OWN = ('use_sim_time', 'start_type_description_service')  # declared by rclpy itself
SUBJECT = 'node parameters'


class NodeParameters:
    """
    The declared parameters: checked together, fixed while configured.

    Parameters
    ----------
    node
        Made with `automatically_declare_parameters_from_overrides`, so that unknown
        names can be seen.

    Raises
    ------
    ParameterError
        Naming every unknown key and every bad value at once.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self.fixed = False
        given = {
            name: parameter.value
            for name, parameter in node.get_parameters_by_prefix('').items()
            if name not in ROS_OWN and not name.startswith('qos_overrides.')
        }
        values = NodeSettings.from_mapping(given, subject=SUBJECT).to_mapping()
        for name in given:
            node.undeclare_parameter(name)
        for setting in SETTINGS:
            node.declare_parameter(
                setting.name, values[setting.name], _descriptor(setting), ignore_override=True
            )
        node.add_on_set_parameters_callback(self._on_set)

    def settings(self) -> NodeSettings:
        """
        Return what is set now.
        """
        return NodeSettings.from_mapping(self._values(), subject=SUBJECT)

    def _values(self) -> dict[str, Any]:
        return {setting.name: self._node.get_parameter(setting.name).value for setting in SETTINGS}

    def _on_set(self, changes: list[Parameter]) -> SetParametersResult:
        ours = {setting.name for setting in SETTINGS} | {'use_sim_time'}
        changed = {change.name: change.value for change in changes if change.name in ours}
        if not changed:
            return SetParametersResult(successful=True)
        if self.fixed:
            return SetParametersResult(
                successful=False,
                reason=f'{", ".join(changed)}: read-only while configured; clean up first',
            )
        changed.pop('use_sim_time', None)
        try:
            NodeSettings.from_mapping({**self._values(), **changed}, subject=SUBJECT)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason='; '.join(error.problems))
        return SetParametersResult(successful=True)


def _descriptor(setting: Setting) -> ParameterDescriptor:
    about = f'{setting.text} [{setting.unit}]' if setting.unit else setting.text
    descriptor = ParameterDescriptor(
        name=setting.name,
        description=about,
        additional_constraints=(
            'set at the start alone' if setting.start_only else 'read-only while configured'
        ),
        read_only=setting.start_only,
    )
    if setting.choices:
        allowed = ', '.join(choice for choice in setting.choices if choice)
        descriptor.additional_constraints += f'; one of {allowed}'
    if setting.low is None or setting.high is None:
        return descriptor
    if isinstance(setting.default, int):
        descriptor.integer_range = [
            IntegerRange(from_value=int(setting.low), to_value=int(setting.high))
        ]
    else:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(setting.low), to_value=float(setting.high))
        ]
    return descriptor


def check_sections(arguments: Sequence[str], node: Node) -> None:
    """
    Refuse a parameter file none of whose sections is for this node.

    Parameters
    ----------
    arguments
        The command line, `--params-file FILE` in it.

    Raises
    ------
    ParameterError
        Naming the sections there are.
    """
    name = node.get_fully_qualified_name()
    for flag, path in pairwise(arguments):
        if flag != '--params-file':
            continue
        text = text_of(path, what='a parameter file', error=ParameterError)
        sections = list(_sections(parse(text, subject=path, error=ParameterError), ''))
        if not any(_pattern(section).fullmatch(name) for section in sections):
            raise ParameterError(
                path,
                [f'sections are {sections!r}, expected one for {name!r}; "/**" is for any node'],
            )


def _sections(tree: object, path: str) -> Iterator[str]:
    if not isinstance(tree, dict):
        return
    for key, branch in tree.items():
        if key == 'ros__parameters':
            yield path
        else:
            yield from _sections(branch, f'{path}/{str(key).strip("/")}')


def _pattern(section: str) -> re.Pattern[str]:
    parts = {'/**': '(/[^/]+)*', '/*': '/[^/]+'}
    return re.compile(
        ''.join(parts.get(part, re.escape(part)) for part in re.findall('/[^/]+', section))
    )
