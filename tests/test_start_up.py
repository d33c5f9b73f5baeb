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


# each in a process of its own, which begins with what all of them import
EACH = """
import os, sys
import numpy
import shipdrag_ros.cli
for code in sys.argv[1:]:
    if not (child := os.fork()):
        exec(code)
        print(*sys.modules, flush=True)
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        sys.exit(1)
"""


def after(*codes: str) -> list[set[str]]:
    """Return the modules that a process of each code has imported."""
    line = [sys.executable, '-c', EACH, *codes]
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=True)
    return [set(modules.split()) for modules in done.stdout.splitlines()]


def test_replay_imports_nothing_that_a_bag_may_not_need() -> None:
    (found,) = after('from shipdrag_ros.cli import parser; parser("replay")')
    assert 'shipdrag_ros.coastdown.monitor' in found
    assert found & SLOW == set()


def test_the_node_imports_nothing_that_no_coastdown_needs() -> None:
    pytest.importorskip('rclpy')
    (found,) = after('import shipdrag_ros.node.main')
    assert 'shipdrag_ros.coastdown.monitor' in found
    assert found & SLOW == set()


def test_a_verb_is_known_before_what_it_needs_is_imported() -> None:
    """Its help, its completion and a wrong option come in half a second."""
    names = [each.name for each in verbs()]
    found = after(*(f'shipdrag_ros.cli.parser({name!r})' for name in names))
    slow = {'matplotlib', 'scipy.interpolate', 'scipy.linalg', 'scipy.optimize', 'scipy.stats'}
    slow |= {'rosbags.typesys.stores.ros2_dashing', 'shipdrag_ros.diagnosis.diagnose', 'uvicorn'}
    assert {name: many & slow for name, many in zip(names, found) if many & slow} == {}


def test_what_is_imported_is_compiled_when_it_is_called() -> None:
    code = (
        'from shipdrag_ros import compiled; import shipdrag_ros.coastdown.monitor; '
        'many = len(compiled._waiting); assert many > 1; compiled.compile_all(); '
        'assert not compiled._waiting'
    )
    after(code)
