# SPDX-License-Identifier: Apache-2.0
"""A window given by hand says what would have ended a coastdown that was watched."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import BagWriter, open_runs, replay
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship

START_NS = 1_700_000_000_000_000_000
BOAT = Ship(length_m=10.0, displaced_volume_m3=5.0, added_mass=ConstantAddedMass(value=0.1))


def notes(path: Path, yaw_rad: np.ndarray, parameters: Parameters) -> str:
    """Coast for 100 s with this heading, and after 100 s turn right round."""
    time_s = np.arange(200.0)
    stamps = START_NS + (time_s * 1e9).astype(np.int64)
    speed = 4.0 / (1.0 + time_s / 50.0) + np.random.default_rng(1).normal(0.0, 0.01, 200)
    yaw = np.concatenate([yaw_rad, np.linspace(yaw_rad[-1], yaw_rad[-1] + 3.0, 100)])
    yaw = np.arctan2(np.sin(yaw), np.cos(yaw))
    with BagWriter(path) as bag:
        bag.write_samples(
            in_arrival_order(
                [
                    Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed),
                    Block.of(Channel.HEADING, stamps, yaw),
                ]
            )
        )
    (run,) = open_runs([path])
    (coastdown,) = replay(run, ship=BOAT, parameters=parameters, window=(0.0, 99.0)).coastdowns
    assert coastdown.estimate is not None, coastdown.failure
    return ' '.join(coastdown.estimate.notes)


@pytest.mark.parametrize(
    ('swing_deg', 'turn_rad', 'told'),
    [(30.0, 0.35, True), (30.0, 0.6, False), (15.0, 0.35, False)],
)
def test_a_turn_inside_the_window(
    tmp_path: Path, swing_deg: float, turn_rad: float, told: bool
) -> None:
    # across the cut at 180 degrees, where the reading jumps
    yaw = np.pi - 0.1 + np.linspace(0.0, np.radians(swing_deg), 100)
    said = notes(tmp_path / 'a.mcap', yaw, Parameters(turn_rad=turn_rad))
    assert (f'swings over {swing_deg:.0f} degrees' in said) is told
    assert ('swings' in said) is told
