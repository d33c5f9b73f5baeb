# SPDX-License-Identifier: Apache-2.0
"""If the engine were stopped now: the glide is the one that a simulated stop then makes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.forecast.foretell import HullNow, if_stopped
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.ship.sections import Propulsion
from shipdrag_ros.simulation import START_NS, Scenario, Truth, simulate

SPEED_M_S = 7.0
FOULED = StatedEffect('fouling', {'friction_factor': Parameter(0.4, 0.05)})


@pytest.fixture(scope='module')
def ship() -> Ship:
    return replace(Ship.example(), propulsion=Propulsion(20.0, 5.0))


def glide(ship: Ship) -> Truth:
    return simulate(ship, Scenario(speed_m_s=SPEED_M_S, lead_in_s=1.0, duration_s=2400.0))


@pytest.mark.parametrize('effects', [(), (FOULED,)])
def test_she_glides_as_it_was_foretold(ship: Ship, effects: tuple[StatedEffect, ...]) -> None:
    ship = replace(ship, effects=effects)
    hull = HullNow.of_file(ship)
    assert ('fouling' in hull.source) == bool(effects)
    truth = glide(ship)
    found = if_stopped(hull, ship, SPEED_M_S, START_NS)
    compared = [each for each in found.milestones if each.speed_m_s > 2.5]
    assert len(compared) >= 3
    way = np.hypot(*(truth.position_m - truth.position_m[0]).T)
    for each in compared:
        at = float(np.interp(-each.speed_m_s, -truth.speed_through_water_m_s, truth.time_s)) - 1.0
        far = float(np.interp(at + 1.0, truth.time_s, way)) - SPEED_M_S
        assert each.time_s.low < at < each.time_s.high
        assert each.time_s.median == pytest.approx(at, rel=0.05)
        assert each.distance_m.median == pytest.approx(far, rel=0.05)


def test_a_run_is_known_better_than_the_file_that_it_contradicts(ship: Ship) -> None:
    fouled = glide(replace(ship, effects=(FOULED,)))
    speed = np.linspace(2.0, SPEED_M_S, 30)
    r = fouled.specific_resistance(speed)
    hull = HullNow.of_run(speed, r, 0.02 * r, 'the last run')
    later = if_stopped(HullNow.of_file(ship), ship, SPEED_M_S, START_NS).reaches(4.0).time_s
    sooner = if_stopped(hull, ship, SPEED_M_S, START_NS).reaches(4.0).time_s
    was = float(np.interp(-4.0, -fouled.speed_through_water_m_s, fouled.time_s)) - 1.0
    assert sooner.median == pytest.approx(was, rel=0.03)
    assert later.median > 1.1 * was


def test_a_longer_run_down_delays(ship: Ship) -> None:
    hull = HullNow.of_file(ship)
    longer = replace(ship, propulsion=Propulsion(60.0, 5.0))
    one, other = (
        if_stopped(hull, each, SPEED_M_S, START_NS).reaches(4.0) for each in (ship, longer)
    )
    assert 40.0 < other.time_s.median - one.time_s.median < 80.0
    assert other.distance_m.median - one.distance_m.median > 40.0 * 4.0


def test_why_nothing_is_foretold(ship: Ship) -> None:
    with pytest.raises(EstimationError, match='neither a coastdown nor a baseline'):
        HullNow.of_file(replace(ship, baseline=None))
    with pytest.raises(EstimationError, match='makes no way'):
        if_stopped(HullNow.of_file(ship), ship, 0.0, START_NS)
