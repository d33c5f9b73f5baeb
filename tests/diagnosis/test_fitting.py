# SPDX-License-Identifier: Apache-2.0
"""Evidence by Laplace's method against integrals done by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from scipy.integrate import quad

from shipdrag_ros.diagnosis.coast_terms import ForceTerm
from shipdrag_ros.diagnosis.fitting import fit
from shipdrag_ros.diagnosis.model import Hypothesis, Linear
from shipdrag_ros.parameter import Parameter, Prior, Shape, flat, free, half_normal, normal
from shipdrag_ros.samples import Float64


@dataclass(frozen=True)
class OneSize:
    """A part with one unknown."""

    unknowns: tuple[Parameter, ...]
    one_size: ClassVar[Sequence[int]] = ()


@dataclass(frozen=True)
class Straight:
    """Rows that depend on a size evenly: what a problem is made of, without a ship."""

    value: Float64
    slope: Float64
    iterations: ClassVar[int] = 16
    converged: ClassVar[float] = 0.02
    hopeless: ClassVar[float] = 80.0

    def linearise(
        self, hypotheses: list[Hypothesis], at: list[Float64], near: object = None
    ) -> list[Linear]:
        """Return residual and slope."""
        found = []
        for hypothesis, z in zip(hypotheses, at, strict=True):
            residual = self.value - self.slope * z[0]
            found.append(Linear(hypothesis, z, (np.array([residual, self.slope]),), (residual,)))
        return found


@pytest.mark.parametrize('prior', [normal(1.0), half_normal(1.0)])
@pytest.mark.parametrize('size', [-3.0, -0.5, 0.0, 0.4, 3.0])
def test_the_evidence_is_the_integral_over_the_prior(prior: Prior, size: float) -> None:
    rng = np.random.default_rng(3)
    slope = rng.standard_normal(20)
    value = size * slope + rng.standard_normal(20)
    unknown = free('size', prior)
    hypothesis = Hypothesis(('one',), (OneSize((unknown,)),), ())  # type: ignore[arg-type]
    found = fit(Straight(value, slope), [hypothesis], [np.array([0.2])])[0]  # type: ignore[arg-type]

    def density(z: float) -> float:
        left = value - slope * z
        return float(np.exp(-0.5 * (left @ left) - 0.5 * z * z)) / np.sqrt(2.0 * np.pi)

    low = 0.0 if prior.shape is Shape.HALF_NORMAL else -9.0
    whole = quad(density, low, 9.0, epsabs=0.0, points=[0.0, size])[0]
    expected = np.log(whole * (2.0 if prior.shape is Shape.HALF_NORMAL else 1.0))
    assert found.log_evidence == pytest.approx(expected, abs=1e-6)
    if prior.shape is Shape.HALF_NORMAL:
        assert found.best.z[0] >= 0.0


def test_the_covariance_is_that_of_least_squares() -> None:
    rng = np.random.default_rng(4)
    slope = rng.standard_normal(50)
    problem = Straight(slope + rng.standard_normal(50), slope)
    straight = Hypothesis((), (OneSize((free('a', flat(1.0)),)),), ())  # type: ignore[arg-type]
    found = fit(problem, [straight], [np.array([5.0])])[0]  # type: ignore[arg-type]
    assert found.best.z[0] == pytest.approx(slope @ problem.value / (slope @ slope), rel=1e-9)
    assert found.covariance[0, 0] == pytest.approx(1.0 / (slope @ slope), rel=1e-9)


def test_what_cannot_be_simulated_has_no_evidence() -> None:
    problem = Straight(np.full(5, np.nan), np.ones(5))
    one = Hypothesis(('one',), (OneSize((free('a', normal(1.0)),)),), ())  # type: ignore[arg-type]
    assert fit(problem, [one], [np.zeros(1)])[0].log_evidence == -np.inf  # type: ignore[arg-type]


class OneForce(ForceTerm):
    """Something unnamed of one unknown."""

    unknowns = (free('force', normal(1.0)),)  # type: ignore[assignment]
    one_size = (0,)


def test_what_has_no_name_may_be_large_or_small() -> None:
    rng = np.random.default_rng(4)
    slope = 3.0 * rng.standard_normal(20)
    value = 0.2 * slope + rng.standard_normal(20)
    force = OneForce(None, 1.0)  # type: ignore[arg-type]
    hypothesis = Hypothesis((), (force,), (), discrepancy='force')
    found = fit(Straight(value, slope), [hypothesis], [np.array([0.0])])[0]  # type: ignore[arg-type]

    def density(z: float) -> float:
        left = value - slope * z
        prior = 0.5 * np.exp(-0.5 * z * z) + 0.5 * np.exp(-0.5 * (z / 0.25) ** 2) / 0.25
        return float(np.exp(-0.5 * (left @ left)) * prior) / np.sqrt(2.0 * np.pi)

    whole = quad(density, -9.0, 9.0, epsabs=0.0, points=[0.0, 0.2])[0]
    assert found.log_evidence == pytest.approx(np.log(whole), abs=1e-6)
