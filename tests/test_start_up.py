# SPDX-License-Identifier: Apache-2.0
"""What a start does not pay for: modules that are slow to import and seldom needed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from shipdrag_ros.cli import verbs

ROOT = Path(__file__).resolve().parents[1]
SLOW = {
    'jinja2',
    'matplotlib',
    'scipy.interpolate',
    'scipy.linalg',
    'scipy.optimize',
    'scipy.special',
    'scipy.stats',
    'shipdrag_ros.bags.check',
    'shipdrag_ros.diagnosis',
    'shipdrag_ros.sources',
    'shipdrag_ros.report',
    'shipdrag_ros.studies.residual.fit',
    'shipdrag_ros.studies.sensitivity.loss',
}


def after(code: str) -> set[str]:
    """Return the modules that a process has imported."""
    code += '; import sys; print(*sys.modules)'
    line = [sys.executable, '-c', code]
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_replay_imports_nothing_that_a_bag_may_not_need() -> None:
    found = after('from shipdrag_ros.cli import parser; parser("replay")')
    assert 'shipdrag_ros.coastdown.monitor' in found
    assert found & SLOW == set()


def test_the_node_imports_nothing_that_no_coastdown_needs() -> None:
    pytest.importorskip('rclpy')
    found = after('import shipdrag_ros.node.main')
    assert 'shipdrag_ros.coastdown.monitor' in found
    assert found & SLOW == set()


@pytest.mark.parametrize('verb', [each.name for each in verbs()])
def test_a_verb_is_known_before_what_it_needs_is_imported(verb: str) -> None:
    """Its help, its completion and a wrong option come in half a second."""
    found = after(f'from shipdrag_ros.cli import parser; parser({verb!r})')
    slow = {'matplotlib', 'scipy.interpolate', 'scipy.linalg', 'scipy.optimize', 'scipy.stats'}
    slow |= {'rosbags.typesys.stores.ros2_dashing', 'shipdrag_ros.diagnosis.diagnose', 'uvicorn'}
    assert found & slow == set()


def test_what_is_imported_is_compiled_when_it_is_called() -> None:
    code = (
        'from shipdrag_ros import compiled; import shipdrag_ros.coastdown.monitor; '
        'many = len(compiled._waiting); assert many > 1; compiled.compile_all(); '
        'assert not compiled._waiting'
    )
    after(code)
