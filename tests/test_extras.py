# SPDX-License-Identifier: Apache-2.0
"""The base install is enough for the node; a verb without its extra says which to install."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from distutils.core import run_setup
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from shipdrag_ros.cli import main
from shipdrag_ros.imports import EXTRA_OF

ROOT = Path(__file__).resolve().parents[1]
SHIP = ROOT / 'config' / 'vitus_bering.yaml'
MODULE_OF = {'ros-jazzy-rclpy': 'rclpy'}  # where a module has another name than what brings it
BLOCK = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in BLOCKED:
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)

BLOCKED = set(sys.argv[1].split(','))
sys.meta_path.insert(0, Missing())
from shipdrag_ros.cli import main
sys.exit(next(filter(None, (main(line.split()) for line in sys.argv[2:])), 0))
"""
Shipdrag = Callable[..., 'subprocess.CompletedProcess[str]']


@pytest.fixture
def without(tmp_path: Path) -> Shipdrag:
    """Return what runs lines in one process in which some modules cannot be imported."""

    def run(blocked: set[str], *lines: str) -> subprocess.CompletedProcess[str]:
        line = [sys.executable, '-c', BLOCK, ','.join(blocked), *lines]
        return subprocess.run(
            line, cwd=tmp_path, capture_output=True, text=True, timeout=250, check=False
        )

    return run


def test_the_table_of_extras_is_that_of_the_package() -> None:
    stated = run_setup(str(ROOT / 'setup.py'), stop_after='init').extras_require
    for module, extra in EXTRA_OF.items():
        names = {Requirement(text).name for text in stated[extra]}
        assert module in {MODULE_OF.get(name, name).lower() for name in names}
    optional = {'report', 'watch', 'fleet', 'logs'}
    listed = {Requirement(text).name.lower() for extra in optional for text in stated[extra]}
    assert listed <= EXTRA_OF.keys()


@pytest.mark.timeout(300)
def test_the_base_simulates_replays_diagnoses_and_imports(without: Shipdrag, tmp_path) -> None:
    (tmp_path / 'ship.yaml').symlink_to(SHIP)
    rows = ''.join(f'{second},{8.0 - 0.001 * second}\n' for second in range(60))
    (tmp_path / 'log.csv').write_text('t,stw\n' + rows)
    done = without(
        set(EXTRA_OF),
        'simulate --ship ship.yaml -o run.mcap --lead-in 400 --duration 900',
        'info run.mcap',
        'check run.mcap',
        'replay run.mcap',
        'diagnose run.mcap',
        'import log.csv -o log.mcap --map speed_through_water=stw --time t',
    )
    assert done.returncode == 0, (done.stdout, done.stderr)


@pytest.mark.parametrize(
    ('extra', 'line'),
    [
        ('report', 'replay run.mcap --out out'),
        ('report', 'diagnose run.mcap --report out.html'),
        ('fleet', 'fleet . -o store'),
        ('fleet', 'trend store'),
        ('fleet', 'watch --store store'),
        ('watch', 'watch run.mcap'),
        ('ros', 'node --ship ship.yaml --out .'),
        ('logs', 'import can.log -o can.mcap'),
    ],
)
def test_a_verb_without_its_extra_says_which_to_install(without, tmp_path, extra, line):
    (tmp_path / 'ship.yaml').symlink_to(SHIP)
    (tmp_path / 'can.log').write_text('(1700000000.000000) can0 09F80101#A1B2C3D4E5F60708\n' * 40)
    if 'run.mcap' in line:
        bag = str(tmp_path / 'run.mcap')
        assert main(['simulate', '--ship', str(SHIP), '-o', bag, '--lead-in', '400']) == 0
    if 'store' in line and not line.startswith('fleet'):
        (tmp_path / 'store').mkdir()
    done = without({name for name, of in EXTRA_OF.items() if of == extra}, line)
    assert done.returncode == 1
    assert done.stderr.count('ERROR: ') == 1
    assert 'Traceback' not in done.stderr
    assert f'[{extra}]' in done.stderr


def test_another_missing_module_is_no_matter_of_extras(without: Shipdrag) -> None:
    done = without({'mcap'}, 'info run.mcap')
    assert 'Traceback' in done.stderr
