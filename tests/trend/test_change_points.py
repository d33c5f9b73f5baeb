# SPDX-License-Identifier: Apache-2.0
"""Steps that no log book tells."""

import numpy as np

from shipdrag_ros.trend import hull_state as change_points
from shipdrag_ros.trend.hull_state import Growth, Runs, Steps, search

MONTH = 31.0 / 365.25


def ship(rng, cleaned=None, change=0.06):
    """Two years of weekly runs, fouling that slows, errors with long tails."""
    years = np.sort(rng.uniform(0.0, 2.0, 104))
    level = 0.3 * (1.0 - np.exp(-years / 2.0))
    if cleaned is not None:
        level = level - change * (years >= cleaned)
    error = rng.standard_t(5, 104) * np.sqrt(3.0 / 5.0) * 0.017 + rng.normal(0.0, 0.01, 104)
    seen = Runs(years - years[0], level + error, np.full(104, 0.01), np.zeros((104, 0)))
    return seen, years[0]


def test_a_cleaning_of_six_percent_is_found_and_dated():
    """N = 8, seed 11, scatter 2 %: at least 6 within a month."""
    rng = np.random.default_rng(11)
    found = 0
    for _ in range(8):
        when = rng.uniform(0.5, 1.5)
        seen, first = ship(rng, when)
        steps = search(seen, Steps(), Growth()).steps
        found += any(abs(step.year + first - when) < MONTH for step in steps)
    assert found >= 6


def test_few_steps_are_found_where_there_is_none():
    """N = 8 ships of two years, seed 12: at most 2 in 16 ship-years."""
    rng = np.random.default_rng(12)
    assert sum(len(search(ship(rng)[0], Steps(), Growth()).steps) for _ in range(8)) <= 2


def test_a_known_step_is_not_found_again():
    seen, first = ship(np.random.default_rng(13), 1.0, 0.15)
    found = search(seen, Steps(np.array([1.0 - first])), Growth())
    assert found.steps == ()
    assert len(found.state.steps) == 1
    # of 63 settings those that count are kept, each with a number for every two runs
    kept = sum(each.size for each in found.state._precision)
    assert 0 < kept < 20 * len(seen) ** 2


def test_too_few_runs_have_no_unknown_step():
    seen = Runs(
        np.array([0.0, 0.5, 1.0]), np.array([0.0, 0.3, 0.3]), np.full(3, 0.01), np.zeros((3, 0))
    )
    assert search(seen, Steps(), Growth()).steps == ()


def test_two_steps_at_one_time_are_one(monkeypatch):
    monkeypatch.setattr(change_points, 'PROBABLE', 0.0)
    monkeypatch.setattr(change_points, '_most_likely', lambda more: (0.5, 0.9))
    seen, _ = ship(np.random.default_rng(14))
    assert [step.year for step in search(seen, Steps(), Growth()).steps] == [0.5]
