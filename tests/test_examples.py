# SPDX-License-Identifier: Apache-2.0
"""Every command line in the help, the README and the docs runs, in the order it stands there."""

from __future__ import annotations

import glob
import gzip
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main, parser, verbs
from shipdrag_ros.fleet.store import Store
from shipdrag_ros.samples import INPUTS, Block, Channel
from tests.sources import log_samples
from tests.studies.residual.conftest import RIVER_SHIP

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md')))
PROGRAMS = ('shipdrag', 'coastdown_node', 'ros2')
# needs ROS from apt, and keys
NOT_HERE = (
    'ros2 launch',
    'ros2 security',
    'ros2 run shipdrag_ros coastdown_node --ros-args --enclave',
)
DATA = 'SHIPDRAG_DATA'
ELSEWHERE = 'docs/real_records.md'  # tests/test_real_records.py runs its commands
READ_ELSEWHERE = 4  # the first commands of docs/diagnosis.md, by tests/cli/test_diagnose.py
IN_MESSAGES = 'shipdrag import SOURCE -o NEW.mcap'  # the user's names are to be put in
LIMIT_S = 120.0


def examples(text: str) -> Iterator[str]:
    """
    Yield the command lines of a page: of its code blocks, and between backticks.

    A verb alone, `shipdrag recover`, is a name and no example.
    """
    fenced = re.findall(r'^```.*\n([\s\S]*?)^```', text, flags=re.MULTILINE)
    blocks = re.findall(r'^(?: {4}|\t)(.*)$', text, flags=re.MULTILINE)
    spans = re.findall(r'(?<!`)`([^`]+)`(?!`)', text)
    known = '|'.join(PROGRAMS)
    for line in [*'\n'.join(fenced).splitlines(), *blocks, *spans]:
        command = line.strip().removeprefix('.venv/bin/').partition('  #')[0].strip()
        if command in ('shipdrag VERB', IN_MESSAGES):
            continue
        if re.match(rf'(?:{known}) +\S+ +\S', command):
            yield command


SOURCES = {str(page.relative_to(ROOT)): page.read_text(encoding='utf-8') for page in PAGES}
OF_PAGES = {name: lines for name, text in SOURCES.items() if (lines := list(examples(text)))}


def help_text(verb: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit):
        main([verb, '--help'])
    return capsys.readouterr().out


@pytest.fixture(scope='module')
def made(once: Callable[..., Path]) -> Path:
    """Small files of the names that examples take for granted."""
    return once('made', make_files)


def make_files(folder: Path) -> None:
    """Make them."""
    ship = ROOT / 'config' / 'vitus_bering.yaml'
    shutil.copy(ship, folder / 'ship.yaml')
    shutil.copy(ROOT / 'config' / 'parameters.yaml', folder / 'parameters.yaml')
    shutil.copy(ROOT / 'docs' / 'data' / 'river_ships.csv', folder / 'hulls.csv')
    shutil.copy(ROOT / 'docs' / 'data' / 'c_x.csv', folder / 'table.csv')
    shutil.copytree(ROOT / 'docs' / 'data' / 'effects', folder / 'effects')
    for name in ('NEW.csv', 'new_hulls.csv'):
        (folder / name).write_text('L_B,B_T,C_B,lcb,Fr\n8.2,4.0,0.85,0.005,0.12\n')
    (folder / 'records').mkdir()
    Store(folder / 'store')
    for seed, name in enumerate(('run', 'out', 'back', 'clean_1', 'clean_2', 'records/1')):
        line = ['simulate', '--ship', str(ship), '-o', str(folder / f'{name}.mcap')]
        course = ('--heading', '3.1416', '--first-heading', '0') if name == 'back' else ()
        length = ('--lead-in', '600', '--duration', '1200' if name == 'run' else '900')
        assert main([*line, *length, '--seed', str(seed), *course]) == 0
    (folder / 'damaged.mcap').write_bytes((folder / 'run.mcap').read_bytes()[:-20_000])
    rows = ((f'{1000 * i}', '10', f'{0.005 * i}', '0', '60', '5', '90', '91') for i in range(60))
    table = ['t,u,x,y,lat,lon,port,starboard', *(','.join(row) for row in rows)]
    (folder / 'log.csv').write_text('\n'.join(table))
    with gzip.open(folder / 'LOG.nmea.gz', 'wt') as log:
        log.writelines(nmea(second) for second in range(60))


