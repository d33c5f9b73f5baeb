# SPDX-License-Identifier: Apache-2.0
"""The band of r(v) is that of the mixture, and its parts add up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.laplace import NormalMixture, RunPosterior, infer
from shipdrag_ros.posterior.readout import read
from shipdrag_ros.posterior.weather import Weather
from shipdrag_ros.ship import Ship
from tests.posterior.test_exact import problem_of

SPEED_M_S = np.linspace(4.5, 7.5, 20)


@pytest.fixture(scope='module')
def found(ship: Ship) -> RunPosterior:
    return infer(problem_of(ship, weather=Weather(None, None)))


def test_the_mixture_has_the_moments_of_the_posterior(found: RunPosterior) -> None:
    mean, covariance = found.force.moments()
    free = found.problem.free_forces
    np.testing.assert_allclose(mean, 0.0, atol=1e-9)
    np.testing.assert_allclose(
        covariance, found.covariance[np.ix_(free, free)], rtol=1e-6, atol=1e-12
    )


@pytest.mark.parametrize('rare', [0.0, 0.02, 0.2])
def test_the_band_holds_95_percent_of_draws_from_the_mixture(found, rare: float) -> None:
    # N = 40 000, seed 0: the share is within 0.004 (3.7 standard errors) of 0.95
    free, sd = found.problem.free_forces, np.sqrt(np.diag(found.covariance))
    away = np.zeros((2, len(free)))
    away[1, 0] = 12.0 * sd[0]
    away -= np.array([1.0 - rare, rare]) @ away
    narrow = found.covariance[np.ix_(free, free)]
    weight = np.array([1.0 - rare, rare])
    mixed = replace(found, force=NormalMixture(weight, away, np.stack([narrow, 4.0 * narrow])))
    mixed = replace(mixed, covariance=found.covariance.copy())
    mixed.covariance[np.ix_(free, free)] = mixed.force.moments()[1]
    part = read(mixed, SPEED_M_S)
    rng = np.random.default_rng(0)
    columns = motion.shapes_at(found.problem.forces, SPEED_M_S)[1][0][free]
    which = (rng.random(40_000) < rare).astype(int)
    drawn = rng.multivariate_normal(np.zeros(len(free)), narrow, 40_000) * (1.0 + which[:, None])
    off = (drawn + away[which]) @ columns
    inside = np.mean(np.abs(off) <= 1.96 * part.sigma_m_s2, axis=0)
    np.testing.assert_allclose(inside, 0.95, atol=0.004)
    squares = np.sum([each**2 for each in part.parts_m_s2.values()], axis=0)
    np.testing.assert_allclose(squares, part.sigma_m_s2**2, rtol=1e-9)


def test_the_first_part_is_what_would_go_if_n_r_were_known(found: RunPosterior) -> None:
    at, k = found.problem.coefficients + motion.INERTIA, found.problem.coefficients
    columns = motion.shapes_at(found.problem.forces, SPEED_M_S)[1][0]
    with_n_r = columns.T @ found.covariance[:k, at]
    part = read(found, SPEED_M_S)
    variance = np.einsum('km,kl,lm->m', columns, found.covariance[:k, :k], columns)
    due = with_n_r**2 / found.covariance[at, at] / variance
    np.testing.assert_allclose(part.parts_m_s2['n_r'], np.sqrt(due) * part.sigma_m_s2, rtol=1e-6)
