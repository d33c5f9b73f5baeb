# SPDX-License-Identifier: Apache-2.0
"""
What a hypothesis leaves open: parameters with a prior, and the parts that hold them.

An effect, and B-splines for what has no name, are parts of all models.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline

from shipdrag_ros.parameter import Parameter, Prior, Shape, half_normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action
from shipdrag_ros.simulation.effect import Effect, Frame, Scope

_OWN_START = 0.3  # z of a size that a run has of its own
_TRIAL_Z = 0.5  # of a size that may have either sign, or be 0


def trial_z(unknown: Parameter) -> float:
    """
    Return z of a likely size, for one that is tried before it is fitted.

    Parameters
    ----------
    unknown
        The size of an effect.

    Returns
    -------
    float
        Where its fit begins, or 0.5 for one that begins from 0.
    """
    return unknown.start or _TRIAL_Z


@dataclass(frozen=True)
class EffectTerm:
    """
    An effect of the library.

    Attributes
    ----------
    effect
    ship
        That its sizes are measured by.
    starts
        z that a fit begins from, one a parameter.
    fixed
        Parameters that are a choice, by name.
    signs
        Of parameters that have either, by name.
    only_run
        Where an effect of a single run is looked for; None: in all runs.
    given
        Priors of its parameters [SI], in place of those of the effect.
    stated
        Whether it is part of the model as its file states it, and no hypothesis.
    sizes
        Number of runs, of which each has a size of its own; 1: one for all.
    kept
        Whether the sizes that are given are those of an earlier diagnosis.
    """

    effect: Effect
    ship: Ship
    starts: tuple[float, ...] = ()
    fixed: tuple[tuple[str, float], ...] = ()
    signs: tuple[tuple[str, float], ...] = ()
    only_run: int | None = None
    given: tuple[Prior, ...] = ()
    stated: bool = False
    sizes: int = 1
    kept: bool = False

    @cached_property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Its parameters, without those that are fixed."""
        parameters = self.effect.parameters_of(self.ship)
        if self.given:
            return tuple(
                replace(one, prior=prior)
                for one, prior in zip(parameters, self.given, strict=True)
            )
        free = [one for one in parameters if one.name not in dict(self.fixed)]
        starts = self.starts or (0.0,) * len(free)
        signs = dict(self.signs)
        found = tuple(
            replace(one, prior=one.prior.of_sign(signs.get(one.name, 1.0)), start=start)
            for one, start in zip(free, starts, strict=True)
        )
        if self.sizes == 1:
            return found
        size = replace(found[0], prior=_from_zero(found[0].prior), start=_OWN_START)
        return (*(size for _ in range(self.sizes)), *found[1:])

    @property
    def of_single_run(self) -> bool:
        """Whether nothing of it is to be expected in another run."""
        return self.effect.scope is Scope.RUN and not self.stated

    @property
    def one_size(self) -> Sequence[int]:
        """Places of components, which may have either sign: where one is small, so are all."""
        free = [q for q in self.effect.parameters if q.name not in dict(self.fixed)]
        found = [i for i, q in enumerate(free) if q.prior.shape is Shape.NORMAL]
        single = self.stated or self.kept or self.sizes > 1 or len(found) < 2
        return () if single else found

    def acts_in(self, run: int) -> bool:
        """Say whether it does anything in a run."""
        return self.only_run is None or self.only_run == run

    def action(self, frame: Frame, run: int, values: Sequence[float]) -> Action:
        """Return what the effect does in a run."""
        if self.sizes > 1:
            values = [values[run], *values[self.sizes :]]
        return self.effect.action(frame, *self.all_values(values))

    def all_values(self, values: Sequence[float]) -> list[float]:
        """
        Return the values of all parameters, the fixed ones too.
        """
        fixed, free = dict(self.fixed), iter(values)
        return [fixed[q.name] if q.name in fixed else next(free) for q in self.effect.parameters]


def _from_zero(prior: Prior) -> Prior:
    """Return the prior of a size that is not there in every run."""
    if prior.shape is Shape.LOG_NORMAL:
        return half_normal(prior.first * math.exp(prior.second))
    return prior


def scope_runs(effect: Effect, runs: int) -> tuple[int | None, ...]:
    """
    Return where an effect may be: in all runs (None), or in any single one.

    Parameters
    ----------
    effect
        Of the library.
    runs
        Number of runs.

    Returns
    -------
    tuple of int or None
        Places of single runs, for an effect of a single run.
    """
    if effect.scope is Scope.RUN and runs > 1:
        return (None, *range(runs))
    return (None,)


def cubic_bsplines(x: Float64, count: int) -> Float64:
    """
    Return cubic B-splines on even knots, which add up to 1.

    Parameters
    ----------
    x : (n,)
        Knots are over 0 .. 1; beyond them the splines keep their value at the end.
    count
        Number of splines, 4 or more.

    Returns
    -------
    (count, n)
    """
    degree = 3
    inner = np.linspace(0.0, 1.0, count - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    flat = np.clip(np.asarray(x, np.float64), 0.0, 1.0).reshape(-1)
    table = BSpline.design_matrix(flat, knots, degree).toarray()
    return np.ascontiguousarray(table.T).reshape(count, *np.shape(x))
