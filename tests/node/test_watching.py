# SPDX-License-Identifier: Apache-2.0
"""Clocks that are set are seen, and what only looks like it is not."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.node.watching import OwnClock, SensorClock, both_ns, set_by
from shipdrag_ros.samples import Float64

SECOND_NS = 10**9


def steps(lags_s: Float64) -> list[tuple[int, float]]:
    """Return when a step was seen, and how large."""
    clock = SensorClock()
    found = [(tick, clock.step_s(float(lag))) for tick, lag in enumerate(lags_s)]
    return [(tick, step_s) for tick, step_s in found if step_s]


def lags(seed: int) -> Float64:
    """Some hundredths of a second, and now and then some tenths."""
    rng = np.random.default_rng(seed)
    late = 0.3 * (rng.random(120) < 0.05)
    return np.asarray(0.02 + rng.exponential(0.01, 120) + late)


@pytest.mark.parametrize('step_s', [-30.0, -1.5, 1.5, 30.0])
def test_the_clock_of_this_computer_is_held_against_one_that_nobody_sets(step_s: float) -> None:
    clock = OwnClock()
    found = []
    for second in range(20):
        now_ns = second * SECOND_NS + round((step_s if second >= 12 else 0.0) * SECOND_NS)
        found.append(clock.step_s(now_ns, second * SECOND_NS))
    assert found == pytest.approx([step_s if second == 12 else 0.0 for second in range(20)])


def test_both_clocks_of_this_computer_go_on() -> None:
    clock = OwnClock()
    moments = [moment for moment in (both_ns() for _ in range(50)) if moment is not None]
    assert moments
    assert not any(clock.step_s(*moment) for moment in moments)


@pytest.mark.parametrize('seed', range(5))
def test_a_sensor_whose_clock_is_set_forward_is_seen_at_once(seed: int) -> None:
    lag = lags(seed)
    lag[60:] -= 3.0
    ((tick, step_s),) = steps(lag)
    assert tick <= 64
    assert step_s == pytest.approx(3.0, abs=0.7)


@pytest.mark.parametrize('seed', range(5))
def test_a_sensor_whose_clock_is_set_back_is_seen_when_its_lag_stays(seed: int) -> None:
    lag = lags(seed)
    lag[60:] += 3.0
    ((tick, step_s),) = steps(lag)
    assert tick <= 82
    assert step_s == pytest.approx(-3.0, abs=0.7)


@pytest.mark.parametrize('seed', range(5))
def test_a_network_that_stalls_sets_no_clock(seed: int) -> None:
    lag = lags(seed)
    lag[60:75] += np.linspace(8.0, 0.0, 15)
    assert steps(lag) == []


def test_a_sensor_that_is_silent_tells_nothing() -> None:
    clock = SensorClock()
    assert not any(clock.step_s(None) for _ in range(50))


def test_it_is_said_which_way() -> None:
    assert set_by(3.0) == 'went forward by 3.0 s'
    assert set_by(-3.0) == 'went back by 3.0 s'
