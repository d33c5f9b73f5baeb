# SPDX-License-Identifier: Apache-2.0
"""Surge motion against closed forms, energy and its own convergence."""

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import ShipdragError, SimulationError
from shipdrag_ros.ship import Air, Propulsion, Ship, StatedEffect, TableBaseline
from shipdrag_ros.simulation import STOP, EngineOrder, GaussMarkov, Scenario, Turn, simulate
from tests.runs import CARGO
from tests.simulation.conftest import N_R, quadratic

AT_ONCE = replace(CARGO, propulsion=None)


def test_quadratic_drag_has_its_closed_form():
    # v = v0 / (1 + v0 t / l), x = l ln(1 + v0 t / l), l = (1 + n_r) / drag
    truth = simulate(quadratic(3e-4), Scenario(speed_m_s=8.0, lead_in_s=100.0, duration_s=2000.0))
    length = (1.0 + N_R) / 3e-4
    after = np.maximum(truth.time_s - 100.0, 0.0)
    speed = 8.0 / (1.0 + 8.0 * after / length)
    distance = 800.0 + length * np.log1p(8.0 * after / length)
    late = truth.time_s >= 100.0
    np.testing.assert_allclose(truth.speed_through_water_m_s, speed, rtol=1e-7)
    np.testing.assert_allclose(truth.position_m[late, 0], distance[late], rtol=1e-7)
    np.testing.assert_allclose(truth.position_m[~late, 0], 8.0 * truth.time_s[~late], rtol=1e-12)
    np.testing.assert_array_equal(truth.position_m[:, 1], 0.0)


def test_deceleration_and_resistance_obey_the_definition():
    # S1 (1): r = -(1 + n_r) dv/dt
    truth = simulate(AT_ONCE, Scenario(speed_m_s=8.2, lead_in_s=0.0))
    t, v = truth.time_s, truth.speed_through_water_m_s
    slope = (v[2:] - v[:-2]) / (t[2:] - t[:-2])
    r = -(1.0 + AT_ONCE.n_r(v[1:-1])) * slope
    np.testing.assert_allclose(r, truth.specific_resistance(v[1:-1]), rtol=2e-5)
    np.testing.assert_array_equal(
        truth.specific_resistance(v), AT_ONCE.resistance_n(v) / AT_ONCE.mass_kg
    )


def test_integration_converges_with_the_fourth_power_of_the_step():
    scenario = Scenario(speed_m_s=8.2, lead_in_s=0.0, duration_s=1536.0)
    # friction alone: without the joints of a table the resistance is smooth
    friction = replace(CARGO.baseline, wave_coefficient=(0.0,) * 5)
    ship = replace(AT_ONCE, baseline=friction)

    def last_speed(step_s: float) -> float:
        return simulate(ship, scenario, step_s=step_s).speed_through_water_m_s[-1]

    coarse, middle, fine = last_speed(128.0), last_speed(64.0), last_speed(32.0)
    assert 14.0 < (coarse - middle) / (middle - fine) < 22.0
    assert abs(last_speed(0.5) - last_speed(0.25)) < 1e-11


def test_a_run_down_costs_the_impulse_that_it_gives():
    # to first order in time the ship is faster by r(v0) run_down / (1 + n_r)
    scenario = Scenario(speed_m_s=8.2, lead_in_s=0.0, duration_s=60.0)
    short = simulate(replace(CARGO, propulsion=Propulsion(0.5)), scenario)
    at_once = simulate(AT_ONCE, scenario)
    gain = short.speed_through_water_m_s[-1] - at_once.speed_through_water_m_s[-1]
    expected = at_once.specific_resistance(8.2) * 0.5 / (1.0 + CARGO.n_r(8.2))
    assert 0.5 * expected < gain < expected


def test_a_current_moves_the_position_but_not_the_log():
    scenario = Scenario(speed_m_s=8.2, lead_in_s=60.0, heading_rad=0.7)
    calm = simulate(replace(CARGO, air=None), scenario)
    carried = simulate(replace(CARGO, air=None), replace(scenario, current_m_s=(0.4, -0.3)))
    np.testing.assert_array_equal(carried.speed_through_water_m_s, calm.speed_through_water_m_s)
    drift = np.outer(calm.time_s, [0.4, -0.3])
    np.testing.assert_allclose(carried.position_m - calm.position_m, drift, atol=1e-8)
    np.testing.assert_allclose(
        carried.velocity_over_ground_m_s - calm.velocity_over_ground_m_s,
        np.broadcast_to([0.4, -0.3], (len(calm), 2)),
        atol=1e-12,
    )


