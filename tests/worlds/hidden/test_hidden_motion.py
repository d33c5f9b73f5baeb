# SPDX-License-Identifier: Apache-2.0
"""The hidden hulls move as physics and the package's own simulation have it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.worlds.hidden.effect import Leg
from benchmarks.worlds.hidden.hull import draw_hull
from benchmarks.worlds.hidden.library import FIRST_SHELF, SECOND_SHELF
from benchmarks.worlds.hidden.outside import OUTSIDE
from benchmarks.worlds.hidden.sailing import (
    TABLE_POINTS,
    Disturbance,
    Drive,
    World,
    integrate,
    sail,
)
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, simulate

HEADING_RAD = 0.6


@pytest.fixture(scope='module')
def leg():
    hull = draw_hull(np.random.default_rng(2))
    return Leg(hull, 1.0, 900.0, hull.speed_m_s)


def _sail(leg, *effects, sign=1.0, **world):
    return sail(
        replace(leg, sign=sign),
        effects,
        heading_rad=HEADING_RAD if sign > 0.0 else HEADING_RAD + np.pi,
        first_heading_rad=HEADING_RAD,
        world=World(**world),
        disturbance=Disturbance.none(leg),
    )


def _kinds():
    return (*FIRST_SHELF, *SECOND_SHELF, *OUTSIDE)


def _effect(kind, leg):
    return kind.of(leg, [np.sqrt(size.low * size.high) for size in kind.sizes])


def test_the_integrator_meets_the_closed_form_of_quadratic_drag() -> None:
    time = np.arange(0.0, 601.0)
    n, drag_1_m, speed = len(time), 3e-4, 8.0
    nothing, table = np.zeros(n), np.zeros(TABLE_POINTS)
    drive = Drive(
        time,
        nothing,
        np.full(n, drag_1_m),
        nothing,
        nothing,
        np.zeros((n, 2)),
        table,
        table,
        np.ones(TABLE_POINTS),
        0.05,
        30.0,
    )
    path = integrate(drive, speed)
    ratio = 1.0 + drag_1_m * speed * time
    np.testing.assert_allclose(path[:, 0], speed / ratio, rtol=1e-10)
    np.testing.assert_allclose(path[:, 2], np.log(ratio) / drag_1_m, rtol=1e-9, atol=1e-9)


def test_without_effects_it_coasts_as_the_package_simulates(leg) -> None:
    ship = Ship.from_yaml(leg.hull.ship_file(), subject='hidden')
    scenario = Scenario(
        speed_m_s=leg.speed_m_s,
        lead_in_s=1800.0,
        duration_s=leg.duration_s,
        heading_rad=HEADING_RAD,
    )
    truth, motion = simulate(ship, scenario), _sail(leg)
    time = truth.time_s - 1800.0
    speed = np.interp(time, motion.time_s, motion.surge_m_s)
    np.testing.assert_allclose(speed, truth.speed_through_water_m_s, rtol=0.0, atol=2e-3)
    way = np.interp(time, motion.time_s, motion.position_m[:, 0])
    np.testing.assert_allclose(way, truth.position_m[:, 0], rtol=0.0, atol=2.0)


@pytest.mark.parametrize('number', range(31))
def test_every_effect_is_seen_above_the_noise(leg, number: int) -> None:
    kinds = _kinds()
    assert len(kinds) == 31
    effect = _effect(kinds[number], leg)
    plain, with_it = _sail(leg), _sail(leg, effect)
    time = plain.time_s
    # late stamps are a shift of the log
    log = effect.log(leg, time, with_it.surge_m_s)
    log = np.interp(time - effect.log_delay_s(), time, log)
    mark = 2e4 * np.array([np.cos(HEADING_RAD + 0.3), np.sin(HEADING_RAD + 0.3)])
    radar = effect.radar(leg, time, with_it.position_m - mark)
    way = (radar - radar[0]) - (plain.position_m - plain.position_m[0])
    # means over a minute know the log to 0.01 m/s and the way to 5 m
    seen_by_log = np.max(np.abs(log - plain.surge_m_s)) > 0.1
    seen_by_radar = np.max(np.hypot(*way.T)) > 60.0
    assert seen_by_log or seen_by_radar


@pytest.mark.parametrize('name', ['current', 'wind', 'waves'])
def test_what_is_fixed_to_the_earth_turns_about_on_the_reciprocal_run(leg, name: str) -> None:
    kind = next(kind for kind in _kinds() if kind.name == name)
    effect = _effect(kind, leg)
    still, there, back = _sail(leg), _sail(leg, effect), _sail(leg, effect, sign=-1.0)
    way = [np.hypot(*motion.position_m[-1]) for motion in (there, still, back)]
    if name == 'current':
        assert way[0] > way[1] > way[2]
    else:
        assert way[0] < way[1] < way[2]


def test_a_worse_baseline_slows_down_sooner(leg) -> None:
    end = [_sail(leg, friction=error).surge_m_s[-1] for error in (-0.06, 0.0, 0.06)]
    assert end[0] > end[1] > end[2]
