# SPDX-License-Identifier: Apache-2.0
"""A few small coastdowns, and a folder that holds everything a folder can."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.fleet.find import BagToRead, find
from shipdrag_ros.fleet.job import BagJob, Identity, content_hash, identify

ROOT = Path(__file__).resolve().parents[2]
SHIP = ROOT / 'config' / 'vitus_bering.yaml'


@pytest.fixture(scope='session')
def bags(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Four coastdowns of a few minutes; the first is long enough for a diagnosis."""
    folder = tmp_path_factory.mktemp('bags')
    made = []
    for number in range(4):
        path = folder / f'run {number}.mcap'
        lead_in = '400' if number == 0 else '250'
        line = ['simulate', '--ship', str(SHIP), '-o', str(path), '--seed', str(number)]
        line += ['--lead-in', lead_in, '--duration', '500', '--speed', '7', '--rate', '0.5']
        assert main([*line, '--start', f'2026-0{number + 1}-01']) == 0
        made.append(path)
    return made


@pytest.fixture
def fleet_folder(bags: list[Path], tmp_path: Path) -> Path:
    """Sound bags, and all kinds of others: 3 recordings of one ship, 5 that cannot be read."""
    folder = tmp_path / 'fleet'
    bering, other = folder / 'bering' / '2026', folder / 'other'
    bering.mkdir(parents=True)
    other.mkdir()
    shutil.copy(SHIP, folder / 'bering' / 'ship.yaml')
    (folder / 'bering' / 'events.csv').write_text('date,kind,note\n2026-02-10,cleaning,Lisbon\n')
    for path in bags[1:]:  # without a diagnosis, which takes long
        shutil.copy(path, bering)
    shutil.copy(bags[1], bering / 'the same.mcap')
    (bering / 'notes.txt').write_text('no bag')
    (other / 'empty.mcap').touch()
    (other / 'fore\nign.mcap').write_text('no bag either')
    os.mkfifo(other / 'pipe.mcap')
    (other / 'endless.mcap').symlink_to('/dev/zero')
    (other / 'gone.mcap').symlink_to('nowhere')
    (other / 'loop').symlink_to(folder)
    return folder


def only_source(path: Path) -> BagToRead:
    """Return the one bag at a place."""
    (source,) = find([str(path)]).sources
    return source


def job_of(source: BagToRead) -> BagJob:
    """Return what is to be done for one bag."""
    identity = identify(source)
    assert isinstance(identity, Identity), identity
    return BagJob((source,), content_hash([identity.digest], source))
