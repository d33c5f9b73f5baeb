# SPDX-License-Identifier: Apache-2.0
"""Why no coastdown was found is said of what is in the bag."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.replay import replay, why_no_coastdown
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import ConstantAddedMass, Ship
from tests.runs import write_run

BOAT = Ship(length_m=10.0, displaced_volume_m3=5.0, added_mass=ConstantAddedMass(value=0.1))
STAMPS = 10**18 + np.arange(1800) * 10**9


@pytest.mark.parametrize(
    ('from_s', 'channel'),
    [
        (0, Channel.SPEED_THROUGH_WATER),
        (600, Channel.SPEED_THROUGH_WATER),
        (600, Channel.SPEED_OVER_GROUND_3),
    ],
)
def test_a_log_that_stands_still_is_told(tmp_path: Path, from_s: int, channel: Channel) -> None:
    speed = 4.0 + 0.01 * np.random.default_rng(1).standard_normal(len(STAMPS))
    speed[from_s:] = 4.017
    path = write_run(tmp_path / 'a.mcap', Block.of(channel, STAMPS, speed))
    (run,) = open_runs([path])
    why = why_no_coastdown(replay(run, ship=BOAT))
    minutes = (1799 - from_s) / 60.0
    assert f'{channel.input} stood still at 4.02 m/s for {minutes:.0f} min' in why


@pytest.mark.parametrize('steady', [0.0, 4.0])
def test_a_log_at_work_and_a_ship_at_rest_do_not_stand_still(tmp_path, steady: float) -> None:
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(STAMPS))
    speed = steady + noise if steady else np.zeros(len(STAMPS))
    path = write_run(tmp_path / 'a.mcap', Block.of(Channel.SPEED_THROUGH_WATER, STAMPS, speed))
    (run,) = open_runs([path])
    assert 'stood still' not in why_no_coastdown(replay(run, ship=BOAT))


@pytest.mark.parametrize('lead_s', [40, 90])
def test_as_much_steady_sailing_is_asked_for_as_the_monitor_needs(tmp_path, lead_s: int) -> None:
    time_s = np.arange(400)
    # she gathers a little way, then brakes
    speed = np.interp(time_s, [0, lead_s, lead_s + 60, 400], [4.0, 4.1, 2.0, 1.9])
    log = Block.of(Channel.SPEED_THROUGH_WATER, STAMPS[:400], speed)
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', log)])
    result = replay(run, ship=BOAT)
    why = why_no_coastdown(replace(result, coastdowns=(), events=(), steady_lead_s=None))
    assert 'the speed by speed_through_water fell most' in why
    needed_s = result.parameters.slope_window_s
    assert (f'at least {needed_s:.0f} s of steady sailing' in why) == (lead_s < needed_s)
