# SPDX-License-Identifier: Apache-2.0
"""The range in which a curve r(v) may be used, and what it says at its end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.result import FroudeMax, ResistanceCurve
from shipdrag_ros.samples import Float64

SIGNIFICANT = 2.0  # fall or rise of dr/dFr, in its standard deviations


def froude_max(curve: ResistanceCurve) -> tuple[float, FroudeMax]:
    """
    Return the upper end of the valid range, and what gave it.

    Notes
    -----
    S1 takes argmax dr/dFr: above that inflection the curve still carries the
    transient of the start. Over everything that is the transient itself, so:
    the first maximum from which dr/dFr falls, before it rises above it again,
    by more than `SIGNIFICANT` of its standard deviations (of the larger one of
    the two places). Polynomials also wiggle at low speed by more than their
    standard deviation says; a maximum that is exceeded by as much further up
    is such a wiggle. Many hulls have none: then the top of the branch.
    """
    top = _inflection(curve.slope, curve.slope_sigma)
    if top < 0:
        return float(curve.froude[-1]), FroudeMax.BRANCH_TOP
    return float(curve.froude[top]), FroudeMax.INFLECTION


@compiled('i8(f8[:], f8[:])')
def _inflection(slope: Float64, sigma: Float64) -> int:
    """Find the first significant maximum; -1: there is none."""
    for top in range(1, len(slope) - 1):
        if not slope[top - 1] < slope[top] >= slope[top + 1]:
            continue
        falls = exceeded = False
        for i in range(top + 1, len(slope)):
            fall, doubt = slope[top] - slope[i], max(sigma[top], sigma[i])
            if fall < -SIGNIFICANT * doubt:
                falls = False
                break
            exceeded = exceeded or fall < 0.0
            falls = falls or (not exceeded and fall > SIGNIFICANT * doubt)
        if falls:
            return top
    return -1


class ValidRange(NamedTuple):
    """
    Where a curve may be used, and what S1 would say of it, as `Estimate` has it.

    Attributes
    ----------
    froude_valid
        [Fr_min, Fr_max].
    froude_max_by
        Which rule gave Fr_max.
    froude_max_argmax
        argmax dr/dFr over the whole branch.
    max_relative_sigma
        max sigma_r / max r over the range, of the repeatable sigma.
    """

    froude_valid: tuple[float, float]
    froude_max_by: FroudeMax
    froude_max_argmax: float
    max_relative_sigma: float

    @classmethod
    def of_branch(cls, curve: ResistanceCurve) -> ValidRange:
        """
        Return the whole branch.
        """
        return cls._up_to(curve, float(curve.froude[-1]), FroudeMax.BRANCH_TOP)

    @classmethod
    def of_polynomial(cls, curve: ResistanceCurve) -> ValidRange:
        """
        Return the part below the transient of the start, `froude_max`.
        """
        return cls._up_to(curve, *froude_max(curve))

    @classmethod
    def _up_to(cls, curve: ResistanceCurve, top: float, by: FroudeMax) -> ValidRange:
        inside = slice(0, int(np.searchsorted(curve.froude, top, side='right')))
        return cls(
            (float(curve.froude[0]), top),
            by,
            float(curve.froude[np.argmax(curve.slope)]),
            float(curve.sigma_repeatable_m_s2[inside].max() / curve.resistance_m_s2[inside].max()),
        )


class AtEnd(NamedTuple):
    """
    Speed through water [m/s] and r [m/s^2] at the end of a window, with their sigmas, and the
    thrust that is left [m/s^2].
    """

    last_speed_m_s: float
    last_speed_sigma_m_s: float
    last_resistance_m_s2: float
    last_sigma_m_s2: float
    last_thrust_m_s2: float = 0.0
