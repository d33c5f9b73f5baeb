# SPDX-License-Identifier: Apache-2.0
"""
What a hypothesis leaves open: unknowns with a prior, and the parts that hold them.

Every unknown is fitted as z, standard normal before the data, so that the
evidence of hypotheses can be compared whatever the units of their parameters.
An effect, and B-splines for what has no name, are parts of all models.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline
from scipy.special import expit, ndtr

from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action
from shipdrag_ros.simulation.effect import Effect, Frame, Prior, Scope, Shape

_TRIAL_Z = 0.5  # of a size that may have either sign, or be 0
_WORSE, _HOW_OFTEN = 3.0, 0.1  # times worse than stated that a baseline is, in so many cases


class Tail(Enum):
    """How the prior of z falls off."""

    NORMAL = auto()
    HALF = auto()  # twice the normal one, of z >= 0
    WIDE = auto()  # a baseline may be three times worse than stated, but hardly more
    FLAT = auto()  # the data alone decide


@dataclass(frozen=True)
class Unknown:
    """
    One number to be fitted.

    Attributes
    ----------
    name
    tail
    value
        From z to the number in its unit.
    slope
        Its derivative.
    start
        z that a fit begins from.
    """

    name: str
    tail: Tail
    value: Callable[[float], float]
    slope: Callable[[float], float]
    start: float = 0.0

    def penalty(self, z: float) -> float:
        """
        Return -2 ln of the prior, less a constant.
        """
        if self.tail is Tail.FLAT:
            return 0.0
        if self.tail is Tail.WIDE:
            return z * z - 2.0 * float(np.logaddexp(0.0, _odds(z)))
        return z * z

    def weight(self, z: float) -> float:
        """
        Return the precision that gives the slope of the penalty at z.
        """
        if self.tail is Tail.FLAT:
            return 0.0
        if self.tail is Tail.WIDE:
            return 1.0 - float(expit(_odds(z))) * (1.0 - 1.0 / _WORSE**2)
        return 1.0


def _odds(z: float) -> float:
    """Return the logarithm of the odds that a baseline that is z off is worse than stated."""
    before = math.log(_HOW_OFTEN / (_WORSE * (1.0 - _HOW_OFTEN)))
    return before + 0.5 * z * z * (1.0 - 1.0 / _WORSE**2)


def trial_z(unknown: Unknown) -> float:
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


def scaled(name: str, sd: float, *, mean: float = 0.0, tail: Tail = Tail.NORMAL) -> Unknown:
    """
    Return an unknown that is mean + sd z.

    Parameters
    ----------
    name
        Of the unknown.
    sd
        Prior standard deviation, in its unit.
    mean
        Prior mean.
    tail
        Of the prior.

    Returns
    -------
    Unknown
        In its unit.
    """
    return Unknown(name, tail, lambda z: mean + sd * z, lambda z: sd)


def of_prior(name: str, prior: Prior, *, start: float = 0.0, sign: float = 1.0) -> Unknown:
    """
    Return an unknown of the prior that an effect states.

    Parameters
    ----------
    name
        Of the parameter.
    prior
        In SI.
    start
        z that a fit begins from.
    sign
        Where the prior leaves it open.

    Returns
    -------
    Unknown
        Whose z is standard normal under the prior, or the positive half of it.
    """
    a, b = sign * prior.first, prior.second
    match prior.shape:
        case Shape.HALF_NORMAL:
            return Unknown(name, Tail.HALF, lambda z: b * z, lambda z: b, start)
        case Shape.LOG_NORMAL | Shape.EITHER_SIGN:
            return Unknown(
                name,
                Tail.NORMAL,
                lambda z: a * math.exp(b * z),
                lambda z: a * b * math.exp(b * z),
                start,
            )
        case Shape.UNIFORM:
            return Unknown(
                name,
                Tail.NORMAL,
                lambda z: a + (b - a) * float(ndtr(z)),
                lambda z: (b - a) * math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi),
                start,
            )
        case _:
            return Unknown(name, Tail.NORMAL, lambda z: a + b * z, lambda z: b, start)


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
    gaussian
        Mean and sd of each parameter [SI], in place of the priors of the effect.
    stated
        Whether it is part of the model as its file states it, and no hypothesis.
    """

    effect: Effect
    ship: Ship
    starts: tuple[float, ...] = ()
    fixed: tuple[tuple[str, float], ...] = ()
    signs: tuple[tuple[str, float], ...] = ()
    only_run: int | None = None
    gaussian: tuple[tuple[float, float], ...] = ()
    stated: bool = False

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Its parameters, without those that are fixed."""
        quantities = [quantity.of(self.ship) for quantity in self.effect.parameters]
        if self.gaussian:
            return tuple(
                scaled(quantity.name, sd, mean=mean)
                for quantity, (mean, sd) in zip(quantities, self.gaussian, strict=True)
            )
        free = [quantity for quantity in quantities if quantity.name not in dict(self.fixed)]
        starts = self.starts or (0.0,) * len(free)
        signs = dict(self.signs)
        return tuple(
            of_prior(
                quantity.name, quantity.prior, start=start, sign=signs.get(quantity.name, 1.0)
            )
            for quantity, start in zip(free, starts, strict=True)
        )

    @property
    def of_single_run(self) -> bool:
        """Whether nothing of it is to be expected in another run."""
        return self.effect.scope is Scope.RUN and not self.stated

    @property
    def one_size(self) -> Sequence[int]:
        """Places of components, which may have either sign: where one is small, so are all."""
        free = [q for q in self.effect.parameters if q.name not in dict(self.fixed)]
        found = [i for i, q in enumerate(free) if q.prior.shape is Shape.NORMAL]
        return () if self.stated or len(found) < 2 else found

    def acts_in(self, run: int) -> bool:
        """Tell whether it does anything in a run."""
        return self.only_run is None or self.only_run == run

    def action(self, frame: Frame, run: int, values: Sequence[float]) -> Action:
        """Return what the effect does in a run."""
        return self.effect.action(frame, *self.all_values(values))

    def all_values(self, values: Sequence[float]) -> list[float]:
        """
        Return the values of all parameters, the fixed ones too.
        """
        fixed, free = dict(self.fixed), iter(values)
        return [fixed[q.name] if q.name in fixed else next(free) for q in self.effect.parameters]


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
