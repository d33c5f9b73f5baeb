# SPDX-License-Identifier: Apache-2.0
"""
What a search asks of a model: its hypotheses, their priors, and linear rows.

Each effect is missing or not whatever the others are, so that a pair is as
probable as the odds of its two say, if it can be; three at once are not looked
for.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Protocol

import numpy as np

from shipdrag_ros.diagnosis.linear import Hypothesis, Linear
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effect import Effect

UNNAMED_ODDS = 0.015  # of something that is none of the library, in each place where it can be


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
        Pairs of names, or larger sets, that no record of this kind tells apart.
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
    """
    ones = sum(effect.odds for effect in effects)
    pairs = sum(a.odds * b.odds for a, b in combinations(effects, 2) if a.goes_with(b))
    return 1.0 / (1.0 + ones + pairs + places * UNNAMED_ODDS)
