# SPDX-License-Identifier: Apache-2.0
"""What is in every record is nothing: filters, slow noise, displays, thrust that falls its way."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from shipdrag_ros.diagnosis.diagnose import compare
from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.observation import Observation, _condensed
from shipdrag_ros.estimation.steady import display_sd, white_sd
from shipdrag_ros.inference.decision import NONE, Names
from shipdrag_ros.inference.rows import LOG
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

SHIP = Ship.example()
LEAD_IN_S = 1200.0
EDGES = np.arange(0.0, LEAD_IN_S + 301.0, 6.0)


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
    def probability(*effects: str) -> Mapping[Names, float]:
        return compare((seen_of(*effects),), SHIP, Facts(SHIP)).compare().probability

    assert probability('log_lag=8')[NONE] > 0.5
    assert probability('log_lag=60')['log_lag',] > 0.9


def test_noise_behind_a_filter_is_that_of_its_means() -> None:
    # N = 4, seeds 0..3: samples err alike for 4 s, which their neighbours do not show
    for seed in range(4):
        time, value = steady(seed, 4.0)
        of_sample = white_sd(value)
        rows = _condensed(time, 7.0 + value, EDGES, (of_sample, 0.0), LOG, LEAD_IN_S)
        scatter = np.var(rows.value)
        assert 0.5 < np.median(rows.variance) / scatter < 2.0
        assert of_sample**2 / 30.0 < 0.1 * scatter


def test_white_noise_stays_as_it_is() -> None:
    rng = np.random.default_rng(5)
    time = np.arange(0.5, LEAD_IN_S + 300.0)
    value = 7.0 + 0.05 * rng.standard_normal(len(time))
    rows = _condensed(time, value, EDGES, (0.05, 0.0), LOG, LEAD_IN_S)
    assert np.median(rows.variance) == pytest.approx(0.05**2 / 6.0, rel=0.5)


def test_a_coarse_display_of_places_hides_as_much_on_any_course() -> None:
    way = np.round(7.0 * np.arange(600.0) / 20.0) * 20.0
    still = np.zeros(len(way))
    north, east = (display_sd(np.column_stack(xy), 0.0) for xy in ((still, way), (way, still)))
    assert north == east == pytest.approx(20.0 / np.sqrt(12.0))


def test_a_coarse_display_hides_more_while_the_speed_stands() -> None:
    time = np.arange(0.1, LEAD_IN_S + 300.0, 0.2)
    true = 3.02 - 0.01 * np.maximum(time - LEAD_IN_S, 0.0)
    shown = 0.05 * np.round(true / 0.05)
    noise = (white_sd(shown), display_sd(shown[time > LEAD_IN_S], white_sd(shown)))
    rows = _condensed(time, shown, EDGES, noise, LOG, LEAD_IN_S)
    error = np.abs(rows.value - np.interp(rows.time_s, time, true))
    assert (error < 3.0 * np.sqrt(rows.variance)).all()
    before, after = rows.time_s < LEAD_IN_S - 20.0, rows.time_s > LEAD_IN_S + 20.0
    assert np.sqrt(rows.variance[before]).min() > 0.01
    assert np.median(rows.variance[after]) < np.median(rows.variance[before])
