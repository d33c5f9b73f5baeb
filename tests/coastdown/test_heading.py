# SPDX-License-Identifier: Apache-2.0
"""A heading of the wrong convention shows in the course over ground."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship

SHIP = Ship.from_yaml('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n', subject='test')
START_NS = 1_700_000_000 * 10**9


def doubt(
    course_deg: float,
    sent_rad: float,
    *,
    convention: str = 'rep103',
    speed_m_s: float = 5.0,
    turn_rad_s: float = 0.0,
) -> str:
    """Say what a monitor says of two minutes of a heading and a track."""
    rng = np.random.default_rng(1)
    seconds = np.arange(150)
    stamps = START_NS + seconds * 10**9
    yaw = math.pi / 2 - math.radians(course_deg) + turn_rad_s * seconds
    way = np.cumsum(np.column_stack([np.cos(yaw), np.sin(yaw)]) * speed_m_s, axis=0)
    heading = sent_rad + turn_rad_s * seconds + rng.normal(0.0, 0.03, len(seconds))
    monitor = Monitor(SHIP, Parameters(heading_convention=convention))
    track = Block.of(Channel.POSITION, stamps, way + rng.normal(0.0, 0.5, way.shape))
    monitor.update(in_arrival_order([track, Block.of(Channel.HEADING, stamps, heading)]))
    return monitor.doubts().get('heading', '')


@pytest.mark.parametrize('course_deg', [0.0, 100.0, 180.0, 250.0, 330.0])
def test_a_compass_angle_sent_as_yaw_and_the_other_way_round(course_deg: float) -> None:
    compass = math.radians(course_deg)
    yaw = math.pi / 2 - compass
    assert doubt(course_deg, yaw) == ''
    assert doubt(course_deg, compass, convention='compass') == ''
    assert 'set heading_convention to compass' in doubt(course_deg, compass)
    assert 'set heading_convention to rep103' in doubt(course_deg, yaw, convention='compass')


def test_on_a_course_where_both_are_the_same_nothing_is_said() -> None:
    assert doubt(45.0, math.radians(45.0)) == ''


def test_an_axis_that_points_aft_is_neither() -> None:
    said = doubt(0.0, -math.pi / 2)
    assert '180 degrees off' in said
    assert 'heading_convention' not in said


def test_a_drift_a_turn_and_a_ship_that_lies_still_are_no_reason() -> None:
    yaw = math.pi / 2
    assert doubt(0.0, yaw + 0.3) == ''
    assert doubt(0.0, yaw + 1.5, speed_m_s=0.3) == ''
    assert doubt(0.0, yaw, turn_rad_s=0.05) == ''
