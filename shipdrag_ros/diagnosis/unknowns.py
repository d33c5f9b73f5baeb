# SPDX-License-Identifier: Apache-2.0
"""
What a hypothesis leaves open: unknowns with a prior, all of the same scale.

Every unknown is fitted as z, standard normal before the data, so that the
evidence of hypotheses can be compared whatever the units of their parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from scipy.special import expit, ndtr

from shipdrag_ros.simulation.effect import Prior, Shape

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
    """
    return unknown.start or _TRIAL_Z


def scaled(name: str, sd: float, *, mean: float = 0.0, tail: Tail = Tail.NORMAL) -> Unknown:
    """
    Return an unknown that is mean + sd z.
    """
    return Unknown(name, tail, lambda z: mean + sd * z, lambda z: sd)


def of_prior(name: str, prior: Prior, *, start: float = 0.0, sign: float = 1.0) -> Unknown:
    """
    Return an unknown of the prior that an effect states.

    Parameters
    ----------
    sign
        Where the prior leaves it open.
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