def make_logs(folder: Path) -> None:
    """Make a file of each format that docs/import.md names."""
    names = {'csv': 'bridge.csv', 'candump': 'candump.log', 'yacht_devices': 'ydwg.raw'}
    names |= {'nmea': 'log.nmea', 'ros1': 'ros1.bag'}
    for kind, (name, content) in log_samples.samples(folder).items():
        (folder / names.get(kind, name)).write_bytes(content)
    head, *rows = [line.split(',') for line in log_samples.csv().decode().split('\n')]
    for name, columns in (('receiver', (0, 2, 3, 4)), ('speed_log', (0, 1))):
        lines = (','.join(row[column] for column in columns) for row in [head, *rows])
        (folder / f'{name}.csv').write_text('\n'.join(lines))
    run = samples_of(str(folder / 'run.mcap'))
    log = run[run.channel == Channel.SPEED_THROUGH_WATER]
    speeds = [
        f'{stamp / 1e9:.3f},{value:.5f}' for stamp, value in zip(log.stamp_ns, log.value[:, 0])
    ]
    (folder / 'LOG').write_text('\n'.join(['time,speed_through_water', *speeds]))


def nmea(second: int) -> str:
    """One second of a receiver and a log."""
    bodies = (
        f'GPRMC,1200{second:02d}.00,A,4612.909,N,00610.158,E,05.0,003,280224,,,A',
        'VWVHW,,T,,M,5.0,N,,K',
    )
    return ''.join(f'{log_samples.sentence(body)}\r\n' for body in bodies)


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that looks like the source tree with a user's files in it."""
    here = tmp_path / 'here'
    shutil.copytree(made, here)
    for name in ('config', 'docs', 'benchmarks'):
        (here / name).symlink_to(ROOT / name)
    monkeypatch.chdir(here)
    return here


def run_watch(words: list[str]) -> None:
    """Start the page, on a port that is free, until it says where it is."""
    if not Path((words[2:] or ['-'])[0]).exists():  # without a bag or a log it shows the node
        pytest.importorskip('rclpy')
    line = [sys.executable, '-m', 'shipdrag_ros.cli', *words[1:], '--port', '0']
    environment = os.environ | {'PYTHONUNBUFFERED': '1'}
    log = Path('watch.log')
    with log.open('w') as file:
        page = subprocess.Popen(line, stdout=file, stderr=file, env=environment)
    try:
        end_s = time.monotonic() + LIMIT_S
        while 'the page: http' not in log.read_text():
            assert page.poll() is None, log.read_text()
            assert time.monotonic() < end_s
            time.sleep(0.1)
        page.terminate()
        assert page.wait(timeout=LIMIT_S) == 0, log.read_text()
    finally:
        page.kill()
        page.wait()


def make_room(name: str) -> None:
    """Take away the file that an example makes; a store is brought up to date, as it is."""
    if not Path(name).is_dir():
        Path(name).unlink(missing_ok=True)


def read_learn(line: str) -> None:
    """Read an example of `learn`, whose bags are there."""
    words = parser('learn').parse_args(shlex.split(line)[1:])
    assert all(bag.path.exists() for bag in words.bags)


STARTED: set[str] = set()  # programs that were started; of more lines the words are read


def run(command: str) -> None:
    """Run an example as a shell would; the node is ended by a signal once it records."""
    words = [os.path.expandvars(word) for word in shlex.split(command.replace(' ... ', ' '))]
    words = [path for word in words for path in (sorted(glob.glob(word)) or [word])]
    if words[:2] == ['ros2', 'run']:
        words = words[3:]
    if words[:2] == ['shipdrag', 'demo']:
        return  # tests/cli/test_demo.py runs it
    if words[0] == 'shipdrag' and words[1] not in ('node', 'watch'):
        assert main(words[1:]) == 0, command
        return
    program = words[1] if words[0] == 'shipdrag' else words[0]
    if words[0] == 'shipdrag':
        parser(program).parse_args(words[1:])
    if program in STARTED:
        return
    STARTED.add(program)
    if program == 'watch':
        run_watch(words)
        return
    pytest.importorskip('rclpy')
    words[0] = str(Path(sys.executable).with_name(words[0]))
    log, before = Path('node.log'), set(Path.cwd().rglob('*.mcap'))
    with log.open('w') as file:
        node = subprocess.Popen(words, stdout=file, stderr=file)
    try:
        end_s = time.monotonic() + LIMIT_S
        while 'active; recording to' not in log.read_text():
            assert node.poll() is None, log.read_text()
            assert time.monotonic() < end_s, log.read_text()
            time.sleep(0.1)
        node.send_signal(signal.SIGINT)
        assert node.wait(timeout=LIMIT_S) == 0, log.read_text()
    finally:
        node.kill()
        node.wait()
    for recorded in set(Path.cwd().rglob('*.mcap')) - before:
        recorded.unlink()  # it has heard no ship, and a replay of nothing is an error


