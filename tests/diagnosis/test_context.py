# SPDX-License-Identifier: Apache-2.0
"""What is measured besides the motion, and how far it may be wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis.context import Context, Stop
from shipdrag_ros.estimation import Window
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Propulsion, Ship, TableBaseline
from shipdrag_ros.simulation import (
    START_NS,
    Action,
    Scenario,
    Truth,
    sense,
    simulate,
    simulate_columns,
    standard_sensors,
)
from shipdrag_ros.simulation.surge import turning

_TIMES = np.arange(0.0, 5610.0, 10.0)


@pytest.mark.parametrize(('gain', 'turned_rad'), [(1.05, 0.0), (1.0, 0.05)])
def test_an_anemometer_that_is_wrong_by_its_sd_is_no_other_speed(cargo, gain, turned_rad):
    scenario = Scenario(speed_m_s=8.0, lead_in_s=600.0, duration_s=1200.0, heading_rad=0.7)
    inputs = ('speed_through_water', 'wind_apparent')
    block = sense(simulate(cargo, scenario), standard_sensors(inputs=inputs), seed=3)
    first, last = int(block.stamp_ns.min()), int(block.stamp_ns.max())
    window = Window.from_block(block, START_NS + 600 * 10**9, last, before_ns=first)
    stop = Stop(first, 600.0, 0.7, 8.0)
    times = np.arange(0.0, 1800.0, 10.0)
    right = Context.of(window, cargo, times, stop)
    ahead, port = block.value[block.channel == Channel.WIND_APPARENT, :2].T
    cos, sin = gain * np.cos(turned_rad), gain * np.sin(turned_rad)
    value = block.value.copy()
    value[block.channel == Channel.WIND_APPARENT, 0] = cos * ahead - sin * port
    value[block.channel == Channel.WIND_APPARENT, 1] = cos * port + sin * ahead
    wrong_window = Window.from_block(
        replace(block, value=value), START_NS + 600 * 10**9, last, before_ns=first
    )
    wrong = Context.of(wrong_window, cargo, times, stop)
    away = wrong.whitener @ (wrong.value - right.value)
    # one standard deviation of one unknown
    assert float(away @ away) < 1.5


def _shaft_of(cargo: Ship, after: Callable[[Float64, Float64], Float64]) -> tuple[Context, Truth]:
    """Return the context of a run whose shaft, over the steady one, is some function after it."""
    speed = np.linspace(0.0, 10.0, 101)
    baseline = TableBaseline(tuple(speed), tuple(3e3 * speed**2), 0.01)
    ship = replace(cargo, baseline=baseline, propulsion=Propulsion(2.0, 0.5))
    truth = simulate(ship, Scenario(speed_m_s=8.0, lead_in_s=610.0, duration_s=5000.0))
    block = sense(truth, standard_sensors(inputs=('speed_through_water', 'shaft')), seed=3)
    first, last = int(block.stamp_ns.min()), int(block.stamp_ns.max())
    shaft = block.channel == Channel.SHAFT
    after_s = (block.stamp_ns[shaft] - START_NS) * 1e-9 - 610.0
    part = np.interp(after_s + 610.0, truth.time_s, truth.speed_through_water_m_s) / 8.0
    value = block.value.copy()
    value[shaft, 0] = 11.0 * np.where(after_s > 0.0, after(after_s, part), 1.0)
    window = Window.from_block(
        replace(block, value=value), START_NS + 610 * 10**9, last, before_ns=first
    )
    return Context.of(window, ship, _TIMES, Stop(first, 610.0, 0.0, 8.0)), truth


def test_a_free_shaft_that_friction_stops_is_no_other_propeller(cargo: Ship) -> None:
    found, truth = _shaft_of(cargo, lambda _, part: 0.5 * part * turning(part, 0.25))
    assert found.turns
    columns = simulate_columns(
        truth.ship, truth.scenario, [Action()], _TIMES, speed_m_s=np.array([8.0])
    )
    chi2 = {}
    for friction_m_s in (0.0, 2.0):
        action = Action(free_shaft=0.5, friction_m_s=friction_m_s)
        away = found.whitener @ (found.value - found.predict(columns, [action], 610.0)[0])
        chi2[friction_m_s] = float(away @ away)
    assert chi2[0.0] > 10.0
    assert chi2[2.0] < 1.0


def test_rows_of_the_shaft_hold_no_reading_from_before_its_fall(cargo: Ship) -> None:
    # one minute of them says that the water turns her propeller
    found, _ = _shaft_of(cargo, lambda after_s, _: np.exp(-after_s / 2.0))
    assert not found.turns
    assert len(found.at_shaft) > 80
    assert np.abs(found.value[: len(found.at_shaft)]).max() < 0.01


def test_a_run_that_ends_before_the_shaft_has_fallen_has_no_row_of_it(cargo: Ship) -> None:
    scenario = Scenario(speed_m_s=8.0, lead_in_s=600.0, duration_s=20.0)
    block = sense(simulate(cargo, scenario), standard_sensors(), seed=3)
    first, last = int(block.stamp_ns.min()), int(block.stamp_ns.max())
    window = Window.from_block(block, START_NS + 600 * 10**9, last, before_ns=first)
    found = Context.of(window, cargo, np.arange(0.0, 621.0, 10.0), Stop(first, 600.0, 0.0, 8.0))
    assert len(found.at_shaft) == 0
