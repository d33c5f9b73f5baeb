# SPDX-License-Identifier: Apache-2.0
"""The stop is found in the speed, whatever was taken for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.diagnosis.context import stop_time_s
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, simulate
from tests.runs import CARGO, coasted

SHIP = Ship.load(Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml')
RUN_DOWN_S = 8.0


def speed_of(seed: int, sd_m_s: float = 0.05) -> tuple[Float64, Float64]:
    """Return times from the stop, and readings."""
    truth = simulate(SHIP, Scenario(speed_m_s=8.0, lead_in_s=600.0, duration_s=900.0))
    time = np.arange(-600.0, 900.0)
    speed = np.interp(time, truth.time_s - 600.0, truth.speed_through_water_m_s)
    return time, speed + sd_m_s * np.random.default_rng(seed).standard_normal(len(time))


@pytest.mark.parametrize('wrong_s', [-25.0, -8.0, 0.0, 12.0, 30.0])
def test_the_stop_is_found_to_some_seconds(wrong_s: float) -> None:
    # N = 6 each, seeds 0..5; the simple form is off by 2 s
    away = []
    for seed in range(6):
        time, speed = speed_of(seed)
        found = stop_time_s(time + wrong_s, speed, sd_m_s=0.05, run_down_s=RUN_DOWN_S)
        away.append(abs(found - wrong_s))
    assert max(away) < 4.0


def test_outliers_do_not_move_it() -> None:
    time, speed = speed_of(7)
    speed[::23] *= 1.5
    assert stop_time_s(time, speed, sd_m_s=0.05, run_down_s=RUN_DOWN_S) == pytest.approx(
        0.0, abs=5.0
    )


def test_where_nothing_falls_or_too_little_is_there_nothing_is_moved() -> None:
    time, speed = speed_of(8)
    steady = np.full(len(time), 8.0)
    assert stop_time_s(time, steady, sd_m_s=0.05, run_down_s=RUN_DOWN_S) == 0.0
    late = time > -10.0
    assert stop_time_s(time[late], speed[late], sd_m_s=0.05, run_down_s=RUN_DOWN_S) == 0.0


def test_a_stop_that_a_person_tells_is_not_sought_and_is_no_fall_of_a_shaft() -> None:
    run = coasted(inputs=('speed_through_water',), seed=3)
    stop_ns = run.window.start_ns
    late = replace(run.window, told_ns=stop_ns + 12 * 10**9)
    found = Observation.of(late, CARGO, Parameters(), name='run')
    assert found.stopped_ns - stop_ns == pytest.approx(12e9, abs=0.5e9)
    assert found.stop_sd_s < 6.0
    assert CARGO.propulsion is not None
    assert found.context.stop.shaft_s == 0.0
    assert found.context.run_down_s is None
    assert len(found.context) == 0
