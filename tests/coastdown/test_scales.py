# SPDX-License-Identifier: Apache-2.0
"""A log in a wrong scale shows beside a track, and a current does not look like one."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.scales import scaled
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship

SHIP = Ship.from_yaml('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n', subject='test')
START_NS = 1_700_000_000 * 10**9
KNOTS = 3600.0 / 1852.0
LOG_ODDS_OF_NINE = 6.1  # ratio of evidences with which 2 % become nine to one


def doubts(
    *,
    log: float,
    current_m_s: float = 0.0,
    ground: float | None = None,
    geodetic: bool = False,
    speed_m_s: float = 10.0,
    slowing_m_s2: float = 0.0,
    seconds: int = 300,
) -> dict[str, str]:
    """Say what a monitor says of a log, and a speed over ground, by how they read."""
    rng = np.random.default_rng(1)
    time_s = np.arange(seconds)
    stamps = START_NS + time_s * 10**9
    water = speed_m_s - slowing_m_s2 * time_s
    over_ground = water + current_m_s
    way = np.column_stack([np.cumsum(over_ground), np.zeros(seconds)])
    way += rng.normal(0.0, 1.0, way.shape)
    if geodetic:
        track = Block.of(Channel.POSITION_GEODETIC, stamps, np.degrees(way / 6.371e6) + 50.0)
    else:
        track = Block.of(Channel.POSITION, stamps, way)
    noise = rng.normal(0.0, 0.05, (2, seconds))
    blocks = [track, Block.of(Channel.SPEED_THROUGH_WATER, stamps, log * water + noise[0])]
    if ground is not None:
        reading = ground * over_ground + noise[1]
        blocks.append(Block.of(Channel.SPEED_OVER_GROUND, stamps, reading))
    monitor = Monitor(SHIP, Parameters())
    monitor.update(in_arrival_order(blocks))
    return monitor.doubts()


@pytest.mark.parametrize(
    ('log', 'words'),
    [
        (KNOTS, 'knots over m/s (1.94)'),
        (1.0 / KNOTS, 'm/s over knots (0.51)'),
        (3.6, 'km/h over m/s (3.60)'),
        (1.852, 'km/h over knots (1.85)'),
    ],
)
def test_a_log_in_another_unit_is_named_with_its_ratio(log: float, words: str) -> None:
    found = doubts(log=log)
    assert set(found) == {'speed_through_water'}
    assert words in found['speed_through_water']
    assert 'unit' in found['speed_through_water']
    assert words in doubts(log=log, geodetic=True)['speed_through_water']


def test_the_one_that_is_wrong_is_named() -> None:
    found = doubts(log=1.0, ground=KNOTS)
    assert set(found) == {'speed_over_ground'}
    assert 'current' not in found['speed_over_ground']
    assert set(doubts(log=KNOTS, ground=1.0)) == {'speed_through_water'}


def test_a_log_in_knots_in_a_current_is_still_named() -> None:
    assert 'knots over m/s' in doubts(log=KNOTS, current_m_s=0.4)['speed_through_water']


@pytest.mark.parametrize('current_m_s', [0.0, 1.5, -2.0])
def test_a_current_and_a_log_that_is_off_are_no_unit(current_m_s: float) -> None:
    assert doubts(log=1.0, current_m_s=current_m_s) == {}
    assert doubts(log=1.1, current_m_s=0.0) == {}


def test_nothing_is_said_of_a_slow_ship_or_too_soon() -> None:
    assert doubts(log=KNOTS, speed_m_s=0.8) == {}
    assert doubts(log=KNOTS, seconds=40) == {}


@pytest.mark.parametrize('current_m_s', [1.5, 2.5])
def test_before_she_slows_a_scale_and_a_current_look_alike_and_nothing_is_said(current_m_s):
    steady = np.full(13, 5.0)
    assert scaled(steady, steady + current_m_s).log_odds < LOG_ODDS_OF_NINE
    slow = np.linspace(3.0, 5.0, 13)  # the newest first
    assert scaled(slow, slow + current_m_s).log_odds < 0.0
    assert scaled(slow * steady[0] / (steady[0] + current_m_s), slow).log_odds > 3.0


@pytest.mark.parametrize('times', [0.4, 0.6, 1.5, 1.7])
def test_the_scale_is_found_within_a_tenth_once_she_slows(times: float) -> None:
    glide = 5.0 / (1.0 + np.linspace(1.5, 0.0, 13))
    assert scaled(times * glide, glide).scale == pytest.approx(times, rel=0.1)


@pytest.mark.parametrize('error', [0.95, 1.05])
@pytest.mark.parametrize('current_m_s', [0.0, -1.5, 1.5])
def test_a_log_that_is_5_percent_off_is_sound(error: float, current_m_s: float) -> None:
    glide = 5.0 / (1.0 + np.linspace(1.0, 0.0, 13))
    assert scaled(error * glide, glide + current_m_s).log_odds < 0.0
