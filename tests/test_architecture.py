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

from benchmarks.house import circles, dotted, imports

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'shipdrag_ros'

# docs/architecture.md from below: a room may import what stands lower, and itself
PICTURE = (
    ('errors', 'samples', 'display', 'progress', 'compiled'),
    ('imports', 'strict_yaml'),
    ('fields',),
    ('parameter',),
    ('parameters', 'ship', 'report'),
    ('inference',),
    ('simulation',),
    ('posterior',),
    ('estimation',),
    ('forecast',),
    ('coastdown', 'diagnosis', 'studies'),
    ('learning',),
    ('messages',),
    ('bags', 'nmea'),
    ('node', 'replay', 'sources'),
    ('fleet',),
    ('trend',),
    ('library',),
    ('live',),
    ('cli',),
    ('face',),  # of a study; found by cli, imported by none
)
FLOORS = {room: number for number, floor in enumerate(PICTURE) for room in floor}
ESTIMATING = {'coastdown', 'estimation', 'diagnosis', 'simulation'}
NEVER = {  # files estimate nothing, and no coastdown needs a study
    'bags': ESTIMATING | {'studies'},
    **{
        name: {'studies'}
        for name in (
            *('messages', 'nmea', 'replay', 'sources', 'node', 'fleet', 'trend', 'report', 'live'),
        )
    },
}
GROUND = {
    'errors',
    'progress',
    'compiled',
    'strict_yaml',
    'imports',
}  # known by the modules that need them
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
FLEET = ('dask', 'distributed', 'pyarrow', 'fsspec', 's3fs')
ONLY_IN = {
    'mcap': {'bags'},
    'rosbags': {'messages', 'sources', 'bags'},  # a bag of ROS 1 is imported
    **{name: {'node'} for name in ROS},
    **{name: {'fleet', 'trend'} for name in FLEET},  # no other verb pays for them
}
SOURCES = sorted(PACKAGE.rglob('*.py'))


def room(name: str) -> str:
    """Name the room that a dotted name of the package stands in; '' for the package itself."""
    parts = name.split('.')[1:]
    if 'face' in parts:
        return 'face'
    return parts[0] if parts else ''


def wrong(path: Path) -> Iterator[str]:
    """Yield the imports of a source file that the picture does not allow."""
    here = room(dotted(path, ROOT))
    for name in imports(path):
        top, other = name.split('.')[0], room(name)
        if here not in ONLY_IN.get(top, {here}):
            yield f'{path}: {top} is imported in {here or "the top"}'
        if top == PACKAGE.name and here and other in FLOORS and other != here:
            if FLOORS[other] >= FLOORS[here]:
                yield f'{path}: {here} imports {other}, which is not below'
            if other in NEVER.get(here, set()):
                yield f'{path}: {here} must not need {other}'


def test_imports_run_downward_and_stay_at_the_edges() -> None:
    assert [each for path in SOURCES for each in wrong(path)] == []


def test_every_room_has_a_floor() -> None:
    rooms = {room(dotted(path, ROOT)) for path in SOURCES} - {''}
    assert rooms <= set(FLOORS), f'give {rooms - set(FLOORS)} a floor'


def test_the_picture_shows_every_room() -> None:
    shown = (ROOT / 'docs' / 'architecture.md').read_text(encoding='utf-8').split('```')[1]
    names = set(re.findall(r'\w+/|\w+\.py', shown))
    wanted = {room.rpartition('.')[2] for room in FLOORS}
    assert {room for room in wanted if not {f'{room}/', f'{room}.py'} & names} == set()


def test_no_room_imports_itself_in_a_circle() -> None:
    assert circles(ROOT) == set()


def named(path: Path) -> Iterator[str]:
    """Yield the names of the classes and types that a source file makes."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign) and not ast.unparse(node.value).startswith('TypeVar('):
            yield from (
                target.id
                for target in node.targets
                if isinstance(target, ast.Name) and re.match('_?[A-Z][a-z]', target.id)
            )


def test_a_name_stands_for_one_thing() -> None:
    places: dict[str, list[str]] = {}
    for path in SOURCES:
        for name in named(path):
            places.setdefault(name, []).append(str(path.relative_to(PACKAGE)))
    assert len(places) > 500
    twice = {name: where for name, where in places.items() if len(where) > 1}
    assert not twice, 'give each class and type of the package a name of its own'


WALKS = ('CONTRIBUTING.md', 'docs/architecture.md', 'docs/model.md', 'docs/results/walk.txt')


@pytest.mark.parametrize('page', WALKS)
def test_modules_that_a_walk_names_are_there(page: str) -> None:
    named = set(re.findall(r'[\w/]+\.py\b', (ROOT / page).read_text(encoding='utf-8')))
    rooms = (ROOT / name for name in ('shipdrag_ros', 'tests', 'docs', 'benchmarks'))
    known = [path.as_posix() for room in rooms for path in room.rglob('*.py')]
    assert len(named) > 10
    assert not {name for name in named if not any(path.endswith(f'/{name}') for path in known)}


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
    assert listed == {
        dotted(path, ROOT).split('.')[1] for path in SOURCES if path.parent != PACKAGE
    } | {path.stem for path in PACKAGE.glob('*.py') if path.stem not in {'__init__', *GROUND}}


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


def test_licence_header() -> None:
    head = '# SPDX-License-Identifier: Apache-2.0\n'
    folders = ('shipdrag_ros', 'tests', 'benchmarks', 'launch')
    every = [path for folder in folders for path in (ROOT / folder).rglob('*.py')]
    assert [path for path in every if not path.read_text().startswith(head)] == []
