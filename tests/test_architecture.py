# SPDX-License-Identifier: Apache-2.0
"""The house: imports run downward only, and the edges keep ROS and MCAP to themselves."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

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
    'inference': 2,
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


def doors() -> list[tuple[str, str]]:
    """Return room and door of each row of the table in the map of the code."""
    text = (ROOT / 'docs' / 'architecture.md').read_text(encoding='utf-8')
    table = text[text.index('| room | door |') :].split('\n\n')[0]
    found = []
    for line in table.splitlines()[2:]:
        place, listed = (cell.strip() for cell in line.strip('|').split('|'))
        here = place.strip('`').removesuffix('/').removesuffix('.py').replace('/', '.')
        for span in re.findall(r'`([^`]+)`', listed):
            found += [(here, part) for part in span.split(' -> ')]
    return found


def test_every_room_has_a_door() -> None:
    listed = {here.partition('.')[0] for here, _ in doors()}
    assert listed == set(FLOORS) - {'errors', 'compiled', 'strict_yaml'}


@pytest.mark.parametrize(('here', 'door'), doors())
def test_every_door_opens(here: str, door: str) -> None:
    if here == 'node':
        pytest.importorskip('rclpy')
    if door.endswith('/'):
        assert (PACKAGE / here.replace('.', '/') / door).is_dir()
        return
    name, bracket, inside = door.partition('(')
    found: Any = import_module(f'shipdrag_ros.{here}')
    for part in name.split('.'):
        if not hasattr(found, part):
            found = import_module(f'{found.__name__}.{part}')
        else:
            found = getattr(found, part)
    if bracket:
        known = inspect.signature(found).parameters
        words = [word.strip() for word in inside.rstrip(')').split(',') if word.strip()]
        bound = 1 if inspect.isfunction(found) and 'self' in known else 0
        assert len(words) + bound <= len(known)
        for word in words:
            assert not word.endswith('=') or word[:-1] in known


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
