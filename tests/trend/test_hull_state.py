# SPDX-License-Identifier: Apache-2.0
"""The posterior of a hull's state, against direct Gaussian algebra and against a world."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship.sections import Economics
from shipdrag_ros.trend import hull_state as change_points
from shipdrag_ros.trend.hull_state import (
    GROWTH_PER_YEAR,
    LEVEL_SD,
    Growth,
    HullState,
    Runs,
    Steps,
    search,
)
from shipdrag_ros.trend.ship_trend import cleaning_date, fuel_t_per_day, usd_per_year


def runs(years, added, sd=0.01, covariates=None):
    years = np.asarray(years, float)
    columns = np.zeros((len(years), 0)) if covariates is None else np.asarray(covariates, float)
    return Runs(years, np.asarray(added, float), np.full(len(years), sd), columns)


def saturating(rng, years=2.0, scatter=0.015):
    """Fouling as growth that slows, which is not the law of the model."""
    at = np.sort(rng.uniform(0.0, years, 40))
    most, time = rng.uniform(0.2, 0.4), rng.uniform(1.0, 3.0)
    level = most * (1.0 - np.exp(-at / time))
    noise = rng.normal(0.0, np.hypot(scatter, 0.01), len(at))
    return runs(at - at[0], level + noise), level


def test_evidence_is_that_of_the_joint_normal():
    """One setting of the sizes, by hand."""
    years = np.array([0.0, 0.3, 0.9])
    state = HullState(runs(years, [0.02, 0.05, 0.11], sd=0.02), Steps(), Growth())
    number = int(np.argmax(state.weights))
    scatter, wander, walk = state._settings[number]
    first = np.minimum(years[:, None], years[None, :])
    apart = np.abs(years[:, None] - years[None, :])
    covariance = (
        LEVEL_SD**2
        + GROWTH_PER_YEAR[1] ** 2 * np.outer(years, years)
        + wander**2 * (first**3 / 3.0 + apart * first**2 / 2.0)
        + walk**2 * first
        + np.diag(0.02**2 + scatter**2 + np.zeros(3))
    )
    np.testing.assert_allclose(np.linalg.inv(state._precision[number]), covariance, rtol=1e-3)
    mean = GROWTH_PER_YEAR[0] * years
    found = multivariate_normal(mean, covariance).logpdf([0.02, 0.05, 0.11])
    white = state._residual @ state._precision[number] @ state._residual
    sign, size = np.linalg.slogdet(covariance)
    assert sign > 0.0
    assert found == pytest.approx(-0.5 * (white + size + 3.0 * np.log(2.0 * np.pi)), abs=0.01)


def test_level_and_growth_hold_on_a_law_that_is_not_the_models():
    """N = 40 ships, seed 7: 95 % bands cover 86 to 100 % (3 sd of the count)."""
    rng = np.random.default_rng(7)
    inside, growths = [], []
    for _ in range(40):
        seen, level = saturating(rng)
        state = HullState(seen, Steps(), Growth())
        found = state.level(seen.years)
        inside.append(np.mean(np.abs(found.value - level) < 1.96 * found.sd))
        slope = state.growth_per_year()
        true = (level[-1] - level[0]) / seen.years[-1]
        growths.append(abs(slope.value[0] - true) < 1.96 * slope.sd[0])
    assert 0.86 < np.mean(inside) <= 1.0
    assert 0.86 < np.mean(growths) <= 1.0


def test_one_run_far_off_is_an_outlier_and_moves_nothing():
    rng = np.random.default_rng(3)
    seen, _ = saturating(rng)
    spoilt = seen.added.copy()
    spoilt[20] += 0.6
    state = HullState(runs(seen.years, spoilt), Steps(), Growth())
    clean = HullState(seen, Steps(), Growth())
    assert state.outlier[20] > 0.99
    assert np.delete(state.outlier, 20).max() < 0.5
    moved = state.level(seen.years).value - clean.level(seen.years).value
    assert np.abs(moved).max() < 0.02


def test_a_known_step_is_measured_and_is_no_growth():
    years = np.linspace(0.0, 2.0, 30)
    added = 0.02 + 0.1 * years - 0.09 * (years >= 1.0)
    state = HullState(runs(years, added), Steps(np.array([1.0])), Growth())
    change = state.changes()
    assert change.value[0] == pytest.approx(-0.09, abs=3.0 * change.sd[0])
    growth = state.growth_per_year()
    assert growth.value[0] == pytest.approx(0.1, abs=3.0 * growth.sd[0])


def test_draught_is_taken_out():
    rng = np.random.default_rng(5)
    years = np.linspace(0.0, 2.0, 40)
    volume = rng.choice([-0.15, 0.15], 40)
    added = 0.02 + 0.1 * years + 0.7 * volume
    with_it = HullState(runs(years, added, covariates=volume[:, None]), Steps(), Growth())
    without = HullState(runs(years, added), Steps(), Growth())
    assert with_it.growth_per_year().sd[0] < 0.3 * without.growth_per_year().sd[0]
    assert with_it.growth_per_year().value[0] == pytest.approx(0.1, abs=0.02)


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


PRICES = Economics(
    fuel_usd_per_t=600.0,
    sfoc_g_per_kwh=180.0,
    propulsive_efficiency=0.6,
    days_at_sea_per_year=240.0,
    cleaning_usd=30_000.0,
)


def test_fuel_and_money():
    # 600 kW effective are 1000 kW brake: 180 kg an hour
    assert fuel_t_per_day(PRICES, 600.0) == pytest.approx(4.32)
    assert usd_per_year(PRICES, 100_000.0, 6.0) == pytest.approx(4.32 * 600.0 * 240.0)


def test_the_date_is_the_one_of_least_cost_a_year():
    per_unit, growth = 1.0e6, 0.1
    found = cleaning_date(PRICES, per_unit, Parameter(0.0, 1e-6), Parameter(growth, 1e-6))
    interval = np.linspace(0.2, 3.0, 2000)
    cost = (PRICES.cleaning_usd + 0.5 * per_unit * growth * interval**2) / interval
    assert found.years == pytest.approx(interval[cost.argmin()], abs=0.01)


def test_what_is_due_is_due_now():
    found = cleaning_date(PRICES, 1.0e6, Parameter(0.4, 0.01), Parameter(0.1, 0.01))
    assert (found.years, found.latest) == (0.0, 0.0)


@pytest.mark.parametrize(
    'growth', [Parameter(0.05, 0.1), Parameter(-0.05, 0.01), Parameter(0.002, 0.0005)]
)
def test_no_date_where_the_data_cannot_carry_one(growth):
    assert cleaning_date(PRICES, 1.0e6, Parameter(0.0, 0.02), growth) is None
