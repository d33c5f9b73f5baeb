# SPDX-License-Identifier: Apache-2.0
"""If she were stopped now: the present speed is that of any log, or of any speed over ground."""

from __future__ import annotations

import numpy as np
import pytest

import shipdrag_ros as sd
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from tests.runs import write_run

STAMPS = 10**18 + np.arange(300) * 10**9


@pytest.mark.parametrize(
    ('channel', 'measured'),
    [
        (Channel.SPEED_THROUGH_WATER_2, 'through water'),
        (Channel.SPEED_OVER_GROUND_3, 'over ground'),
    ],
)
def test_the_second_of_a_kind_shows_the_present_speed(tmp_path, channel, measured):
    speed = 6.0 + 0.01 * np.random.default_rng(1).standard_normal(len(STAMPS))
    path = write_run(tmp_path / 'a.mcap', Block.of(channel, STAMPS, speed), Ship.example())
    found = sd.estimate(sd.read(path)).if_stopped_now()
    assert found.measured == measured
    assert found.forecast.speed_m_s[0] == pytest.approx(6.0, abs=0.02)


def test_a_ship_at_anchor_makes_no_way_whatever_her_log_adds(tmp_path):
    speed = np.full(len(STAMPS), 0.1)
    block = Block.of(Channel.SPEED_THROUGH_WATER, STAMPS, speed)
    found = sd.estimate(sd.read(write_run(tmp_path / 'a.mcap', block, Ship.example())))
    assert 'at 0.2 knots through water' in (said := found.if_stopped_now().summary())
    assert said.endswith('she makes no way ahead, there is no glide to foretell.')
