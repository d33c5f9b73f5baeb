# SPDX-License-Identifier: Apache-2.0
"""Bad parameters, bad command lines, and a node that cannot start."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.bad_input.case import SHIP_FILE, Case, coastdown, steady, write


def _parameters(kind: str, content: str | bytes, *says: str, status: int = 1) -> Case:
    def line(folder: Path) -> list[str]:
        path = folder / 'parameters.yaml'
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return ['replay', _bag(folder), '--parameters', str(path)]

    return Case('Parameters', kind, line, status, says)


def _folder(folder: Path) -> str:
    path = folder / 'ships'
    path.mkdir()
    return str(path)


def _bag(folder: Path) -> str:
    path = folder / 'bag.mcap'
    return str(path if path.exists() else write(path, steady()))


def _coast(folder: Path) -> str:
    return str(write(folder / 'bag.mcap', coastdown()))


def _use(kind: str, line: Callable[[Path], list[str]], *says: str, status: int = 1) -> Case:
    return Case('Command line', kind, line, status, says)


def _replay(*more: str) -> Callable[[Path], list[str]]:
    return lambda folder: ['replay', _bag(folder), *more]


def _simulate(*more: str) -> Callable[[Path], list[str]]:
    """Simulate; the last -o counts."""
    line = ('simulate', '--ship', str(SHIP_FILE), '-o')
    return lambda folder: [*line, str(folder / 'new.mcap'), *more]


def _node(kind: str, *says: str, ros: tuple[str, str], text: str = '') -> Case:
    def line(folder: Path) -> list[str]:
        if text:
            (folder / 'p.yaml').write_text(text)
        where = ['--ship', str(SHIP_FILE), '--out', str(folder / 'records')]
        return ['node', *where, '--ros-args', *(word.replace('@', f'{folder}/') for word in ros)]

    return Case('Node', kind, line, 1, says)


PARAMETERS = (
    _parameters(
        'an unknown name', 'window: 600.0\n', 'window: unknown key; did you mean window_s?'
    ),
    _parameters(
        'out of range',
        'froude_min: 5.0\nlate_s: -1.0\n',
        'froude_min: 5.0, expected 0.001..1',
        'late_s: -1.0, expected 0.1..3600 s',
    ),
    _parameters(
        'an integer for a float',
        'window_s: 600\n',
        'speed_through_water       302   302',
        status=0,
    ),
    _parameters(
        'a float for an integer',
        'order_max: 12.5\n',
        'order_max: 12.5, expected a whole number, 3..40',
    ),
    _parameters(
        'text for a number',
        "window_s: '600'\n",
        "window_s: '600', expected a number without quotes or unit, 60..21600 s",
    ),
    _parameters(
        'a wrong choice', 'estimator: kalman\n', "estimator: 'kalman', expected one of one,"
    ),
    _parameters(
        'a value without a name',
        'just some words\n',
        "is 'just some words', expected lines `name: value`",
    ),
    _parameters('not YAML', 'window_s: [600.0\n', 'not YAML: line 2, column 1: expected'),
    _parameters('a binary file', bytes(range(256)), 'is not a text file', 'save it as UTF-8'),
    _parameters(
        'the file of the node, with its sections',
        '/**:\n  ros__parameters:\n    window_s: 600.0\n',
        'is a parameter file of the node, with ros__parameters; give the lines',
    ),
)
COMMANDS = (
    _use(
        'a directory for a ship file',
        lambda f: ['replay', _bag(f), '--ship', _folder(f)],
        'cannot be read: Is a directory; give the path of a ship file',
    ),
    _use(
        'the same bag twice',
        lambda f: ['replay', _bag(f), _bag(f)],
        'are the same part 0 of one recording; give one of them',
    ),
    _use(
        'an output that exists',
        lambda f: ['simulate', '--ship', str(SHIP_FILE), '-o', _bag(f)],
        "'bag.mcap' exists; choose another name or remove it",
    ),
    _use(
        'an output in a folder that is not there',
        _simulate('-o', '/nowhere/new.mcap'),
        "'/nowhere/new.mcap' cannot be made: No such file or directory; give a name in a folder",
    ),
    _use(
        'a file in the place of the output folder',
        lambda f: ['replay', _bag(f), '--out', str(Path(_bag(f)) / 'results')],
        "'bag.mcap/results': Not a directory; check the path",
    ),
    _use(
        'a full disk',
        _replay('--json', '/dev/full'),
        'the result cannot be written: No space left on device; make room',
    ),
    _use(
        'a window that ends outside of the bag',
        lambda f: ['replay', _coast(f), '--window', '600', '90000'],
        'Warning: the window ends at 90000 s; the bag ends at 1800.0 s',
        status=0,
    ),
    _use(
        'a window of 3 s',
        _replay('--window', '100', '103'),
        'a fit of the motion needs 12 of one of them: give a longer window\n',
    ),
    _use(
        'a window of steady sailing',
        _replay('--window', '10', '290'),
        'no estimate from 10 to 290 s: nothing of it is a coastdown',
        'give another window',
    ),
    _use(
        '--remap without :=',
        _replay('--remap', '/log=speed_through_water'),
        "'/log=speed_through_water', expected FROM:=TO",
        status=2,
    ),
    _use(
        '--remap of a topic that is not there',
        _replay('--remap', '/log:=speed_through_water'),
        "no topic '/log' in the bag; it has /heading",
    ),
    _use(
        '--remap to an input that is none',
        _replay('--remap', '/fix:=gps'),
        "no input 'gps'; inputs are speed_through_water",
    ),
    _use(
        'a speed beyond the baseline',
        _simulate('--speed', '35'),
        'speed_m_s is 35.0, the baseline is stated for',
        'choose a speed inside',
    ),
)
NODE = (
    _node(
        'a parameter file for another node',
        "sections are ['/other'], expected one for '/coastdown_node'",
        ros=('--params-file', '@p.yaml'),
        text='other:\n  ros__parameters:\n    window_s: 600.0\n',
    ),
    _node(
        'a parameter file that is not there',
        "'--params-file no.yaml'. Error: Error opening YAML file; check what follows --ros-args",
        ros=('--params-file', '@no.yaml'),
    ),
    _node(
        'a parameter file that is not YAML',
        "'--params-file p.yaml'",
        'Error at line 1; check what follows --ros-args',
        ros=('--params-file', '@p.yaml'),
        text='window_s: [600.0\n',
    ),
    _node(
        'a bad remapping',
        "'-r position=/gps'",
        'check what follows --ros-args',
        ros=('-r', 'position=/gps'),
    ),
)
CASES = (*PARAMETERS, *COMMANDS, *NODE)
