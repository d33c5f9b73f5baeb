# SPDX-License-Identifier: Apache-2.0
"""Derivatives, closed forms, and evidence against sampling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from shipdrag_ros.inference.linear import (
    ALONE,
    Families,
    evidences,
    products_of,
    solve,
    whitened_products,
)
from shipdrag_ros.inference.rows import (
    CODES,
    KIND_COUNT,
    LOG,
    OVER_GROUND,
    POSITION,
    WHITE,
    Noise,
    Rows,
    Settings,
    whiten,
)
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.laplace import NormalMixture, mix
from shipdrag_ros.posterior.motion import predict
from shipdrag_ros.posterior.priors import (
    HELD,
    HELD_CHANCE,
    HELD_FORCE,
)
from shipdrag_ros.posterior.problem import RunModel, StopPrior
from shipdrag_ros.posterior.weather import Weather
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import LIBRARY


def problem_of(
    ship: Ship,
    *,
    seed: int = 0,
    codes: Sequence[int] = (LOG, OVER_GROUND, POSITION),
    weather: Weather | None = None,
    geodetic: Sequence[int] = (),
) -> RunModel:
    """Set up 120 rows of the model's own motion, of instruments with white noise."""
    rng = np.random.default_rng(seed)
    time_s = np.sort(np.concatenate([rng.uniform(-300.0, 0.0, 40), rng.uniform(0.0, 900.0, 80)]))
    kind = np.resize(codes, 120)
    variance = np.where(kind % KIND_COUNT == POSITION, 25.0, 0.02**2)
    rows = Rows(time_s, kind, np.zeros(120))
    of_run = partial(
        RunModel.of,
        variance=variance,
        steady=40,
        ship=ship,
        stop=StopPrior(5.0, 8.0, 2.0),
        speeds_m_s=(4.0, 8.0, 8.0),
        weather=weather,
        geodetic=geodetic,
    )
    empty = of_run(rows)
    exact = -predict(empty.forces, empty.start, empty.grid_s, rows)[0][0]
    rows = rows._replace(value=exact + np.sqrt(variance) * rng.standard_normal(120))
    return of_run(rows)


@pytest.mark.parametrize('codes', [(LOG, OVER_GROUND, POSITION), tuple(CODES.values())])
def test_derivatives_are_those_of_the_prediction(ship: Ship, codes: tuple[int, ...]) -> None:
    problem = problem_of(ship, codes=codes)
    k = problem.coefficients
    now = problem.start.copy()
    now[k + motion.EXTRAS :] += 0.5
    now[:k] += 0.01
    now[k + motion.STOP], now[k + motion.LAG], now[k + motion.GROUND_LAG] = 1.3, 4.0, 2.0
    now[k + motion.SCALE], now[k + motion.CURRENT], now[k + motion.LEFT] = 0.01, 0.2, 0.3
    now[k + motion.GROUND_SCALE] = 0.05

    def predicted(unknowns: Float64) -> Float64:
        return -predict(problem.forces, unknowns, problem.grid_s, problem.rows)[0][0]

    table, _ = predict(problem.forces, now, problem.grid_s, problem.rows)
    for place in range(len(now)):
        step = np.zeros(len(now))
        step[place] = 1e-5
        by = (predicted(now + step) - predicted(now - step)) / 2e-5
        size = max(float(np.abs(by).max()), 1e-3)
        # where a reading is taken at a node of a table, the slope jumps a little
        np.testing.assert_allclose(table[1 + place], by, rtol=0.0, atol=0.01 * size)


def test_a_held_force_is_sized_by_r_of_the_hull_it_slows(ship: Ship) -> None:
    problem = problem_of(replace(ship, baseline=None), weather=Weather(None, None))
    held = problem.families.named(HELD_FORCE)
    sizes = dict(zip(held.level, held.precision[:, problem.of_hull] ** -0.5))
    assert len(sizes) > 2
    for level, size in sizes.items():
        assert size == pytest.approx(HELD.sd * level)
    assert problem.families.chance.sum() == pytest.approx(1.0)
    assert held.chance.sum() == pytest.approx(HELD_CHANCE.mean)


