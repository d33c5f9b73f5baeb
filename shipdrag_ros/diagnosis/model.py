# SPDX-License-Identifier: Apache-2.0
"""
What a search asks of a model: hypotheses, their priors, and rows linear in their unknowns.

Each effect is missing or not whatever the others are, so that a pair is as
probable as the odds of its two say, if it can be; three at once are not looked
for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any, Protocol

import numpy as np

from shipdrag_ros.parameter import Parameter
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effect import Effect

UNNAMED_ODDS = 0.015  # of something that is none of the library, in each place where it can be


class Part(Protocol):
    """A part of a hypothesis that leaves something open."""

    @property
    def unknowns(self) -> tuple[Parameter, ...]:
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

    def with_effect(
        self,
        name: str,
        term: Part,
        *,
        log_odds: float,
        ways: int = 1,
        model_errors: Sequence[Part] = (),
    ) -> Hypothesis:
        """
        Return the same with an effect, as its last term.

        Parameters
        ----------
        name
            Of the effect.
        term
            What it does.
        log_odds
            Of the effect.
        ways
            Number of ways, alike before the data, in which it may be there.
        model_errors
            How far it may depart from its formula.

        Returns
        -------
        Hypothesis
        """
        return replace(
            self,
            names=tuple(sorted((*self.names, name))),
            terms=(*self.terms, term),
            model_errors=(*self.model_errors, *model_errors),
            log_prior=self.log_prior + log_odds - math.log(ways),
            log_odds=self.log_odds + log_odds,
        )

    def effects_in(self, run: int | None) -> list[Effect]:
        """Return the effects that are missing in a run; None: in any."""
        return [
            term.effect
            for term in self.terms
            if getattr(term, 'effect', None) is not None
            and not term.stated
            and (run is None or term.acts_in(run))
        ]

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
    def unknowns(self) -> tuple[Parameter, ...]:
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
        return self.chi2 + sum(
            u.prior.penalty(z) for u, z in zip(self.hypothesis.unknowns, self.z)
        )

    @cached_property
    def normal_equations(self) -> tuple[Float64, Float64]:
        """Matrix (p, p) and negative gradient (p,) of half the cost."""
        weight = np.zeros(len(self.z))
        for i, (unknown, z) in enumerate(zip(self.hypothesis.unknowns, self.z)):
            weight[i] = unknown.prior.weight(z)
        matrix = np.diag(weight)
        negative_gradient = -weight * self.z
        for table in self.tables:
            matrix += np.einsum('ai,bi->ab', table[1:], table[1:])
            negative_gradient += table[1:] @ table[0]
        return matrix, negative_gradient


class Linearised(Protocol):
    """
    What a fit asks of a model.

    Attributes
    ----------
    iterations
        At most.
    converged
        Fall of -2 ln posterior from which a fit ends.
    hopeless
        -2 ln posterior behind the best, from where a fit that hardly comes nearer
        ends.
    """

    @property
    def iterations(self) -> int: ...

    @property
    def converged(self) -> float: ...

    @property
    def hopeless(self) -> float: ...

    def linearise(
        self,
        hypotheses: Sequence[Hypothesis],
        at: Sequence[Float64],
        near: Sequence[Linear | None] | None = None,
    ) -> list[Linear]:
        """
        Return the whitened rows of each hypothesis about some unknowns.

        Parameters
        ----------
        hypotheses
        at
            (p,) each.
        near
            The same about unknowns near by, whose derivatives may be used again.
        """


class Model(Linearised, Protocol):
    """
    What a record is held against; coast, sailing and the form fitted here are three.

    Attributes
    ----------
    effects
        That may be missing.
    inseparable
        Pairs of names, or larger sets, that no record of this kind separates.
    nothing
        The hypothesis that nothing is missing.
    channels
        In which something unnamed may be.
    free : (k,)
        Where parameters without a prior, which stand behind the unknowns of
        every hypothesis, begin.
    """

    @property
    def effects(self) -> tuple[Effect, ...]: ...

    @property
    def inseparable(self) -> tuple[frozenset[str], ...]: ...

    @property
    def nothing(self) -> Hypothesis: ...

    @property
    def channels(self) -> tuple[str, ...]: ...

    @property
    def free(self) -> Float64: ...

    def with_effect(self, base: Hypothesis, effect: Effect) -> list[Hypothesis]:
        """
        Return a hypothesis with one effect more, in each way that it may be there.

        The effect is its last term; nothing where the two are not looked for together.
        """

    def with_discrepancy(self, base: Hypothesis, channel: str) -> Hypothesis:
        """Return a hypothesis with something smooth and unnamed besides."""

    def responses(self, base: Linear, hypotheses: Sequence[Hypothesis]) -> Float64:
        """
        Return the linear response to one added effect, (hypotheses, rows), whitened.

        Parameters
        ----------
        base
            What the hypotheses add to.
        hypotheses
            Their last term is the effect; its response is that of the size `trial_z`.
        """


def start(model: Model, hypothesis: Hypothesis, near: Linear | None = None) -> Float64:
    """
    Return unknowns that a fit begins from.

    Parameters
    ----------
    model
    hypothesis
    near
        A fit: parts that it shares with the hypothesis begin from its unknowns.

    Returns
    -------
    (p,)
        As `Linear.z`.
    """
    z = np.array([unknown.start for unknown in hypothesis.unknowns])
    if near is None:
        return np.concatenate([z, model.free])
    known = {id(part): place for part, place in near.hypothesis.parts}
    for part, place in hypothesis.parts:
        if id(part) in known:
            size = len(part.unknowns)
            z[place : place + size] = near.z[known[id(part)] : known[id(part)] + size]
    return np.concatenate([z, near.z[len(near.hypothesis.unknowns) :]])


def nothing_missing(effects: Sequence[Effect], *, places: int) -> float:
    """
    Return the prior probability that nothing is missing.

    Parameters
    ----------
    effects
        That may be missing.
    places
        Number of channels in which something unnamed may be besides.

    Returns
    -------
    float
        Of all that may be, the probabilities add up to 1.
    """
    ones = sum(effect.odds for effect in effects)
    pairs = sum(a.odds * b.odds for a, b in combinations(effects, 2) if a.goes_with(b))
    return 1.0 / (1.0 + ones + pairs + places * UNNAMED_ODDS)
