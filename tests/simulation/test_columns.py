# SPDX-License-Identifier: Apache-2.0
"""Columns agree with one simulation each, however many go together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.errors import ShipdragError, SimulationError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Propulsion, StatedEffect, TableBaseline
from shipdrag_ros.simulation import (
    Action,
    EngineOrder,
    Frame,
    GaussMarkov,
    Scenario,
    Sensor,
    Truth,
    Turn,
    sense,
    simulate,
    simulate_columns,
)
from shipdrag_ros.simulation.columns import _prepare, _steps
from shipdrag_ros.simulation.effects import LIBRARY
from shipdrag_ros.simulation.surge import columns_of
from tests.runs import CARGO

SCENARIO = Scenario(
    speed_m_s=8.2,
    lead_in_s=100.0,
    duration_s=800.0,
    heading_rad=0.4,
    current_m_s=(0.2, -0.1),
    turns=(Turn(700.0, 50.0, rate_rad_s=0.004),),
)
REFERENCE_RAD = 1.3
FRAME = Frame(CARGO, SCENARIO, REFERENCE_RAD)
TIME_S = np.arange(0.0, 900.0, 10.0)
STEP_S = 0.25


def drawn(name: str, seed: int) -> tuple[Action, StatedEffect]:
    """Draw the values of an effect from its priors."""
    rng = np.random.default_rng(seed)
    values = {}
    for quantity in LIBRARY[name].parameters_of(CARGO):
        value = quantity.prior.draw(rng)
        while not quantity.accepts(value):
            value = quantity.prior.draw(rng)
        values[quantity.name] = value
    if name == 'turning':
        # before the scenario's own turn, and so that steps end at the times that are looked at:
        # between steps the truth is interpolated more coarsely
        values['start_s'] = round(min(values['start_s'], 300.0))
        values['duration_s'] = round(min(values['duration_s'], 350.0))
    stated = StatedEffect(name, {key: Parameter(value, 0.0) for key, value in values.items()})
    return LIBRARY[name].action(FRAME, *values.values()), stated


def truth_of(stated: StatedEffect, **options: object) -> Truth:
    return simulate(
        CARGO, SCENARIO, effects=[stated], reference_rad=REFERENCE_RAD, step_s=STEP_S, **options
    )


@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_each_column_is_the_simulation_of_its_effect(seed):
    pairs = [drawn(name, seed) for name in LIBRARY]
    columns = simulate_columns(
        CARGO, SCENARIO, [action for action, _ in pairs], TIME_S, step_s=STEP_S
    )
    for i, (_, stated) in enumerate(pairs):
        truth = truth_of(stated).at(TIME_S)
        u = truth.speed_through_water_m_s
        np.testing.assert_allclose(columns.speed_through_water_m_s[i], u, rtol=0, atol=1e-9)
        np.testing.assert_allclose(columns.position_m[i], truth.position_m, rtol=0, atol=1e-7)
        np.testing.assert_allclose(
            columns.velocity_over_ground_m_s[i], truth.velocity_over_ground_m_s, rtol=0, atol=1e-9
        )


@pytest.mark.parametrize('name', LIBRARY)
def test_readings_are_those_of_sensors(name):
    action, stated = drawn(name, 5)
    columns = simulate_columns(CARGO, SCENARIO, [action], TIME_S, step_s=STEP_S)
    channels = (Channel.SPEED_THROUGH_WATER, Channel.POSITION, Channel.SPEED_OVER_GROUND)
    block = sense(
        truth_of(stated), [Sensor(channel=channel, rate_hz=0.1) for channel in channels], seed=1
    )
    log, position, speed = (
        block.value[block.channel == channel][: len(TIME_S)] for channel in channels
    )
    # a log with memory is followed with straight lines between some times
    has_memory = action.log_lag_s or action.log_late_s
    atol = 1e-3 if has_memory else 1e-8
    np.testing.assert_allclose(columns.log_m_s[0], log[:, 0], rtol=0, atol=atol)
    np.testing.assert_allclose(columns.radar_position_m[0], position, rtol=0, atol=1e-7)
    np.testing.assert_allclose(columns.radar_speed_m_s[0], speed[:, 0], rtol=0, atol=1e-8)


def test_a_speed_over_ground_may_be_filtered_too():
    slow = Action(ground_lag_s=6.0)
    columns = simulate_columns(CARGO, SCENARIO, [slow, Action()], TIME_S)
    truth = replace(simulate(CARGO, SCENARIO, step_s=STEP_S), action=slow)
    channel = Channel.SPEED_OVER_GROUND
    block = sense(truth, [Sensor(channel=channel, rate_hz=0.1)], seed=1)
    shown = block.value[: len(TIME_S), 0]
    np.testing.assert_allclose(columns.radar_speed_m_s[0], shown, rtol=0, atol=1e-3)
    behind = columns.radar_speed_m_s[0] - columns.radar_speed_m_s[1]
    assert 0.05 < behind[TIME_S == 120.0][0] < 0.2


def test_the_steps_that_are_chosen_are_good_for_a_tenth_of_a_millimetre_per_second():
    # N = 4 draws of each effect, seeds 0..3
    actions = [drawn(name, seed)[0] for name in LIBRARY for seed in range(4)]
    times = np.arange(0.0, 900.0, 7.3)
    chosen = simulate_columns(CARGO, SCENARIO, actions, times)
    fine = simulate_columns(CARGO, SCENARIO, actions, times, step_s=0.1)
    for field in ('speed_through_water_m_s', 'velocity_over_ground_m_s', 'log_m_s'):
        np.testing.assert_allclose(getattr(chosen, field), getattr(fine, field), rtol=0, atol=1e-4)
    np.testing.assert_allclose(chosen.position_m, fine.position_m, rtol=0, atol=1e-2)


def test_several_orders_and_no_run_down_agree_too():
    orders = (EngineOrder(0.0, 0.5, 0.4), EngineOrder(150.0, 0.0, 0.0))
    scenario = replace(SCENARIO, orders=orders, turns=())
    residual = Action(residual_fraction=0.3, residual_decay_s=80.0)
    for ship in (
        CARGO,
        replace(CARGO, propulsion=None),
        replace(CARGO, propulsion=Propulsion(30)),
    ):
        times = np.arange(0.0, 900.0, 10.0)
        columns = simulate_columns(ship, scenario, [Action(), residual], times, step_s=0.25)
        stated = StatedEffect(
            'residual_thrust', {'decay_s': Parameter(80.0, 0.0), 'fraction': Parameter(0.3, 0.0)}
        )
        for i, effects in enumerate([(), (stated,)]):
            truth = simulate(ship, scenario, effects=effects, step_s=0.25).at(times)
            np.testing.assert_allclose(
                columns.speed_through_water_m_s[i], truth.speed_through_water_m_s, atol=1e-9
            )


def test_nuisances_are_actions_and_speeds():
    longer = simulate(replace(CARGO, propulsion=Propulsion(12.0)), SCENARIO, step_s=STEP_S)
    faster = simulate(CARGO, replace(SCENARIO, speed_m_s=8.3), step_s=STEP_S)
    columns = simulate_columns(
        CARGO,
        SCENARIO,
        [Action(run_down_change_s=4.0), Action()],
        TIME_S,
        speed_m_s=np.array([8.2, 8.3]),
        step_s=STEP_S,
    )
    for i, truth in enumerate((longer, faster)):
        np.testing.assert_allclose(
            columns.speed_through_water_m_s[i],
            truth.at(TIME_S).speed_through_water_m_s,
            rtol=0,
            atol=1e-7,
        )


def test_the_effects_of_the_ship_act_in_every_column():
    stated = StatedEffect('current', {'along_track_m_s': Parameter(0.5, 0.0)})
    ship = replace(CARGO, effects=(stated,))
    offset = Action(log_offset_m_s=0.1)
    columns = simulate_columns(
        ship, SCENARIO, [Action(), offset], TIME_S, reference_rad=REFERENCE_RAD, step_s=STEP_S
    )
    expected = truth_of(stated).at(TIME_S).position_m
    for position in columns.position_m:
        np.testing.assert_allclose(position, expected, rtol=0, atol=1e-7)


def test_a_column_that_leaves_the_table_is_lost_from_there_on():
    table = TableBaseline((4.0, 6.0, 9.0), (7e4, 1.7e5, 4.2e5), 0.02)
    ship = replace(CARGO, baseline=table)
    scenario = Scenario(speed_m_s=8.5, lead_in_s=10.0, duration_s=2000.0)
    times = np.arange(0.0, 2001.0, 10.0)
    slow, none = simulate_columns(
        ship, scenario, [Action(mass_fraction=9.0), Action()], times
    ).speed_through_water_m_s
    assert np.all(np.isfinite(slow))
    lost = np.flatnonzero(np.isnan(none))
    assert 3.9 < none[lost[0] - 1] < 4.1
    np.testing.assert_array_equal(lost, np.arange(lost[0], len(times)))


def test_what_columns_cannot_do_is_told():
    for change, message in (
        ({'gust_force': GaussMarkov(1e4, 50.0)}, 'water_speed and gust_force'),
        ({'speed_m_s': 30.0}, 'speed_m_s is 30.0'),
    ):
        with pytest.raises(SimulationError, match=message):
            simulate_columns(CARGO, replace(SCENARIO, **change), [Action()], TIME_S)
    with pytest.raises(SimulationError, match=r'time_s is 0\.\.1000 s, expected within 0\.\.900'):
        simulate_columns(CARGO, SCENARIO, [Action()], np.array([0.0, 1000.0]))
    with pytest.raises(SimulationError, match='not ascending'):
        simulate_columns(CARGO, SCENARIO, [Action()], TIME_S[::-1])
    with pytest.raises(SimulationError, match='a turn is at'):
        simulate_columns(CARGO, SCENARIO, [Action(turns=(Turn(50.0, -1.0, 0.0),))], TIME_S)
    with pytest.raises(ShipdragError, match='no baseline'):
        simulate_columns(replace(CARGO, baseline=None), SCENARIO, [Action()], TIME_S)


def test_steps_are_small_until_the_run_down_has_ended_and_no_longer() -> None:
    # the end of the run-down is an edge: whatever its last bit, what follows it is not a run-down
    ship, found = replace(CARGO, propulsion=Propulsion(2.1)), set()
    for lead_in_s in np.linspace(1785.0, 1786.0, 40).tolist():
        scenario = replace(SCENARIO, lead_in_s=lead_in_s, turns=())
        settled = lead_in_s + 8.0 * 2.1
        edges = [0.0, lead_in_s, settled, settled + 600.0]
        found.add(tuple(_steps(ship, scenario, edges, longest=10.0)))
    assert {(before, after < 120) for before, _, after in found} == {(1, True)}
    assert all(running_down >= 32 for _, running_down, _ in found)


def test_a_resistance_that_columns_share_is_computed_once() -> None:
    asked = []

    def drag(speed_m_s: np.ndarray) -> np.ndarray:
        asked.append(len(speed_m_s))
        return 50.0 * speed_m_s**2

    shared = Action(resistance=(drag,))
    other = Action(resistance=(lambda speed_m_s: 50.0 * speed_m_s**2,))
    columns = simulate_columns(
        CARGO, SCENARIO, [shared, shared + shared, shared + other], np.array([900.0])
    )
    assert len(asked) == 1
    once, twice, both = columns.speed_through_water_m_s[:, 0].tolist()
    assert both == twice < once


def test_a_motion_is_followed_once_however_instruments_read_it() -> None:
    turned = Action(turns=(Turn(100.0, 50.0, 0.002),))
    late, scaled = Action(log_lag_s=5.0, ground_lag_s=3.0), Action(radar_factor=0.1)
    actions = [Action(), late, turned, scaled, turned + late, Action(n_r_change=0.1)]
    records = columns_of(CARGO, SCENARIO, actions, speed_m_s=SCENARIO.speed_m_s)
    prepared = _prepare(CARGO, SCENARIO, actions, records, None)
    assert prepared.motion.tolist() == [0, 0, 1, 0, 1, 2]
    assert len(prepared.paths(TIME_S)) == 3
    together = simulate_columns(CARGO, SCENARIO, actions, TIME_S)
    faster = simulate_columns(CARGO, SCENARIO, actions, TIME_S, speed_m_s=np.full(6, 8.3))
    assert np.all(faster.speed_through_water_m_s > together.speed_through_water_m_s)
    for i, action in enumerate(actions):
        # whatever else is looked at, it is followed in the same steps
        alone = simulate_columns(CARGO, SCENARIO, [action, late], TIME_S)
        assert np.array_equal(alone.log_m_s[0], together.log_m_s[i])
        assert np.array_equal(alone.radar_position_m[0], together.radar_position_m[i])
        assert np.array_equal(alone.radar_speed_m_s[0], together.radar_speed_m_s[i])


@pytest.mark.parametrize('later_s', [-40.0, -7.3, 12.9])
def test_a_later_stop_is_that_of_another_scenario(later_s: float) -> None:
    turn = Turn(100.0, 50.0, 0.002, drag_area_m2=9.0)
    actions = [
        Action(wind_m_s=(3.0, 1.0), turns=(turn,)),
        Action(log_lag_s=5.0, ground_lag_s=3.0, log_late_s=-2.0),
        Action(turns=(Turn(700.0, 100.0 - 1e-9, 0.002),)),  # nearly until the record ends
        Action(turns=(Turn(760.0, 43.0, 0.001, 200.0, edge_s=8.0), Turn(815.0, 50.0, 0.0, 500.0))),
        Action(current_change_m_s=(0.3, 0.0), log_error=(lambda speed, after: 1e-3 * after,)),
    ]
    shown = simulate_columns(
        CARGO, SCENARIO, actions * 2, TIME_S, later_s=np.repeat([0.0, later_s], 5)
    )
    for part, later in ((slice(5), 0.0), (slice(5, 10), later_s)):
        whole = SCENARIO.lead_in_s + later, SCENARIO.duration_s - later
        scenario = replace(SCENARIO, lead_in_s=whole[0], duration_s=whole[1])
        other = simulate_columns(CARGO, scenario, actions, TIME_S)
        for name in ('log_m_s', 'radar_speed_m_s', 'radar_position_m'):
            found, expected = getattr(shown, name)[part], getattr(other, name)
            np.testing.assert_allclose(found, expected, atol=0.1 if 'position' in name else 1e-3)
