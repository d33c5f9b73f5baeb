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


def _node(
    kind: str,
    *says: str,
    status: int = 1,
    ship: str = 'length_m: 150.0\ndisplaced_volume_m3: 20200.0\n',
    out: str = 'records',
    ros: tuple[str, ...] = (),
    files: dict[str, str] | None = None,
) -> Case:
    def line(folder: Path) -> list[str]:
        (folder / 'ship.yaml').write_text(ship)
        (folder / 'taken').write_text('a file, no folder')
        for name, text in (files or {}).items():
            (folder / name).write_text(text)
        more = [word.replace('@', f'{folder}/') for word in ros]
        where = ['--ship', str(folder / 'ship.yaml'), '--out', str(folder / out)]
        return ['node', *where, *(['--ros-args', *more] if more else [])]

    return Case('Node', kind, line, status, says, process=status == 0)


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
    _parameters('NaN', 'window_s: .nan\n', 'window_s: nan, expected 60..21600 s'),
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
    _parameters(
        'a name given twice',
        'window_s: 600.0\nwindow_s: 1200.0\n',
        'window_s: given twice, lines 1 and 2; keep one',
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
    _use('no verb', lambda folder: [], 'the following arguments are required: VERB', status=2),
    _use(
        'an unknown verb',
        lambda folder: ['reply', 'bag.mcap'],
        "invalid choice: 'reply' (choose from",
        status=2,
    ),
    _use(
        'an unknown option',
        _replay('--windw', '0', '100'),
        'unrecognized arguments: --windw',
        status=2,
    ),
    _use(
        'a bag that is not there',
        lambda folder: ['replay', str(folder / 'no.mcap')],
        "'no.mcap' does not exist; give the path of a bag or a log",
    ),
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
        'an output where nothing may be written',
        _simulate('-o', '/proc/new.mcap'),
        "'/proc/new.mcap' cannot be made",
        'give a name in a folder',
    ),
    _use(
        'a file in the place of the output folder',
        lambda f: ['replay', _bag(f), '--out', str(Path(_bag(f)) / 'results')],
        "'bag.mcap/results': Not a directory; check the path",
    ),
    _use(
        '--json with the bag behind it',
        lambda f: ['replay', '--json', _bag(f)],
        "'bag.mcap' would be overwritten by the JSON",
        status=2,
    ),
    _use(
        'a full disk',
        _replay('--json', '/dev/full'),
        'the result cannot be written: No space left on device; make room',
    ),
    _use(
        'a report that does not end in .html',
        _replay('--report', 'report.pdf'),
        "'report.pdf', expected a name that ends in .html",
        status=2,
    ),
    _use(
        'a window outside of the bag',
        _replay('--window', '5000', '6000'),
        'window 5000 to 6000 s: expected 0 <= start < end',
        '301.000 s long',
    ),
    _use(
        'a window that ends outside of the bag',
        lambda f: ['replay', _coast(f), '--window', '600', '90000'],
        'Warning: the window ends at 90000 s; the bag ends at 1800.0 s',
        status=0,
    ),
    _use(
        'a window that ends before it begins',
        _replay('--window', '200', '100'),
        'window 200 to 100 s: expected 0 <= start < end',
    ),
    _use(
        'a window of 3 s',
        _replay('--window', '100', '103'),
        'no estimate from 100 to 103 s',
        'give another window',
    ),
    _use(
        'a window of steady sailing',
        _replay('--window', '10', '290'),
        'no estimate from 10 to 290 s: nothing of it is a coastdown',
        'give another window',
    ),
    _use(
        'a window in words',
        _replay('--window', 'start', 'end'),
        "'start', expected a number at least 0 [s]",
        status=2,
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
    _use(
        'a negative duration',
        _simulate('--duration', '-5'),
        "'-5', expected a number above 0",
        status=2,
    ),
)
NODE = (
    _node(
        'a ship file with a misspelt key',
        'lenght_m: unknown key; did you mean length_m?',
        ship='lenght_m: 150.0\ndisplaced_volume_m3: 20200.0\n',
    ),
    _node(
        'an unknown parameter',
        'windows_s: unknown key; did you mean window_s?',
        ros=('-p', 'windows_s:=600.0'),
    ),
    _node(
        'an integer for a float',
        'window_s=600.0',
        'recording to',
        ros=('-p', 'window_s:=600'),
        status=0,
    ),
    _node(
        'a parameter out of range',
        'froude_min: 5.0, expected 0.001..1',
        ros=('-p', 'froude_min:=5.0'),
    ),
    _node(
        'a type that the input does not have',
        "position.type: 'std_msgs/msg/String', expected one of geometry_msgs",
        ros=('-p', 'position.type:=std_msgs/msg/String'),
    ),
    _node(
        'a wrong choice',
        "estimator: 'kalman', expected one of one,",
        ros=('-p', 'estimator:=kalman'),
    ),
    _node(
        'a file in the place of the output folder',
        '[ERROR] recording failed',
        "'taken': File exists; check output_directory",
        out='taken',
        status=0,
    ),
    _node(
        'a parameter file for another node',
        "sections are ['/other'], expected one for '/coastdown_node'",
        ros=('--params-file', '@p.yaml'),
        files={'p.yaml': 'other:\n  ros__parameters:\n    window_s: 600.0\n'},
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
        files={'p.yaml': 'window_s: [600.0\n'},
    ),
    _node(
        'an argument that is none of ROS',
        'unrecognized arguments: -- extra',
        ros=('--', 'extra'),
        status=2,
    ),
    _node(
        'a bad remapping',
        "'-r position=/gps'",
        'check what follows --ros-args',
        ros=('-r', 'position=/gps'),
    ),
)
CASES = (*PARAMETERS, *COMMANDS, *NODE)