@pytest.mark.parametrize('verb', [verb.name for verb in verbs()])
def test_the_examples_of_the_help_run(folder: Path, verb: str, capsys) -> None:
    text = help_text(verb, capsys)
    lines = re.findall(r'^ +(shipdrag .*)$', text, flags=re.MULTILINE)
    assert len(lines) >= 2, 'give two in the docstring of the module of the verb'
    for line in lines:
        assert line.split()[1] == verb
        if line in OF_PAGES['docs/diagnosis.md'][:READ_ELSEWHERE]:
            continue
        for made in set(re.findall(r'-o (\S+)|--write (\S+)', line)):
            make_room(''.join(made))
        if verb == 'learn' and line != lines[0]:  # a clean ship teaches nothing a second time
            read_learn(line)
        else:
            run(line)


@pytest.mark.parametrize('page', [page for page in OF_PAGES if page != ELSEWHERE])
def test_the_examples_of_a_page_run(folder: Path, page: str) -> None:
    lines = [line for line in OF_PAGES[page] if not line.startswith(NOT_HERE)]
    if any(DATA in line for line in lines) and DATA not in os.environ:
        pytest.skip(f'needs the folder of records in {DATA}')
    if 'import.md' in page:
        make_logs(folder)
    if 's4_residual' in page:  # a ship whose form the regression knows
        (folder / 'ship.yaml').write_text(RIVER_SHIP)
    if 'diagnosis.md' in page:
        lines = lines[READ_ELSEWHERE:]
    for name in {name for line in lines for name in re.findall(r'-o (\S+)', line)}:
        make_room(name)
    for line in lines:
        if line.split()[1] == 'fleet' and page != 'README.md':  # which does the same
            words = parser('fleet').parse_args(shlex.split(line)[1:])
            assert all(Path(place).is_dir() for place in words.folders)
        elif 'learn' not in line.split():
            run(line)
        else:  # the help's example learns from the same bags, and a clean ship teaches nothing
            read_learn(line)
            weed = (folder / 'effects' / 'weed.yaml').read_text()
            (folder / 'effects' / 'kelp.yaml').write_text(weed.replace('name: weed', 'name: kelp'))


def test_the_pages_have_the_examples_that_they_should() -> None:
    """What looks like a command anywhere in a page is collected."""
    for page, text in SOURCES.items():
        lines = OF_PAGES.get(page, [])
        for found in re.findall(r'(?:^ {4}|`)(?:\.venv/bin/)?(shipdrag [a-z]+ [^`\n]*-.*)', text):
            command = found.partition('`')[0].partition('  #')[0].strip()
            assert command in (*lines, IN_MESSAGES), f'{page}: {command}'
    verbs = {line.split()[1] for lines in OF_PAGES.values() for line in lines}
    assert verbs >= {'simulate', 'replay', 'diagnose', 'import', 'node', 'baseline', 'cable'}


MAP = re.compile(rf'\b(?:{"|".join(INPUTS)})=[a-z0-9]+(?::[a-z/]+)?(?:,[a-z0-9]+(?::[a-z/]+)?)?')


def test_the_columns_that_the_help_shows_are_read_as_it_says(folder: Path, capsys) -> None:
    text = re.sub(r'\s+', ' ', help_text('import', capsys))
    shown = MAP.findall(text)
    assert {'position=x,y:km', 'position=x:km,y:km', 'position=lat,lon:deg'} <= set(shown)
    for number, each in enumerate(shown):
        out = f'{number}.mcap'
        assert main(['import', 'log.csv', '-o', out, '--rate', '1', '--map', each]) == 0
    x_km = values('0.mcap')  # position=x,y:km, the form that was read as metres and kilometres
    assert shown[0] == 'position=x,y:km'
    assert x_km[-1] == pytest.approx([295.0, 0.0])


def samples_of(bag: str) -> Block:
    (opened,) = open_runs([Path(bag)])
    return opened.inputs().block()


def values(bag: str) -> list[list[float]]:
    found: list[list[float]] = samples_of(bag).value.tolist()
    return found
