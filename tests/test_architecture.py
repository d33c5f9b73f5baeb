# SPDX-License-Identifier: Apache-2.0
"""The house: imports run downward only, and the edges keep ROS and MCAP to themselves."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'shipdrag_ros'

# a room may import rooms of a lower floor, and itself
FLOORS = {
    'errors': 0,
    'samples': 0,
    'compiled': 0,
    'strict_yaml': 0,
    'parameters': 1,
    'ship': 1,
    'regression': 2,
    'simulation': 2,
    'residual': 3,
    'estimation': 3,
    'sensitivity': 3,
    'diagnosis': 4,
    'coastdown': 4,
    'messages': 5,
    'bags': 6,
    'report': 7,
    'node': 8,
    'cli': 9,
}
ROS = {
    'rclpy',
    'lifecycle_msgs',
    'rcl_interfaces',
    'std_msgs',
    'std_srvs',
    'geometry_msgs',
    'sensor_msgs',
    'nav_msgs',
    'diagnostic_msgs',
    'rosgraph_msgs',
    'builtin_interfaces',
    'ament_index_python',
}
ONLY_IN = {'mcap': {'bags'}, 'rosbags': {'messages', 'bags'}, **{name: {'node'} for name in ROS}}
SOURCES = sorted(PACKAGE.rglob('*.py'))


def room(path: Path) -> str:
    """Name the room a source file stands in; '' for the package itself."""
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix('.py').replace('__init__', '')


def imports(path: Path) -> Iterator[str]:
    """Yield the dotted names that a source file imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import'
            module = node.module or ''
            yield module
            if module == 'shipdrag_ros':
                yield from (f'{module}.{alias.name}' for alias in node.names)


@pytest.mark.parametrize('path', SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_run_downward_and_stay_at_the_edges(path: Path) -> None:
    here = room(path)
    for name in imports(path):
        parts = name.split('.')
        allowed = ONLY_IN.get(parts[0])
        assert allowed is None or here in allowed, f'{parts[0]} is imported in {here or "top"}'
        if parts[0] == 'shipdrag_ros' and len(parts) > 1 and here:
            other = parts[1]
            if other in FLOORS and other != here:
                assert FLOORS[other] < FLOORS[here], f'{here} imports {other}, which is not below'


def test_every_room_has_a_floor() -> None:
    rooms = {room(path) for path in SOURCES} - {''}
    assert rooms <= set(FLOORS), f'give {rooms - set(FLOORS)} a floor'


@pytest.mark.parametrize(
    'path',
    sorted(
        path
        for folder in ('shipdrag_ros', 'tests', 'benchmarks', 'launch')
        for path in (ROOT / folder).rglob('*.py')
    ),
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_licence_header(path: Path) -> None:
    assert path.read_text().startswith('# SPDX-License-Identifier: Apache-2.0\n')
