# SPDX-License-Identifier: Apache-2.0
"""Every block of Python in docs/python.md and the README runs, in the order it stands there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'python.md'


@pytest.mark.timeout(600)  # on a machine where nothing is compiled yet
def test_the_blocks_run(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text(encoding='utf-8')
    blocks = re.findall(r'^```python\n([\s\S]*?)^```', text, flags=re.MULTILINE)
    assert len(blocks) == text.count('```') // 2 > 10
    known: dict[str, Any] = {}
    try:
        for block in blocks:
            exec(compile(block, PAGE.name, 'exec'), known)
    finally:
        plt.close('all')
    printed = capsys.readouterr().out
    assert '<Record: Vitus Bering, 1 run, 8404 messages>' in printed
    assert "'missing.mcap' does not exist" in printed
    assert {path.name for path in tmp_path.glob('*.png')} == {
        'resistance.png',
        'gap.png',
        'months.png',
    }
    assert (tmp_path / 'report.html').stat().st_size > 10_000


def test_the_block_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = PAGE.parents[1].joinpath('README.md').read_text(encoding='utf-8')
    (block,) = re.findall(r'^```python\n([\s\S]*?)^```', text, flags=re.MULTILINE)
    try:
        exec(compile(block, 'README.md', 'exec'), {})
    finally:
        plt.close('all')
    assert 'fouling' in capsys.readouterr().out