def test_a_head_current_eases_the_still_air():
    # the air stands still over ground, so a current from ahead lowers the felt wind
    ship = replace(AT_ONCE, air=Air(2000.0, 1.0))
    scenario = Scenario(speed_m_s=8.2, lead_in_s=10.0)
    calm = simulate(ship, scenario).speed_through_water_m_s[-1]
    head = simulate(ship, replace(scenario, current_m_s=(-2.0, 0.0))).speed_through_water_m_s[-1]
    astern = simulate(ship, replace(scenario, current_m_s=(2.0, 0.0))).speed_through_water_m_s[-1]
    assert head > calm > astern


def test_a_slow_down_settles_where_resistance_meets_the_ordered_thrust():
    ordered = EngineOrder(0.0, shaft=0.7, thrust=0.49)
    truth = simulate(
        CARGO, Scenario(speed_m_s=8.2, lead_in_s=100.0, duration_s=6000.0, orders=(ordered,))
    )
    final = truth.speed_through_water_m_s[-1]
    np.testing.assert_allclose(
        truth.specific_resistance(final), 0.49 * truth.specific_resistance(8.2), rtol=1e-3
    )
    np.testing.assert_allclose(truth.shaft_rad_s[-1], 0.7 * 11.5, rtol=1e-12)


def test_a_re_engaged_engine_brings_the_speed_back():
    orders = (STOP, EngineOrder(600.0, shaft=1.0, thrust=1.0))
    truth = simulate(
        CARGO, Scenario(speed_m_s=8.2, lead_in_s=100.0, duration_s=7000.0, orders=orders)
    )
    slowest = int(np.argmin(truth.speed_through_water_m_s))
    assert 690.0 < truth.time_s[slowest] < 720.0
    np.testing.assert_allclose(truth.speed_through_water_m_s[-1], 8.2, rtol=1e-3)


def test_without_orders_the_ship_sails_on():
    truth = simulate(CARGO, Scenario(speed_m_s=8.2, lead_in_s=0.0, duration_s=500.0, orders=()))
    np.testing.assert_allclose(truth.speed_through_water_m_s, 8.2, rtol=1e-12)
    np.testing.assert_array_equal(truth.shaft_rad_s, 11.5)


def test_a_turn_with_edges_is_one_of_many_short_turns():
    scenario = Scenario(speed_m_s=8.2, lead_in_s=50.0, duration_s=400.0)
    smooth = Turn(100.0, 60.0, rate_rad_s=0.01, drag_area_m2=30.0, edge_s=40.0)
    parts = []
    for start_s in 80.0 + np.arange(100.0):
        share = float(smooth.share(start_s + 0.5))
        parts.append(Turn(start_s, 1.0, 0.01 * share, drag_area_m2=30.0 * share))
    one = simulate(CARGO, replace(scenario, turns=(smooth,)))
    many = simulate(CARGO, replace(scenario, turns=tuple(parts)))
    times = np.linspace(0.0, 450.0, 91)
    for name, atol in (('speed_through_water_m_s', 1e-5), ('heading_rad', 2e-4)):
        np.testing.assert_allclose(
            getattr(one.at(times), name), getattr(many.at(times), name), rtol=0, atol=atol
        )
    np.testing.assert_allclose(one.at(times).position_m, many.at(times).position_m, atol=0.02)


def test_a_moving_body_of_water_carries_ship_and_log_as_newton_says():
    # in one step of c, much faster than the drag: du = -dc / (1 + n_r)
    noise = GaussMarkov(sd=0.2, correlation_time_s=5.0)
    ship = quadratic(1e-9)
    truth = simulate(
        ship, Scenario(speed_m_s=8.0, lead_in_s=0.0, duration_s=200.0, water_speed=noise, seed=4)
    )
    water = truth.velocity_over_ground_m_s[:, 0] - truth.speed_through_water_m_s
    change = truth.speed_through_water_m_s - truth.speed_through_water_m_s[0]
    np.testing.assert_allclose(change, -(water - water[0]) / (1.0 + N_R), atol=1e-4)
    assert 0.05 < np.std(water) < 0.4


def test_gusts_push_with_their_impulse():
    force = GaussMarkov(sd=1e5, correlation_time_s=50.0)
    ship = quadratic(1e-9)
    scenario = Scenario(speed_m_s=5.0, lead_in_s=0.0, duration_s=100.0, gust_force=force, seed=1)
    pushed = simulate(ship, scenario)
    calm = simulate(ship, replace(scenario, gust_force=None))
    gain = pushed.speed_through_water_m_s[-1] - calm.speed_through_water_m_s[-1]
    assert 0.0 < abs(gain) < 100.0 * 3e5 / ship.mass_kg
    # the rate of change never exceeds what 4.5 standard deviations of force give
    rate = np.abs(np.diff(pushed.speed_through_water_m_s) / np.diff(pushed.time_s))
    assert np.max(rate) < 4.5e5 / ship.mass_kg


