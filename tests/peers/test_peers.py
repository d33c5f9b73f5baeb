# SPDX-License-Identifier: Apache-2.0
"""What a stranger finds who shares no code with the package: faults named, nothing lost."""

from __future__ import annotations

import ast
import math
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip('rclpy')

from attacks import Bench, nonsense
from stranger import (
    OK,
    SHIP,
    Clock,
    Program,
    Stranger,
    cdr_twist,
    coasting,
    get,
    payloads,
    point,
    twist,
)

HERE = Path(__file__).parent
READY = 'ready to estimate'
LOG = 'input speed_through_water'
PROMISED_S = 1.0  # nothing that is older is lost
MALFORMED = (b'\x00\x01\x00\x00', b'\xff' * 40, b'\x00\x01\x00\x00' + b'\xff' * 60)


@pytest.fixture
def stranger() -> Iterator[Stranger]:
    found = Stranger()
    yield found
    found.close()


@pytest.fixture
def programs(tmp_path: Path) -> Iterator[list[Program]]:
    (tmp_path / 'ship.yaml').write_text(SHIP)
    started: list[Program] = []
    yield started
    for each in started:
        each.end()


def start_node(programs: list[Program], folder: Path, *ros_arguments: str) -> Program:
    line = ('node', '--ship', folder / 'ship.yaml', '--out', folder / 'bags')
    programs.append(Program(folder / 'node.log', *line, '--ros-args', *ros_arguments))
    programs[-1].wait_for(READY)
    return programs[-1]


def test_the_client_shares_no_code_with_the_package() -> None:
    for path in HERE.glob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Import | ast.ImportFrom):
                continue
            names = [alias.name for alias in node.names]
            names.append(getattr(node, 'module', None) or '')
            assert not any(str(name).startswith('shipdrag') for name in names), path


def test_faults_are_named_and_a_kill_loses_nothing_older_than_a_second(
    stranger: Stranger, programs: list[Program], tmp_path: Path
) -> None:
    node = start_node(programs, tmp_path)
    programs.append(Program(tmp_path / 'watch.log', 'watch', '--port', '0'))
    broken = stranger.node.create_publisher(type(twist(0, 0.0)), 'wind_apparent', 1000)
    sent: list[bytes] = []

    def sail() -> None:
        """The log is sound; over ground is NaN, the position has no time, the wind no sense."""
        now_ns = time.time_ns()
        sent.append(cdr_twist(now_ns, coasting(-1.0) + 1e-6 * len(sent)))
        stranger.log.publish(sent[-1])
        stranger.ground.publish(twist(now_ns, math.nan))
        stranger.place.publish(point(0, 5.0 * len(sent)))
        broken.publish(MALFORMED[len(sent) % len(MALFORMED)])

    def grave(part: str, *words: str) -> bool:
        status = stranger.now(f'input {part}')
        return status is not None and all(word in status.message for word in words)

    stranger.until(lambda: stranger.value(LOG, 'used') > 20, meanwhile=sail)
    stranger.until(lambda: grave('speed_over_ground', 'nan', 'look at it'), meanwhile=sail)
    stranger.until(lambda: grave('position', 'holds no time', 'stamp'), meanwhile=sail)
    stranger.until(lambda: grave('wind_apparent', 'malformed', 'driver'), meanwhile=sail)
    since = len(stranger.arrays)
    stranger.until(lambda: len(stranger.arrays) > since + 3, meanwhile=sail)
    for part in ('speed_over_ground', 'position', 'wind_apparent'):
        levels = [status.level[0] for status in stranger.said(f'input {part}', since=since)]
        assert levels
        assert OK not in levels, f'{part} was green while it was wrong'
    assert stranger.value('input speed_over_ground', 'used') == 0
    sound = stranger.now(LOG)
    assert sound is not None
    assert sound.level[0] == OK, sound.message

    url = programs[-1].wait_for(r'http://\S+/')

    def shown() -> dict[str, dict[str, object]]:
        return {each['name']: each for each in get(f'{url}state.json').get('inputs', ())}

    stranger.until(lambda: 'position' in shown(), meanwhile=sail)
    for part in ('speed over ground', 'position', 'wind apparent'):
        assert shown()[part]['level'] != OK, 'the page is green where /diagnostics is not'

    # so much was received; from here the node has at least the promised time by its own ticks
    received = int(stranger.value(LOG, 'messages'))
    ticks = len(stranger.arrays)
    began_s = time.monotonic()
    stranger.until(
        lambda: len(stranger.arrays) > ticks + 2 and time.monotonic() > began_s + PROMISED_S,
        meanwhile=sail,
    )
    node.end(signal.SIGKILL)
    left = payloads(sorted((tmp_path / 'bags').glob('*.mcap')), '/speed_through_water')
    assert received > 20
    assert left[0] in sent, 'the bytes differ'
    joined = sent.index(left[0])  # what was sent before the two found each other went to nobody
    came = sent[joined : joined + received]
    assert left[:received] == came, 'bytes differ, or some are gone'
    assert len(left) >= received


def test_a_log_in_knots_is_not_green_and_the_remedy_is_named(stranger, programs, tmp_path):
    start_node(programs, tmp_path, '-p', 'use_sim_time:=true', '-p', 'record:=false')
    state = {'second': 1_700_000_000}

    def sail() -> None:
        """Two seconds of the record: the clock first, then what was measured before it."""
        for _ in range(2):
            state['second'] += 1
            clock = Clock()
            clock.clock.sec = state['second']
            stranger.clock.publish(clock)
            stranger.spin(0.01)
            at_ns = state['second'] * 10**9 - 10**8
            speed_m_s = 5.0 + 0.03 * math.sin(1.7 * state['second'])  # no reading repeats itself
            stranger.log.publish(twist(at_ns, speed_m_s * 3600.0 / 1852.0))
            stranger.ground.publish(twist(at_ns, speed_m_s))

    def doubted() -> bool:
        status = stranger.now(LOG)
        return status is not None and 'look at the unit' in status.message

    stranger.until(doubted, meanwhile=sail)
    since = len(stranger.arrays)
    stranger.until(lambda: len(stranger.arrays) > since + 2, meanwhile=sail)
    levels = [s.level[0] for s in stranger.said(LOG, since=since)]
    assert OK not in levels
    assert 'knots over m/s' in str(stranger.last())
    assert all(s.level[0] != OK for s in stranger.said('state', since=since))


def test_a_log_in_a_wrong_scale_is_named_once_she_slows_and_the_positions_find_the_stop(tmp_path):
    bench = Bench(tmp_path)
    try:
        good, text = nonsense(
            bench, '0.5 times', doubted='speed_through_water', beside='position', within_s=600
        )
    finally:
        bench.close()
    assert good, text


def test_a_log_that_says_nothing_is_named_and_what_is_sound_finds_the_stop(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    try:
        good, text = nonsense(
            bench, 'random', doubted='speed_through_water', beside='speed_over_ground', from_s=45
        )
    finally:
        bench.close()
    assert good, text
