# SPDX-License-Identifier: Apache-2.0
"""An effect and an estimator of a stranger's package are found; broken ones break nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PACKAGE = """
from dataclasses import replace
from shipdrag_ros.studies.s1.estimators.s1_speed import ESTIMATOR as PUBLISHED
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.simulation.effect import Action
from shipdrag_ros.simulation.effect import Effect, Scope

def act(frame, force):
    return Action(wave_force_n=frame.earth(-force, 0.0))

BARGE = Effect(
    name='barge',
    scope=Scope.HULL,
    parameters=(Parameter(name="force_n", low=0.0, high=1e6, meaning='of the barge'),),
    formula='a constant force',
    source='mine',
    act=act,
)
ESTIMATOR = replace(PUBLISHED, name='mine', meaning='an estimator of mine')
"""
POINTS = """
[shipdrag.effects]
barge = stranger:BARGE
broken = no_module:EFFECT
[shipdrag.estimators]
mine = stranger:ESTIMATOR
lost = stranger:NOTHING
"""
USE = """
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.estimators import named
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.simulation.effects import parse
chosen = Parameters.from_mapping({'estimator': 'mine'}, subject='')
print(parse('barge=2').name, named(chosen.estimator).meaning)
try:
    named('lost')
except EstimationError as error:
    print(error)
"""


def test_those_of_another_package_are_found_and_broken_ones_are_named(tmp_path: Path) -> None:
    about = tmp_path / 'stranger-1.0.dist-info'
    about.mkdir()
    (about / 'METADATA').write_text('Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n')
    (about / 'entry_points.txt').write_text(POINTS)
    (tmp_path / 'stranger.py').write_text(PACKAGE)
    paths = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    done = subprocess.run(
        [sys.executable, '-c', USE],
        env={**os.environ, 'PYTHONPATH': paths},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith('barge an estimator of mine\n')
    assert "the estimator 'lost' cannot be loaded: AttributeError" in done.stdout
    assert "'broken' (no_module:EFFECT) of shipdrag.effects is left out: No module" in done.stderr
