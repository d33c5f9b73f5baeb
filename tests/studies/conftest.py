# SPDX-License-Identifier: Apache-2.0
"""A ship to sail with."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope='session')
def ship_file() -> Path:
    return ROOT / 'config' / 'vitus_bering.yaml'