def test_thrust_that_is_left_is_part_of_that_before_the_stop(ship: Ship) -> None:
    problem = problem_of(ship)
    now = problem.start.copy()
    now[problem.coefficients + motion.LEFT] = 0.5
    _, rate = motion.integrate(problem.forces, now, problem.grid_s)
    assert rate[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert rate[:, 0].max() < 1e-9


def test_each_log_and_each_ground_source_has_its_own_unknowns_and_all_one_current(ship):
    problem = problem_of(ship, codes=tuple(CODES.values()))
    k, rows = problem.coefficients, problem.rows
    table, _ = predict(problem.forces, problem.start, problem.grid_s, rows)
    for name, code in CODES.items():
        mine, at = rows.kind == code, 1 + k + motion.own(code)
        own = {LOG: motion.SCALE, OVER_GROUND: motion.GROUND_LAG, POSITION: motion.PLACE}
        line = table[at + own[code % KIND_COUNT]]
        assert np.any(line[mine] != 0.0), name
        assert not np.any(line[~mine]), name
    current = table[1 + k + motion.CURRENT] != 0.0
    assert np.array_equal(current, ~rows.of(LOG))


def _all_right(problem: RunModel) -> NDArray[np.bool_]:
    """Return which families hold that no instrument is wrong."""
    families, first = problem.families, problem.coefficients + motion.SCALE
    usual = families.precision[families.usual][:, first:]
    return np.any(np.all(families.precision[:, None, first:] == usual, axis=2), axis=1)


def test_each_instrument_may_be_wrong_but_the_scale_of_latitude_and_longitude(ship: Ship) -> None:
    codes = LOG, OVER_GROUND, POSITION, CODES['position_2']
    second = motion.GROUND_SCALE + motion.own(codes[3])
    effects = {
        motion.SCALE: LIBRARY['log_scale'],
        motion.OFFSET: LIBRARY['log_offset'],
        motion.LAG: LIBRARY['log_lag'],
        motion.GROUND_SCALE: LIBRARY['radar_scale'],
        second: LIBRARY['radar_scale'],
    }
    of_earth = {motion.GROUND_SCALE: {POSITION}, second: {codes[3]}}
    for geodetic in ((), (POSITION,), codes[2:]):
        problem = problem_of(ship, codes=codes, weather=Weather(None, None), geodetic=geodetic)
        families = problem.families
        nothing = families.usual
        assert families.chance.sum() == pytest.approx(1.0)
        each = np.column_stack([families.mean, families.precision])
        for name in np.unique(families.name):
            some = each[families.name == name]
            assert len(np.unique(some, axis=0)) == len(some), name
        for place, effect in effects.items():
            at = problem.coefficients + place
            mean, sd = effect.parameters[0].prior.moments()
            wrong = np.isclose(families.precision[:, at] ** -0.5, sd)
            may = not of_earth.get(place, set()) & set(geodetic)
            assert np.all(families.mean[wrong, at] == mean)
            assert not np.any(wrong & nothing)
            odds = families.chance[wrong].sum() / families.chance[_all_right(problem)].sum()
            assert odds == pytest.approx(effect.odds * may)


def test_motion_of_quadratic_drag_is_exact(ship: Ship) -> None:
    # du/dt = -c u^2 / (1 + n): u = u0 / (1 + c u0 t / (1 + n))
    grid = np.linspace(0.0, 10.0, 41)
    c, n = 5e-4, 0.05
    value = np.stack([c * grid**2, 2.0 * c * grid])
    inertia = np.stack([np.full(41, 1.0 + n), np.zeros(41)])
    forces = motion.Forces(0.25, value, np.zeros((2, 0, 41)), inertia, 0.0)
    unknowns = np.zeros(motion.EXTRAS)
    unknowns[motion.SPEED] = 8.0
    time_s = np.linspace(0.0, 1000.0, 50)
    rows = Rows(time_s, np.full(50, LOG), np.zeros(50))
    table, _ = predict(forces, unknowns, np.linspace(0.0, 1000.0, 81), rows)
    np.testing.assert_allclose(-table[0], 8.0 / (1.0 + c * 8.0 * time_s / (1.0 + n)), rtol=1e-6)


def test_a_linear_model_has_its_closed_form() -> None:
    rng = np.random.default_rng(2)
    n, p = 30, 4
    columns, value = rng.standard_normal((p, n)), rng.standard_normal(n)
    mean, sd, variance = rng.standard_normal(p), rng.uniform(0.5, 2.0, p), 0.3
    rows = Rows(np.arange(n, dtype=float), np.zeros(n, np.int64), value)
    ones = np.ones(n)
    noise = Noise(np.full(n, variance), WHITE, ones, ones)
    families = Families(mean[None], 1.0 / sd[None] ** 2, np.zeros(1))
    table = np.concatenate([value[None], columns])
    alone = Settings(np.array([WHITE]), np.ones((1, 3)), np.ones(1), np.ones(1))
    products, log_dets = whitened_products(table, rows, noise, 0, alone)
    weight, *kept = mix(products, log_dets, alone.weight, families, families)
    step, covariance = NormalMixture(*kept).moments()
    exact = np.linalg.inv(columns @ columns.T / variance + np.diag(sd**-2.0))
    np.testing.assert_allclose(covariance, exact, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        step, exact @ (columns @ value / variance + mean / sd**2), rtol=1e-9
    )
    assert weight == pytest.approx(1.0)
    # the evidence is the density of the readings under N(mean columns, columns' sd^2 columns + 1)
    log_det = whiten(rows, table, noise)
    log_evidence = evidences(products_of(table)[None], mean[None], sd[None] ** -2.0)[0, 0]
    of_rows = columns.T * sd**2 @ columns + variance * np.eye(n)
    away = value - mean @ columns
    wanted = -0.5 * (away @ np.linalg.solve(of_rows, away) + np.linalg.slogdet(of_rows)[1])
    assert log_evidence - 0.5 * log_det == pytest.approx(wanted, abs=1e-8)


@pytest.mark.parametrize('seed', [0, 1])
def test_log_evidence_is_that_of_long_sampling(ship: Ship, seed: int) -> None:
    # 4000 points by importance, seeds 0 and 1; the motion is not linear, within 0.5
    problem = problem_of(ship, seed=seed)
    mean, precision = problem.families.mean[0], problem.families.precision[0]

    def log_joint(unknowns: Float64) -> float:
        table, _ = predict(problem.forces, unknowns, problem.grid_s, problem.rows)
        white = table[:1] / np.sqrt(problem.white.variance)
        away = unknowns - mean
        of_prior = 0.5 * np.log(precision) - 0.5 * precision * away**2
        return float(-0.5 * (white**2).sum() + of_prior.sum())

    now = mean.copy()
    for _ in range(6):
        table, _ = predict(problem.forces, now, problem.grid_s, problem.rows)
        table /= np.sqrt(problem.white.variance)
        model = products_of(table)[None], mean[None] - now, precision[None]
        (log_evidence,), (step,), (covariance,) = solve(*model, ALONE, 0, len(now))
        now = now + step
    root = np.linalg.cholesky(covariance) * 1.1
    z = np.random.default_rng(seed).standard_normal((4000, len(now)))
    log_of_draw = -0.5 * (z**2).sum(axis=1) - np.log(np.diag(root)).sum()
    ratio = np.array([log_joint(now + root @ each) for each in z]) - log_of_draw
    sampled = ratio.max() + np.log(np.mean(np.exp(ratio - ratio.max())))
    assert log_evidence == pytest.approx(sampled, abs=0.5)
