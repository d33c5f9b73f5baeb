# SPDX-License-Identifier: Apache-2.0
"""What is measured besides the motion, and how far it may be wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis.context import Context, Stop
from shipdrag_ros.estimation import Window
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Ship, TableBaseline
from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors


@pytest.mark.parametrize(('gain', 'turned_rad'), [(1.05, 0.0), (1.0, 0.05)])
def test_an_anemometer_that_is_wrong_by_its_sd_is_no_other_speed(
    cargo: Ship, gain: float, turned_rad: float
) -> None:
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


def test_a_free_shaft_that_friction_stops_is_no_other_propeller(cargo: Ship) -> None:
    speed = np.linspace(0.0, 10.0, 101)
    ship = replace(cargo, baseline=TableBaseline(tuple(speed), tuple(3e3 * speed**2), 0.01))
    scenario = Scenario(speed_m_s=8.0, lead_in_s=600.0, duration_s=5000.0)
    truth = simulate(ship, scenario)
    block = sense(truth, standard_sensors(inputs=('speed_through_water', 'shaft')), seed=3)
    first, last = int(block.stamp_ns.min()), int(block.stamp_ns.max())
    shaft = block.channel == Channel.SHAFT
    time_s = (block.stamp_ns[shaft] - START_NS) * 1e-9
    part = np.interp(time_s, truth.time_s, truth.speed_through_water_m_s) / 8.0
    free = np.where(time_s > 600.0, 0.5 * part, 1.0)
    held = np.where(time_s > 600.0, free * (1.0 - np.minimum(0.3 / part, 1.0) ** 2), 1.0)
    assert held[-1] < 0.2 * free[-1]
    found = []
    for revs in (free, held):
        value = block.value.copy()
        value[shaft, 0] = 11.0 * revs
        other = replace(block, value=value)
        window = Window.from_block(other, START_NS + 600 * 10**9, last, before_ns=first)
        stop = Stop(first, 600.0, 0.0, 8.0)
        found.append(Context.of(window, ship, np.arange(0.0, 5600.0, 10.0), stop))
    assert found[0].turns
    away = found[1].whitener @ (found[1].value - found[0].value)
    # about one standard deviation of one unknown
    assert float(away @ away) < 4.0
