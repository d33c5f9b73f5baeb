# SPDX-License-Identifier: Apache-2.0
"""The shells themselves are asked what they would complete."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from shipdrag_ros.cli import main, verbs
from shipdrag_ros.cli.installation import SHELLS, script

LIMIT_S = 200
PROGRAM = [sys.executable, '-m', 'shipdrag_ros.cli']


def asked(*line: str) -> str:
    return subprocess.run(line, capture_output=True, text=True, timeout=LIMIT_S, check=True).stdout


@pytest.fixture
def written(tmp_path: Path) -> Path:
    path = tmp_path / 'shipdrag'
    path.write_text(script('bash'))
    return path


@pytest.mark.parametrize(
    ('words', 'expected'),
    [
        ('dia', {'diagnose'}),
        ('', {verb.name for verb in verbs()}),
        ('diagnose --f', {'--fact'}),
        ('completion ', set(SHELLS)),
    ],
)
def test_bash(written: Path, words: str, expected: set[str]) -> None:
    typed = ' '.join(f"'{word}'" for word in ['shipdrag', *words.split(' ')])
    code = (
        f'source {written}; COMP_WORDS=({typed}); COMP_CWORD=$((${{#COMP_WORDS[@]}}-1)); '
        '_shtab_shipdrag; echo "${COMPREPLY[@]}"'
    )
    assert expected <= set(asked('bash', '--norc', '-c', code).split())


def test_fish_and_zsh_take_it(tmp_path: Path) -> None:
    shells = [shell for shell in ('fish', 'zsh') if shutil.which(shell)]
    if not shells:
        pytest.skip('neither fish nor zsh is installed')
    for shell in shells:
        path = tmp_path / f'shipdrag.{shell}'
        path.write_text(script(shell))
        asked(shell, '-n', str(path))
    if 'fish' in shells:
        code = f"source {tmp_path / 'shipdrag.fish'}; complete -C 'shipdrag dia'"
        assert 'diagnose' in asked('fish', '--no-config', '-c', code)


def test_to_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / '_shipdrag'
    assert main(['completion', 'zsh', '-o', str(out)]) == 0
    assert 'completes shipdrag in zsh' in capsys.readouterr().out
    assert out.read_text().startswith('#compdef shipdrag')


def test_a_reader_that_goes_away_is_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)  # before a word is written: a pipe would hold all of it
    done = subprocess.run(
        [*PROGRAM, 'completion', 'zsh'],
        stdout=writer,
        stderr=subprocess.PIPE,
        timeout=LIMIT_S,
        check=False,
    )
    os.close(writer)
    assert done.stderr == b''
    assert done.returncode == 141
