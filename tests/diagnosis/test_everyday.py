# SPDX-License-Identifier: Apache-2.0
"""What is in every record is nothing: filters, slow noise, displays, thrust that falls its way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from shipdrag_ros.diagnosis.diagnose import compare
from shipdrag_ros.diagnosis.known import Facts
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.estimation.record import RunRows, display_sd, weighted_white_sd
from shipdrag_ros.estimation.run_down import RunDown
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.decision import NONE, Names
from shipdrag_ros.inference.rows import Rows
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64
from shipdrag_ros.ship import Ship

SHIP = Ship.example()
LEAD_IN_S = 1200.0


def steady(seed: int, lag_s: float) -> tuple[Float64, Float64]:
    """Return times at 5 Hz, and noise of 0.03 m/s that a filter has passed."""
    time = np.arange(0.1, LEAD_IN_S + 300.0, 0.2)
    raw = np.random.default_rng(seed).standard_normal(len(time))
    keep = np.exp(-0.2 / lag_s)
    noise = np.empty(len(time))
    last = raw[0]
    for i, each in enumerate(raw):
        last = keep * last + np.sqrt(1.0 - keep**2) * each
        noise[i] = last
    return time, 0.03 * noise


def test_the_filter_of_a_log_is_no_effect(seen_of: Callable[..., Observation]) -> None:
    assert probability_of((), seen_of('log_lag=8')) > 0.5
    assert probability_of(('log_lag',), seen_of('log_lag=60')) > 0.9


def test_light_air_is_no_wind(seen_of: Callable[..., Observation]) -> None:
    assert probability_of(('wind',), seen_of('wind=1.5')) < 0.1
    assert probability_of(('wind',), seen_of('wind=12')) > 0.6


def probability_of(sought: Names, seen: Observation) -> float:
    """Return the probability of nothing, or of all that holds a name."""
    found = compare((seen,), SHIP, Facts(SHIP)).compare().probability
    return (
        found[NONE] if not sought else sum(p for names, p in found.items() if sought[0] in names)
    )


def rows_of(time: Float64, value: Float64) -> tuple[Rows, Float64]:
    """Condense a log that is read until the stop and beyond; times count from it."""
    block = Block.of(Channel.SPEED_THROUGH_WATER, np.round(time * 1e9).astype(np.int64), value)
    window = Window.from_block(block, round(LEAD_IN_S * 1e9), round(time[-1] * 1e9), before_ns=0)
    record = RunRows.of(window, RunDown.of(window, SHIP), Parameters())
    return record.condensed(7.0, np.inf)


def test_noise_behind_a_filter_is_that_of_its_means() -> None:
    # N = 4, seeds 0..3: samples err alike for 4 s, which their neighbours do not show
    for seed in range(4):
        time, value = steady(seed, 4.0)
        rows, variance = rows_of(time, 7.0 + value)
        late = rows.time_s > 0.0  # over longer means it is noise that wanders, which is learnt
        assert 0.3 < np.mean((rows.value - 7.0)[late] ** 2 / variance[late]) < 2.0
        of_sample = weighted_white_sd(value, np.ones(len(value)))
        assert of_sample**2 / 30.0 < 0.1 * np.var(rows.value)


def test_white_noise_stays_as_it_is() -> None:
    rng = np.random.default_rng(5)
    time = np.arange(0.5, LEAD_IN_S + 300.0)
    rows, variance = rows_of(time, 7.0 + 0.05 * rng.standard_normal(len(time)))
    # a mean of so many readings, 30 of which are in one of the steady record
    assert variance[10] == pytest.approx(0.05**2 / 30.0, rel=0.5)
    assert 0.5 < np.mean((rows.value - 7.0) ** 2 / variance) < 1.5


def test_a_coarse_display_of_places_hides_as_much_on_any_course() -> None:
    way = np.round(7.0 * np.arange(600.0) / 20.0) * 20.0
    still = np.zeros(len(way))
    north, east = (display_sd(np.column_stack(xy), 0.0) for xy in ((still, way), (way, still)))
    assert north == east == pytest.approx(20.0 / np.sqrt(12.0))


def test_a_coarse_display_hides_more_while_the_speed_stands() -> None:
    time = np.arange(0.1, LEAD_IN_S + 300.0, 0.2)
    true = 3.02 - 0.01 * np.maximum(time - LEAD_IN_S, 0.0)
    shown = 0.05 * np.round(true / 0.05)
    rows, variance = rows_of(time, shown)
    error = np.abs(rows.value - np.interp(rows.time_s + LEAD_IN_S, time, true))
    assert (error < 3.0 * np.sqrt(variance)).all()
    before, after = rows.time_s < -20.0, rows.time_s > 20.0
    assert np.sqrt(variance[before]).min() > 0.01
    assert np.median(variance[after]) < np.median(variance[before])