def test_the_seed_decides_the_disturbances():
    scenario = Scenario(speed_m_s=8.2, lead_in_s=50.0, water_speed=GaussMarkov(0.05, 100.0))
    first, again = simulate(CARGO, scenario), simulate(CARGO, scenario)
    other = simulate(CARGO, replace(scenario, seed=1))
    np.testing.assert_array_equal(first.position_m, again.position_m)
    assert np.max(np.abs(first.position_m - other.position_m)) > 1.0


def test_interpolation_returns_the_knots_and_stays_close_between_them():
    scenario = Scenario(speed_m_s=8.2, lead_in_s=100.0, duration_s=300.0)
    coarse, fine = simulate(CARGO, scenario), simulate(CARGO, scenario, step_s=0.01)
    knots = coarse.at(coarse.time_s)
    np.testing.assert_array_equal(knots.speed_through_water_m_s, coarse.speed_through_water_m_s)
    np.testing.assert_allclose(knots.position_m, coarse.position_m, atol=1e-9)
    between = coarse.at(fine.time_s)
    np.testing.assert_allclose(
        between.speed_through_water_m_s, fine.speed_through_water_m_s, atol=2e-5
    )
    np.testing.assert_allclose(between.position_m, fine.position_m, atol=1e-5)


def test_a_model_ship_is_followed_in_its_own_time_scale():
    model = Ship.from_yaml(
        'length_m: 1.1\ndisplaced_volume_m3: 0.0143\nwetted_surface_m2: 0.35\n'
        'added_mass: {model: constant, value: 0.1}\n'
        'baseline: {speed_m_s: [0.0, 0.1, 0.2], resistance_n: [0.0, 0.02, 0.07], '
        'relative_sd: 0.1}',
        subject='model',
    )
    scenario = Scenario(speed_m_s=0.2, lead_in_s=5.0, duration_s=60.0)
    truth, fine = simulate(model, scenario), simulate(model, scenario, step_s=1e-3)
    np.testing.assert_allclose(
        truth.speed_through_water_m_s[-1], fine.speed_through_water_m_s[-1], rtol=1e-6
    )


def test_a_baseline_that_ends_above_rest_ends_the_simulation():
    table = TableBaseline((4.0, 6.0, 9.0), (7e4, 1.7e5, 4.2e5), 0.02)
    ship = replace(CARGO, baseline=table)
    short = simulate(ship, Scenario(speed_m_s=9.0, lead_in_s=10.0, duration_s=200.0))
    assert short.speed_through_water_m_s[-1] > 4.0
    with pytest.raises(SimulationError, match=r'4\.\.9 m/s'):
        simulate(ship, Scenario(speed_m_s=9.0, lead_in_s=10.0, duration_s=2000.0))
    with pytest.raises(SimulationError, match=r'speed_m_s is 9\.5'):
        simulate(ship, Scenario(speed_m_s=9.5))


def test_the_highest_speed_of_the_baseline_can_be_sailed():
    top = CARGO.baseline_range_m_s[1]
    truth = simulate(CARGO, Scenario(speed_m_s=top, lead_in_s=100.0, duration_s=10.0))
    np.testing.assert_allclose(truth.at(np.array([99.0])).speed_through_water_m_s, top, rtol=1e-12)


def test_no_baseline_and_unknown_effects_are_errors():
    with pytest.raises(ShipdragError, match='no baseline'):
        simulate(replace(CARGO, baseline=None), Scenario(speed_m_s=8.2))
    with pytest.raises(SimulationError, match='fouling'):
        simulate(replace(CARGO, effects=(StatedEffect('fouling', {}),)), Scenario(speed_m_s=8.2))


def test_thirty_days_at_one_second_are_one_array():
    truth = simulate(
        CARGO,
        Scenario(
            speed_m_s=8.2,
            lead_in_s=30 * 86400.0,
            duration_s=0.0,
            orders=(),
            gust_force=GaussMarkov(2e4, 60.0),
        ),
    )
    assert len(truth) == 30 * 86400 + 1
    # N = 2.6e6 s over a ship's time constant of some 300 s: 9000 independent values
    assert abs(np.mean(truth.speed_through_water_m_s) - 8.2) < 0.01
