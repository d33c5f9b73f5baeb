# SPDX-License-Identifier: Apache-2.0
"""Damaged logs: read or refused, and no value that stands in no untouched line."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from shipdrag_ros.errors import ShipdragError
from tests.sources import damage as bad

KINDS = (
    *('csv', 'csv_commas', 'nmea', 'candump', 'actisense', 'yacht_devices', 'canboat'),
    *('signalk', 'gpx', 'ardupilot', 'ulog', 'ros1', 'sqlite3'),
)
LIBRARIES = {'ardupilot': 'pymavlink', 'ulog': 'pyulog'}
SEEDS = 15


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
