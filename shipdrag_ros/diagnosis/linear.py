# SPDX-License-Identifier: Apache-2.0
"""
A hypothesis of any model, and its whitened rows linear about some unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from shipdrag_ros.diagnosis.terms import Unknown
from shipdrag_ros.samples import Float64


class Part(Protocol):
    """A part of a hypothesis that leaves something open."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Its parameters."""

    @property
    def one_size(self) -> Sequence[int]:
        """Places among its unknowns of those that are all usual or all small."""


@dataclass(frozen=True)
class Hypothesis:
    """
    What may be missing.

    Attributes
    ----------
    names
        Of the effects, sorted; none: nothing is missing.
    terms, measurement_terms
        All that is fitted, of the kinds that its model knows: what acts, and
        what adds to the measurements.
    model_errors
        How far effects among the terms may depart from their formulas.
    log_prior
        Logarithm of the prior probability.
    log_odds
        Prior log odds of the names over nothing, in whatever way they are there.
    discrepancy
        Channel in which something smooth without a name is fitted besides; ''
        without.
    """

    names: tuple[str, ...]
    terms: tuple[Any, ...]
    measurement_terms: tuple[Any, ...] = ()
    model_errors: tuple[Any, ...] = ()
    log_prior: float = 0.0
    log_odds: float = 0.0
    discrepancy: str = ''

    @cached_property
    def parts(self) -> tuple[tuple[Any, int], ...]:
        """Each `Part`, with the place of its first unknown."""
        found: list[tuple[Part, int]] = []
        place = 0
        for part in (*self.terms, *self.measurement_terms, *self.model_errors):
            found.append((part, place))
            place += len(part.unknowns)
        return tuple(found)

    @cached_property
    def of_one_size(self) -> list[list[int]]:
        """
        Places of unknowns that are all usual or all small.

        Those of something smooth, and the components of a current or a wind: where
        one is small, so are the others.
        """
        return [[place + k for k in part.one_size] for part, place in self.parts if part.one_size]

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """In the order of the parts; parameters without a prior are behind them."""
        return tuple(unknown for part, _ in self.parts for unknown in part.unknowns)


@dataclass(frozen=True)
class Linear:
    """
    Whitened rows of a hypothesis, linear about some unknowns.

    Attributes
    ----------
    hypothesis
    z : (p,)
        Of its unknowns, then the parameters without a prior.
    tables
        (1 + p, rows) of each run: whitened residual, then whitened derivatives of
        the prediction by z.
    residuals
        (rows,) of each run, not whitened.
    """

    hypothesis: Hypothesis
    z: Float64
    tables: tuple[Float64, ...]
    residuals: tuple[Float64, ...]

    @cached_property
    def chi2(self) -> float:
        """Sum of squared whitened residuals; infinite where it cannot be simulated."""
        if not all(np.isfinite(table).all() for table in self.tables):
            return math.inf
        return sum(float(table[0] @ table[0]) for table in self.tables)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return sum(table.shape[1] for table in self.tables)

    @cached_property
    def cost(self) -> float:
        """-2 ln of the posterior, less a constant."""
        return self.chi2 + sum(u.penalty(z) for u, z in zip(self.hypothesis.unknowns, self.z))

    @cached_property
    def normal(self) -> tuple[Float64, Float64]:
        """Half the curvature of the cost, and half its fall by each unknown."""
        weight = np.zeros(len(self.z))
        for i, (unknown, z) in enumerate(zip(self.hypothesis.unknowns, self.z)):
            weight[i] = unknown.weight(z)
        matrix = np.diag(weight)
        fall = -weight * self.z
        for table in self.tables:
            matrix += np.einsum('ai,bi->ab', table[1:], table[1:])
            fall += table[1:] @ table[0]
        return matrix, fall
