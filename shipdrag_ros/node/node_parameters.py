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
from shipdrag_ros.node.settings import KEYS, START_ONLY, NodeSettings, about

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
        for name, value in values.items():
            node.declare_parameter(name, value, _descriptor(name), ignore_override=True)
        node.add_on_set_parameters_callback(self._on_set)

    def settings(self) -> NodeSettings:
        """
        Return what is set now.
        """
        return NodeSettings.from_mapping(self._values(), subject=SUBJECT)

    def _values(self) -> dict[str, Any]:
        return {name: self._node.get_parameter(name).value for name in KEYS}

    def _on_set(self, changes: list[Parameter]) -> SetParametersResult:
        ours = {*KEYS, 'use_sim_time'}
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


def _descriptor(name: str) -> ParameterDescriptor:
    kind, start_only = KEYS[name].kind, name in START_ONLY
    descriptor = ParameterDescriptor(
        name=name,
        description=about(name),
        additional_constraints=(
            'set at the start alone' if start_only else 'read-only while configured'
        ),
        read_only=start_only,
    )
    if kind.choices:
        allowed = ', '.join(filter(None, kind.choices))
        descriptor.additional_constraints += f'; one of {allowed}'
    if kind.low is None or kind.high is None:
        return descriptor
    if isinstance(KEYS[name].default, int):
        limits = IntegerRange(from_value=int(kind.low), to_value=int(kind.high))
        descriptor.integer_range = [limits]
    else:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(kind.low), to_value=float(kind.high))
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
