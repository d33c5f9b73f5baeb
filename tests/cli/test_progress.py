# SPDX-License-Identifier: Apache-2.0
"""What a long verb shows while it works: on stderr alone, to a terminal and to a pipe."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.cli.output import ProgressLines, compiling_said
from shipdrag_ros.compiled import compiled


@pytest.fixture(scope='module')
def short_bag(ship_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short run with little in it, so that a diagnosis is soon done."""
    path = tmp_path_factory.mktemp('short') / 'short.mcap'
    line = ['simulate', '--ship', str(ship_file), '-o', str(path), '--lead-in', '600']
    assert main([*line, '--duration', '700', '--rate', '0.5', '--seed', '2']) == 0
    return path


def diagnosed(bag: Path, *, stderr: int) -> subprocess.Popen[bytes]:
    """Start a diagnosis with JSON on a pipe and its words elsewhere."""
    line = [sys.executable, '-m', 'shipdrag_ros.cli', 'diagnose', str(bag), '--json']
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=stderr)


def test_lines_are_told_now_and_then_with_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr('shipdrag_ros.cli.output.time.monotonic', lambda: clock[0])
    said: list[str] = []
    lines = ProgressLines(said.append, every_s=15.0, at_once=False)
    for done in range(5):
        lines.show('replaying', done, 10)
        clock[0] += 10.0
    assert said == ['replaying: 2 of 10, 80 s left', 'replaying: 4 of 10, 60 s left']


def test_the_first_word_comes_at_once_and_the_others_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr('shipdrag_ros.cli.output.time.monotonic', lambda: clock[0])
    said: list[str] = []
    lines = ProgressLines(said.append, every_s=3.0, at_once=True)
    lines.show('reading', 0, 0)
    for done in range(8):
        lines.show('fitting', done, 8)
        clock[0] += 1.0
    assert said == ['reading', 'fitting: 3 of 8, 5 s left', 'fitting: 6 of 8, 2 s left']
    clock[0] += 5.0
    for done in (1, 3):  # how long the first took is not known
        lines.show('diagnosing', done, 4)
        clock[0] += 6.0
    assert said[3:] == ['diagnosing: 1 of 4', 'diagnosing: 3 of 4, 3 s left']


@compiled
def plus(x: float) -> float:
    return x + 1.0


@compiled
def minus(x: float) -> float:
    return x - 1.0


def test_compiling_is_said_once_and_only_when_something_is_compiled() -> None:
    said: list[str] = []
    with compiling_said(said.append):
        assert said == []
        assert plus(1.0) == 2.0
        assert minus(1.0) == 0.0
        assert plus(2.0) == 3.0
    assert len(said) == 1
    assert 'compiling, once' in said[0]


@pytest.mark.timeout(1200)  # all of a diagnosis may have to be compiled first
def test_a_pipe_is_told_in_plain_lines_on_stderr_alone(short_bag: Path) -> None:
    process = diagnosed(short_bag, stderr=subprocess.PIPE)
    document, said = process.communicate(timeout=900)
    assert process.returncode == 0
    assert json.loads(document)['verdict'] == 'one_of'
    first, *_ = said.decode().splitlines()
    assert first == f'replaying {short_bag}'
    assert b'\x1b' not in said
    assert b'\r' not in said


@pytest.mark.timeout(1200)
def test_a_terminal_is_shown_a_bar_that_goes_away(short_bag: Path) -> None:
    controlling, terminal = pty.openpty()
    process = diagnosed(short_bag, stderr=terminal)
    os.close(terminal)
    shown = b''
    while True:
        try:
            part = os.read(controlling, 4096)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        shown += part
    os.close(controlling)
    assert process.stdout is not None
    document = process.stdout.read()
    process.stdout.close()
    assert process.wait(timeout=900) == 0
    assert json.loads(document)['verdict'] == 'one_of'
    text = re.sub(r'\x1b\[[0-9;?]*[A-Za-z]', '', shown.decode())
    assert 'replaying' in text
    assert 'comparing hypotheses' in text
    # the last of it is the result, without the bar
    assert 'comparing' not in text[text.rindex('Nothing is missing (') :]


@pytest.mark.parametrize('at_once', [True, False])
def test_nothing_done_is_nothing_divided(at_once: bool) -> None:
    said: list[str] = []
    lines = ProgressLines(said.append, every_s=0.0, at_once=at_once)
    lines.show('fitting', 0, 0)
    assert said == (['fitting'] if at_once else [])
