# SPDX-License-Identifier: Apache-2.0
"""
Damaged logs: read or refused, and no value that stands in no untouched line.

The script `benchmarks/bad_imports.py` does the same with thousands of each.
"""

from __future__ import annotations

import importlib.util
import random
import sys
from pathlib import Path
from types import ModuleType

import pytest

from shipdrag_ros.errors import ShipdragError

BENCHMARKS = Path(__file__).resolve().parents[2] / 'benchmarks'
KINDS = (
    *('csv', 'csv_commas', 'nmea', 'candump', 'actisense', 'yacht_devices', 'canboat'),
    *('signalk', 'gpx', 'ardupilot', 'ulog', 'ros1', 'sqlite3'),
)
LIBRARIES = {'ardupilot': 'pymavlink', 'ulog': 'pyulog'}
SEEDS = 15


def _script() -> ModuleType:
    spec = importlib.util.spec_from_file_location('bad_imports', BENCHMARKS / 'bad_imports.py')
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    sys.modules['bad_imports'] = script  # where its dataclass looks
    sys.path.insert(0, str(BENCHMARKS))
    try:
        spec.loader.exec_module(script)
    finally:
        sys.path.remove(str(BENCHMARKS))
    return script


bad = _script()


@pytest.mark.parametrize('kind', KINDS)
def test_a_damaged_log_is_read_or_refused(tmp_path: Path, kind: str) -> None:
    if kind in LIBRARIES:
        pytest.importorskip(LIBRARIES[kind])
    name, data = bad.samples(tmp_path)[kind]
    path = tmp_path / name
    path.write_bytes(data)
    whole = bad.values_of(path)
    text = kind in bad.TEXTS
    above = bad.HEAD_LINES if kind.startswith('csv') or kind == 'gpx' else 0
    read = 0
    for seed in range(SEEDS):
        draw = random.Random(f'{kind} {seed}')
        made, touched = (
            bad.damaged_text(data, draw, above) if text else (bad.damaged_bytes(data, draw), 0)
        )
        path.write_bytes(made)
        try:
            found = bad.values_of(path)
        except ShipdragError as error:
            assert str(error)  # noqa: PT017
            continue
        read += 1
        if text:
            assert sum((found - whole).values()) <= bad.PER_LINE * touched, f'seed {seed}'
    assert read > 0
