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

from scipy.special import ndtr

from shipdrag_ros.simulation.effect import Prior, Shape

_STUDENT = 4.0  # degrees of freedom of the priors of the baseline


class Tail(Enum):
    """How the prior of z falls off."""

    NORMAL = auto()
    HALF = auto()  # twice the normal one, of z >= 0
    STUDENT = auto()  # t, 4 degrees of freedom: a baseline may be worse than stated
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
        if self.tail is Tail.STUDENT:
            return (_STUDENT + 1.0) * math.log1p(z * z / _STUDENT)
        return z * z

    def weight(self, z: float) -> float:
        """
        Return the precision that gives the slope of the penalty at z.
        """
        if self.tail is Tail.FLAT:
            return 0.0
        if self.tail is Tail.STUDENT:
            return (_STUDENT + 1.0) / (_STUDENT + z * z)
        return 1.0


def scaled(name: str, sd: float, *, mean: float = 0.0, tail: Tail = Tail.NORMAL) -> Unknown:
    """
    Return an unknown that is mean + sd z.
    """
    return Unknown(name, tail, lambda z: mean + sd * z, lambda z: sd)


def of_prior(name: str, prior: Prior, *, start: float = 0.0) -> Unknown:
    """
    Return an unknown of the prior that an effect states.
    """
    a, b = prior.first, prior.second
    match prior.shape:
        case Shape.HALF_NORMAL:
            return Unknown(name, Tail.HALF, lambda z: b * z, lambda z: b, start)
        case Shape.LOG_NORMAL:
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
