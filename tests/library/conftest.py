# SPDX-License-Identifier: Apache-2.0
"""A simulated record, and the same as a bag in a file."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import pytest

import shipdrag_ros as sd

mpl.use('agg')


@pytest.fixture(scope='package')
def record() -> sd.Record:
    """400 s of steady sailing and 900 s from the stop on, with a log that reads too little."""
    return sd.simulate(
        sd.Ship.example(), {'log_scale': -0.15}, duration_s=900.0, lead_in_s=400.0, seed=3
    )


@pytest.fixture(scope='package')
def bag(record: sd.Record, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record.save(tmp_path_factory.mktemp('bag') / 'run.mcap')
