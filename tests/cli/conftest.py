# SPDX-License-Identifier: Apache-2.0
"""Bags of a ship that coasts, and of one that sails on."""

from __future__ import annotations

from pathlib import Path

import pytest

from shipdrag_ros.cli import main


@pytest.fixture(scope='session')
def coastdown_bag(ship_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated coastdown, 300 s of steady sailing and 1500 s from 8 m/s down."""
    path = tmp_path_factory.mktemp('simulated') / 'coastdown.mcap'
    line = ['simulate', '--ship', str(ship_file), '-o', str(path), '--speed', '8', '--seed', '3']
    assert main([*line, '--lead-in', '300']) == 0
    return path


@pytest.fixture(scope='session')
def steady_bag(ship_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Steady sailing that ends a second after the engine is stopped."""
    path = tmp_path_factory.mktemp('simulated') / 'steady.mcap'
    line = ['simulate', '--ship', str(ship_file), '-o', str(path), '--duration', '1']
    assert main([*line, '--lead-in', '300']) == 0
    return path
