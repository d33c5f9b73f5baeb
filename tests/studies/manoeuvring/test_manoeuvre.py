# SPDX-License-Identifier: Apache-2.0
"""Manoeuvres by name, and the figures that published ones have."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.studies.manoeuvring.ship import mariner
from shipdrag_ros.studies.manoeuvring.simulate import (
    Side,
    overshoots_rad,
    parse,
    steer,
    turn,
    zigzag,
)

SHIP = mariner()


APPROACH_S = 10.0  # rudder amidships, then the first order: as the published figures count


@pytest.mark.parametrize(
    ('angle', 'to_starboard', 'to_port'), [(15, 6.79, 5.61), (20, 7.79, 6.35), (25, 8.85, 7.01)]
)
def test_zigzags_overshoot_as_published_to_the_last_digit(angle, to_starboard, to_port):
    # first to starboard, the helmsman looks every 0.1 s; the largest to each side is meant: of
    # 15/15 to starboard the third
    manoeuvre = zigzag(angle)
    motion = steer(SHIP, manoeuvre, approach_s=APPROACH_S)[0]
    over = np.degrees(overshoots_rad(motion, manoeuvre))
    assert max(over[::2]) == pytest.approx(to_starboard, abs=0.006)
    assert max(over[1::2]) == pytest.approx(to_port, abs=0.006)
    # without the approach the looks fall otherwise, and one look is worth 0.1 degrees
    prompt = np.degrees(overshoots_rad(steer(SHIP, manoeuvre)[0], manoeuvre))
    assert 0.001 < abs(prompt[0] - over[0]) < 0.1


def circle(motion):
    """Advance at a change of heading by 90 degrees, tactical diameter at one by 180 [m]."""
    turned = np.degrees(np.abs(motion.heading_rad))
    return [
        float(np.interp(at, turned, np.abs(way)))
        for at, way in zip((90.0, 180.0), motion.position_m.T)
    ]


def test_a_turning_circle_is_as_wide_as_published():
    motion = steer(SHIP, turn(35.0), approach_s=APPROACH_S)[0]
    assert circle(motion) == pytest.approx([566.0, 1029.0], abs=0.5)
    np.testing.assert_array_equal(motion.position_m[0], 0.0)
    assert motion.rudder_rad[0] == 0.0
    # the propeller turns her before the order
    assert 0.0 < motion.heading_rad[0] < np.radians(1.0)


def test_to_port_the_ship_turns_wider():
    wide = turn(35.0, first=Side.PORT)
    motion = steer(SHIP, wide)[0]
    assert motion.position_m[100, 1] < 0.0
    advance_m, diameter_m = circle(motion)
    assert 566.0 < advance_m < 620.0
    assert 1029.0 < diameter_m < 1100.0


def test_overshoots_are_of_the_motion_between_its_samples():
    manoeuvre = zigzag(20.0)
    coarse = overshoots_rad(steer(SHIP, manoeuvre)[0], manoeuvre)
    fine = overshoots_rad(steer(SHIP, manoeuvre, sample_s=0.1, samples=6000)[0], manoeuvre)
    np.testing.assert_allclose(coarse, fine[: len(coarse)], rtol=0, atol=1e-5)


def test_a_ship_that_does_not_turn_as_far_has_no_overshoot():
    assert len(overshoots_rad(steer(SHIP, zigzag(15.0), samples=20)[0], zigzag(15.0))) == 0


@pytest.mark.parametrize('manoeuvre', [zigzag(15.0), zigzag(7.5), turn(35.0)])
def test_names_are_read_back(manoeuvre):
    assert parse(manoeuvre.name) == manoeuvre
