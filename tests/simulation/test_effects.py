# SPDX-License-Identifier: Apache-2.0
"""Each effect against its own formula, where that can be worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Air, Ship, TableBaseline
from shipdrag_ros.simulation import STOP, EngineOrder, Scenario, Sensor, Truth, sense, simulate
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.effects import find, parse
from tests.runs import CARGO
from tests.simulation.conftest import DRAG_1_M, N_R, quadratic

SCENARIO = Scenario(speed_m_s=8.0, lead_in_s=0.0, duration_s=900.0)


def run(ship: Ship, *texts: str, scenario: Scenario = SCENARIO, **options: object) -> Truth:
    return simulate(ship, scenario, effects=[parse(text) for text in texts], **options)


def first_rate(truth: Truth) -> float:
    """Return du/dt right after the stop, of a ship whose thrust ends at once."""
    u, t = truth.speed_through_water_m_s, truth.time_s
    return float((-3.0 * u[0] + 4.0 * u[1] - u[2]) / (t[2] - t[0]))


def slowed(length_m: float, time_s: np.ndarray) -> np.ndarray:
    """Return the speed under quadratic drag: v0 / (1 + v0 t / l)."""
    return 8.0 / (1.0 + 8.0 * time_s / length_m)


MASS = quadratic().mass_kg
DISC = 0.25 * np.pi * 5.6**2


@pytest.mark.parametrize(
    ('text', 'length_m'),
    [
        ('towed_cable=2.5', (1 + N_R) / (DRAG_1_M + 0.5 * 1025.0 * 2.5 / MASS)),
        ('locked_propeller=0.4', (1 + N_R) / (DRAG_1_M + 0.5 * 1025.0 * 0.4 * DISC / MASS)),
        ('added_mass=0.05', (1 + N_R + 0.05) / DRAG_1_M),
        ('displacement=0.1', 1.1 * (1 + N_R) / DRAG_1_M),
    ],
)
def test_quadratic_drag_and_inertia_keep_their_closed_form(text, length_m):
    truth = run(quadratic(), text)
    np.testing.assert_allclose(
        truth.speed_through_water_m_s, slowed(length_m, truth.time_s), rtol=1e-7
    )


def test_the_true_curve_holds_what_depends_on_the_speed_and_is_per_true_mass():
    v = np.array([1.0, 4.0, 8.0])
    truth = run(quadratic(), 'towed_cable=2.5', 'displacement=0.1', 'current=1')
    expected = (DRAG_1_M + 0.5 * 1025.0 * 2.5 / MASS) * v**2 / 1.1
    np.testing.assert_allclose(truth.specific_resistance(v), expected, rtol=1e-6)


def test_fouling_is_a_fraction_of_the_ittc_line():
    v = np.array([2.0, 6.0])
    extra = (
        run(CARGO, 'fouling=0.3').specific_resistance(v) * CARGO.mass_kg
    ) - CARGO.resistance_n(v)
    friction = 0.075 / (np.log10(v * 150.0 / 1.19e-6) - 2.0) ** 2
    expected = 0.3 * 0.5 * 1025.0 * 4542.0 * v**2 * 1.2 * friction
    np.testing.assert_allclose(extra, expected, rtol=1e-9)


def test_fouling_of_a_tabulated_baseline_uses_the_usual_surface_and_form():
    v = np.array([5.0])
    extra = run(quadratic(), 'fouling=0.3').action.resistance_n(v)
    with_surface = run(quadratic(wetted_surface_m2=4542.0), 'fouling=0.3').action.resistance_n(v)
    np.testing.assert_allclose(extra, with_surface, rtol=0.15)
    expected = 0.3 * run(CARGO, 'fouling=1').action.resistance_n(v)
    np.testing.assert_allclose(with_surface, expected, rtol=1e-9)


def test_a_windmilling_propeller_drags_more_towards_the_stall_and_as_a_locked_one_below_it():
    action = run(quadratic(), 'windmilling_propeller=0.1,stall_speed_m_s=3').action
    pressure = 0.5 * 1025.0 * DISC
    friction = (1.15 * 0.36 - 0.1) * 3.0**2  # a constant force while it turns
    np.testing.assert_allclose(
        action.resistance_n(5.0), pressure * (0.1 * 25.0 + friction), rtol=1e-6
    )
    np.testing.assert_allclose(action.resistance_n(2.0), pressure * 0.36 * 4.0, rtol=1e-3)
    standing = 'windmilling_propeller=0.1,stall_speed_m_s=3,locked_coefficient=0.3'
    np.testing.assert_allclose(
        run(quadratic(), standing).action.resistance_n(2.0), pressure * 0.3 * 4.0, rtol=1e-3
    )


def test_the_flow_turns_a_windmilling_shaft_ever_less_until_it_stalls():
    truth = run(CARGO, 'windmilling_propeller=0.1,stall_speed_m_s=4', scenario=SCENARIO)
    late = truth.time_s > 60.0
    u = truth.speed_through_water_m_s[late]
    share = truth.shaft_rad_s[late] / (0.7 * 11.5 * u / 8.0)
    assert np.all(np.diff(share) < 1e-12)
    # torque, as (v_s / v)^2, falls from 1 at 0.12 of the free revs to none at those
    fast = u > 1.4 * 4.0
    np.testing.assert_allclose(share[fast], 1.0 - 0.88 * (4.0 / u[fast]) ** 2, atol=1e-3)
    assert np.all(share[u < 3.0] < 0.01)


def test_an_engine_that_turns_the_shaft_is_stronger_than_the_flow():
    orders = (STOP, EngineOrder(100.0, shaft=-0.8, thrust=-0.5))
    scenario = replace(SCENARIO, duration_s=200.0, orders=orders)
    for texts in ((), ('windmilling_propeller=0.1,stall_speed_m_s=1',)):
        shaft = run(CARGO, *texts, scenario=scenario).at(np.array([60.0, 190.0])).shaft_rad_s
        np.testing.assert_allclose(shaft[1], -0.8 * 11.5, rtol=1e-3)
        assert (shaft[0] > 2.0) == bool(texts)


def test_head_wind_acts_by_the_relative_wind_less_the_still_air():
    ship = quadratic(air=Air(800.0, 0.9))
    for head, cross in ((6.0, 0.0), (-5.0, 3.0), (-12.0, 0.0)):
        truth = run(ship, f'wind={head},cross_m_s={cross}')
        along = 8.0 + head
        drag = 0.5 * 1.225 * 800.0 * 0.9 * (along * np.hypot(along, cross) - 64.0) / MASS
        expected = -(DRAG_1_M * 64.0 + drag) / (1 + N_R)
        np.testing.assert_allclose(first_rate(truth), expected, rtol=1e-5)


def test_an_anemometer_feels_wind_and_motion():
    scenario = replace(SCENARIO, heading_rad=2.0)
    truth = run(CARGO, 'wind=5,cross_m_s=3', scenario=scenario)
    wind = sense(truth, [Sensor(channel=Channel.WIND_APPARENT)], seed=1).value
    u = truth.at(np.arange(901.0)).speed_through_water_m_s
    # from ahead and from port: the air moves astern and to starboard
    np.testing.assert_allclose(wind[:, 0], -5.0 - u, atol=1e-9)
    np.testing.assert_allclose(wind[:, 1], -3.0, atol=1e-9)


@pytest.mark.parametrize(('side', 'sign'), [('ahead', 1.0), ('astern', -1.0)])
@pytest.mark.parametrize(('more', 'length_m'), [('', 75.0), (',wave_length_m=300', 300.0)])
def test_waves_push_by_the_square_of_the_encounter(side, sign, more, length_m):
    truth = run(quadratic(), f'waves=3e4,from={side}{more}')
    omega = np.sqrt(2 * np.pi * 9.81 / length_m)
    force = sign * 3e4 * (1.0 + sign * omega * 8.0 / 9.81) ** 2
    expected = -(DRAG_1_M * 64.0 + force / MASS) / (1 + N_R)
    np.testing.assert_allclose(first_rate(truth), expected, rtol=1e-5)


def test_shallow_water_is_raven_s_friction_when_slow_and_more_with_sinkage():
    slow = run(CARGO, 'shallow_water=17.2').action.resistance_n(0.5)
    friction = 0.075 / (np.log10(0.5 * 150.0 / 1.19e-6) - 2.0) ** 2
    viscous = 0.5 * 1025.0 * 4542.0 * 0.25 * (1.2 * friction + 3e-4)
    np.testing.assert_allclose(slow, 0.57 * 0.5**1.79 * viscous, rtol=2e-3)
    # 8 m/s: Fr_h^2 = 0.3793 at 17.2 m and 0.1450 at 45 m
    sinkage = 1.46 * 20200 / 150.0**2 * (0.3793 / np.sqrt(0.6207) - 0.1450 / np.sqrt(0.8550))
    block = 20200 / (150 * 21.6 * 8.6)
    growth = sinkage * 150 * 21.6 * (1 + 2 * block) / 3 / 20200
    deep = CARGO.resistance_n(8.0) - CARGO.air_drag_n(8.0)
    friction = 0.075 / (np.log10(8.0 * 150.0 / 1.19e-6) - 2.0) ** 2
    viscous = 0.5 * 1025.0 * 4542.0 * 64.0 * (1.2 * friction + 3e-4)
    expected = (deep + 0.57 * 0.5**1.79 * viscous) * (1 + min(growth, 0.05)) ** (2 / 3) - deep
    fast = run(CARGO, 'shallow_water=17.2').action.resistance_n(8.0)
    np.testing.assert_allclose(fast, expected, rtol=1e-4)


def test_shallow_water_is_read_by_the_echo_sounder_and_grows_the_added_mass():
    truth = run(CARGO, 'shallow_water=12')
    depth = sense(truth, [Sensor(channel=Channel.DEPTH)], seed=1).value[:, 0]
    np.testing.assert_array_equal(depth, 12.0)
    form = 3.77 + 1.14 * 21.6 / 8.6 - 0.233 * 150 / 8.6 - 3.43 * 20200 / (150 * 21.6 * 8.6)
    expected = CARGO.n_r(4.0) * form / (12.0 / 8.6 - 1.0) ** 1.3
    np.testing.assert_allclose(truth.action.n_r_change, expected, rtol=1e-9)


def test_a_depth_below_the_keel_that_a_fit_tries_is_as_shallow_as_can_be():
    effect, frame = find('shallow_water'), Frame(CARGO, SCENARIO, 0.0)
    tried, least = (effect.action(frame, depth).n_r_change for depth in (7.0, 1.2 * 8.6))
    np.testing.assert_allclose(tried, least, rtol=1e-9)


def test_deep_water_is_not_shallow():
    deep = run(CARGO, 'shallow_water=860').action.resistance_n(8.0)
    assert 0.0 < deep < 2e-3 * CARGO.resistance_n(8.0)


def test_a_current_carries_ship_and_track():
    scenario = replace(SCENARIO, heading_rad=0.6)
    truth = run(replace(CARGO, air=None), 'current=0.5,cross_track_m_s=-0.2', scenario=scenario)
    calm = run(replace(CARGO, air=None), scenario=scenario)
    np.testing.assert_array_equal(truth.speed_through_water_m_s, calm.speed_through_water_m_s)
    gap = (truth.position_m - calm.position_m)[-1] / 900.0
    turned = (gap[0] + 1j * gap[1]) * np.exp(-0.6j)
    np.testing.assert_allclose([turned.real, turned.imag], [0.5, -0.2], atol=1e-9)


def test_a_changing_current_leaves_the_ship_behind_by_her_inertia():
    # without drag: du = -dc / (1 + n_r), so that over ground she gains n_r / (1 + n_r) of dc
    scenario = replace(SCENARIO, lead_in_s=30.0)
    truth = run(quadratic(1e-9), 'current_change=0.3', scenario=scenario)
    after = np.maximum(truth.time_s - 30.0, 0.0) / 900.0
    u = truth.speed_through_water_m_s
    np.testing.assert_allclose(u, 8.0 - 0.3 * after / (1 + N_R), atol=1e-4)
    ground = truth.velocity_over_ground_m_s[:, 0]
    np.testing.assert_allclose(ground - u, 0.3 * after, atol=1e-12)


def test_residual_thrust_and_shaft_outlast_the_run_down():
    truth = run(CARGO, 'residual_thrust=100,fraction=0.25')
    t, u = truth.time_s, truth.speed_through_water_m_s
    fraction = 0.75 * np.exp(-t / 8.0) + 0.25 * np.exp(-t / 100.0)
    np.testing.assert_allclose(truth.shaft_rad_s, 11.5 * fraction, rtol=1e-9)
    slope = (u[2:] - u[:-2]) / (t[2:] - t[:-2])
    thrust = (1 + CARGO.n_r(u[1:-1])) * slope + truth.specific_resistance(u[1:-1])
    expected = truth.specific_resistance(8.0) * fraction[1:-1]
    np.testing.assert_allclose(thrust, expected, rtol=0.0, atol=3e-6)


def test_a_turn_adds_its_drag_while_it_lasts_and_turns_the_heading():
    truth = run(quadratic(), 'turning=20,start_s=100,duration_s=200,rate_rad_s=0.004')
    drag = DRAG_1_M + 0.5 * 1025.0 * 20.0 / MASS
    before, within = (1 + N_R) / DRAG_1_M, (1 + N_R) / drag
    slope = np.diff(
        1.0 / truth.at(np.array([50.0, 90.0, 130.0, 270.0, 320.0])).speed_through_water_m_s
    )
    np.testing.assert_allclose(slope[0], 40.0 / before, rtol=1e-5)
    np.testing.assert_allclose(slope[2], 140.0 / within, rtol=1e-5)
    np.testing.assert_allclose(
        truth.at(np.array([100.0, 200.0, 500.0])).heading_rad, [0.0, 0.4, 0.8], atol=1e-12
    )
    rudder = sense(truth, [Sensor(channel=Channel.RUDDER)], seed=1).value[:, 0]
    np.testing.assert_allclose(rudder[[99, 125, 275, 301]], [0.0, 0.17, 0.17, 0.0])


def log_of(ship: Ship, *texts: str, scenario: Scenario = SCENARIO) -> np.ndarray:
    return sense(
        run(ship, *texts, scenario=scenario), [Sensor(channel=Channel.SPEED_THROUGH_WATER)], seed=1
    ).value[:, 0]


def test_scale_offset_and_dead_band_of_a_log():
    u = log_of(CARGO)
    np.testing.assert_allclose(log_of(CARGO, 'log_scale=0.05'), 1.05 * u, rtol=1e-12)
    np.testing.assert_allclose(log_of(CARGO, 'log_offset=-0.3'), u - 0.3, rtol=1e-12)
    expected = np.where(u < 5.0, u**2 / 5.0, u)
    # readings between the steps are linear, the square is not
    np.testing.assert_allclose(log_of(CARGO, 'log_dead_band=5'), expected, atol=1e-6)
    together = log_of(CARGO, 'log_scale=0.05', 'log_offset=-0.3', 'log_dead_band=5')
    np.testing.assert_allclose(together, 1.05 * expected - 0.3, atol=1e-6)


def test_a_lagging_log_follows_a_ramp_late_by_its_lag():
    # a constant force makes a ramp; after some lags the reading is u(t - lag)
    speed = np.linspace(0.0, 10.0, 11)
    ship = quadratic()
    flat = replace(ship, baseline=TableBaseline(tuple(speed), (0.0,) + (0.005 * MASS,) * 10, 0.01))
    scenario = replace(SCENARIO, duration_s=600.0)
    reading, truth = log_of(flat, 'log_lag=20', scenario=scenario), log_of(flat, scenario=scenario)
    np.testing.assert_allclose(reading[200:], truth[180:-20], atol=1e-4)
    # and before that, the steady state is left as 1 - exp(-t / lag)
    t = np.arange(600.0)[:60]
    rate = 0.005 / (1 + N_R)
    expected = 8.0 - rate * (t - 20.0 * (1.0 - np.exp(-t / 20.0)))
    np.testing.assert_allclose(reading[:60], expected, atol=1e-6)


def test_a_late_log_reads_the_past():
    scenario = replace(SCENARIO, lead_in_s=50.0)
    u, late = log_of(CARGO, scenario=scenario), log_of(CARGO, 'time_offset=12', scenario=scenario)
    np.testing.assert_allclose(late[12:], u[:-12], rtol=1e-9)
    np.testing.assert_allclose(late[:12], 8.0, rtol=1e-9)
    early = log_of(CARGO, 'time_offset=-12', scenario=scenario)
    np.testing.assert_allclose(early[:-12], u[12:], rtol=1e-9)


def test_a_radar_scale_stretches_positions_and_speeds_but_not_the_log():
    sensors = [
        Sensor(channel=channel)
        for channel in (Channel.POSITION, Channel.SPEED_OVER_GROUND, Channel.SPEED_THROUGH_WATER)
    ]
    plain = sense(run(CARGO), sensors, seed=1)
    scaled = sense(run(CARGO, 'radar_scale=0.04'), sensors, seed=1)
    for sensor, factor in zip(sensors, (1.04, 1.04, 1.0)):
        mine = plain.channel == sensor.channel
        np.testing.assert_allclose(scaled.value[mine], factor * plain.value[mine], rtol=1e-12)


@pytest.mark.parametrize('name', ['current', 'wind', 'waves', 'current_change'])
def test_on_the_reciprocal_run_an_effect_of_the_earth_is_reversed(name):
    value = {'current': 0.5, 'wind': 7.0, 'waves': 3e4, 'current_change': 0.2}[name]
    back = replace(SCENARIO, heading_rad=0.3 + np.pi)
    reciprocal = run(CARGO, f'{name}={value}', scenario=back, reference_rad=0.3)
    opposite = f'{name}={value},from=astern' if name == 'waves' else f'{name}={-value}'
    mirrored = run(CARGO, opposite, scenario=back)
    np.testing.assert_allclose(
        reciprocal.speed_through_water_m_s, mirrored.speed_through_water_m_s, rtol=1e-9
    )
    np.testing.assert_allclose(reciprocal.position_m, mirrored.position_m, atol=1e-6)
    same = run(CARGO, f'{name}={value}', scenario=back)
    assert np.max(np.abs(reciprocal.position_m - same.position_m)) > 1.0


@settings(max_examples=15, deadline=None)
@given(
    angle=st.floats(-3.0, 3.0),
    off=st.floats(-3.0, 3.0),
    name=st.sampled_from(['current=0.4,cross_track_m_s=0.2', 'wind=8,cross_m_s=-4', 'waves=4e4']),
)
def test_turning_run_and_reference_together_turns_the_track_alone(angle, off, name):
    short = replace(SCENARIO, duration_s=300.0, heading_rad=off)
    here = run(CARGO, name, scenario=short, reference_rad=0.0)
    there = run(CARGO, name, scenario=replace(short, heading_rad=off + angle), reference_rad=angle)
    np.testing.assert_allclose(
        there.speed_through_water_m_s, here.speed_through_water_m_s, rtol=1e-10
    )
    turned = (here.position_m[:, 0] + 1j * here.position_m[:, 1]) * np.exp(1j * angle)
    np.testing.assert_allclose(
        there.position_m[:, 0] + 1j * there.position_m[:, 1], turned, atol=1e-6
    )


def test_effects_of_the_ship_file_act_too():
    ship = Ship.from_yaml(
        CARGO.to_yaml().replace(
            'effects: []',
            'effects:\n- name: fouling\n  parameters: {friction_factor: {value: 0.3, sd: 0.02}}',
        ),
        subject='cargo',
    )
    np.testing.assert_array_equal(
        simulate(ship, SCENARIO).speed_through_water_m_s,
        run(CARGO, 'fouling=0.3').speed_through_water_m_s,
    )
