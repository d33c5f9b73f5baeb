# SPDX-License-Identifier: Apache-2.0
"""`shipdrag learn`: exit 0 and no file where nothing may be written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from shipdrag_ros.cli import main

SHIP = Path(__file__).resolve().parents[2] / 'config' / 'vitus_bering.yaml'


def test_one_clean_run_writes_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag, out, page = (tmp_path / name for name in ('run.mcap', 'new.yaml', 'page.html'))
    assert main(['simulate', '--ship', str(SHIP), '-o', str(bag)]) == 0
    capsys.readouterr()
    assert main(['learn', str(bag), '-o', str(out), '--report', str(page), '--json']) == 0
    said = capsys.readouterr()
    document = json.loads(said.out)
    assert document['learnt'] is None
    assert document['reason']
    assert 'is not written' in said.err
    assert not out.exists()
    assert page.exists()


@pytest.mark.parametrize('name', ['fouling', 'Kelp', '../kelp'])
def test_a_name_that_cannot_be_is_refused_before_the_work(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ['learn', str(tmp_path / 'none.mcap'), '-o', str(tmp_path / 'a.yaml'), '--name', name]
    assert main(line) == 1
    assert 'name' in capsys.readouterr().err
