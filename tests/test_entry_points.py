# SPDX-License-Identifier: Apache-2.0
"""What a stranger's package declares is used as the library's own; broken ones break nothing."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).resolve().parents[1] / 'docs' / 'example_effect'
PIP = (
    *('-m', 'pip', 'install', '--quiet', '--disable-pip-version-check', '--no-index', '--no-deps'),
    '--no-build-isolation',
)
USE = """
from pathlib import Path
import shipdrag_ros as sd
ship = sd.Ship.example()
record = sd.simulate(ship, ['fishing_net=6e4'], duration_s=600.0, lead_in_s=400.0)
found = sd.diagnose(record)
Path('ship.yaml').write_text(found.ship_with_effects().to_yaml())
(written,) = sd.Ship.load('ship.yaml').effects
print(found.verdict, *(each.name for each in found.effects), written.name)
print(*(f'{each.value:.0f} {each.sd:.0f}' for each in written.parameters.values()))
"""


def run(folder: Path, *line: str) -> subprocess.CompletedProcess[str]:
    """Run Python where what was installed into a folder is found."""
    paths = os.pathsep.join([str(folder), os.environ.get('PYTHONPATH', '')])
    return subprocess.run(
        [sys.executable, *line],
        cwd=folder,
        env={**os.environ, 'PYTHONPATH': paths},
        capture_output=True,
        text=True,
        check=True,
    )


def test_an_effect_of_an_installed_package_is_simulated_named_and_written(tmp_path: Path) -> None:
    source, target = tmp_path / 'source', tmp_path / 'target'
    shutil.copytree(EXAMPLE, source)
    run(tmp_path, *PIP, '--target', str(target), str(source))
    named, sized = run(target, '-c', USE).stdout.splitlines()
    assert named == 'named fishing_net fishing_net'
    value, sd = map(float, sized.split())
    assert abs(value - 6e4) < 3.0 * sd < 9e3


STRANGER = """
from dataclasses import replace
from shipdrag_ros.studies.s1.estimators.s1_speed import ESTIMATOR as PUBLISHED
ESTIMATOR = replace(PUBLISHED, name='mine', meaning='an estimator of mine')
"""
POINTS = """
[shipdrag.formats]
bad = no_module:FORMAT
none = stranger:ESTIMATOR
[shipdrag.effects]
broken = no_module:EFFECT
[shipdrag.papers]
paper = no_module:STUDY
[shipdrag.estimators]
mine = stranger:ESTIMATOR
lost = stranger:NOTHING
"""
LOOK = """
from shipdrag_ros.cli import main
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.estimators import named
from shipdrag_ros.parameters import Parameters
assert main(['import', 'log.csv', '-o', 'log.mcap', '--json', 'log.json']) == 0
assert main(['import', 'log.csv', '-o', 'again.mcap', '--json', 'log.json']) == 0
assert main(['doctor', '--json', 'doctor.json']) == 0
chosen = Parameters.from_mapping({'estimator': 'mine'}, subject='')
print(named(chosen.estimator).meaning)
try:
    named('lost')
except EstimationError as error:
    print(error)
"""


def test_what_cannot_be_imported_is_left_out_and_named_by_doctor(tmp_path: Path) -> None:
    about = tmp_path / 'stranger-1.0.dist-info'
    about.mkdir()
    (about / 'METADATA').write_text('Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n')
    (about / 'entry_points.txt').write_text(POINTS)
    (tmp_path / 'stranger.py').write_text(STRANGER)
    (tmp_path / 'log.csv').write_text('time,speed_through_water\n0,8\n1,7.9\n')
    done = run(tmp_path, '-c', LOOK)
    *_, mine, lost = done.stdout.splitlines()
    assert mine == 'an estimator of mine'
    why = "'lost' (stranger:NOTHING) of shipdrag.estimators is left out: module 'stranger' has no"
    assert lost.startswith(f"the estimator 'lost' cannot be used: {why}")
    found = json.loads((tmp_path / 'doctor.json').read_text())['findings']
    told = [each['found'] for each in found if each['what'] == 'package stranger']
    for what, reason in (
        ("'bad' (no_module:FORMAT) of shipdrag.formats", "No module named 'no_module'"),
        ("'none' (stranger:ESTIMATOR) of shipdrag.formats", "Estimator(name='mine'"),
        ("'broken' (no_module:EFFECT) of shipdrag.effects", "No module named 'no_module'"),
        ("'paper' (no_module:STUDY) of shipdrag.papers", "No module named 'no_module'"),
        ("'lost' (stranger:NOTHING) of shipdrag.estimators", "module 'stranger' has no"),
    ):
        assert sum(f'{what} is left out: {reason}' in each for each in told) == 1
        assert done.stderr.count(f'{what} is left out: {reason}') == 1
    assert len(told) == 5
    assert done.stderr.count("mend or uninstall the package 'stranger'") == 5
