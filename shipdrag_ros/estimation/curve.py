# SPDX-License-Identifier: Apache-2.0
"""
From a fitted motion to r(v), and to the range in which it may be used.

r and v are evaluated at the same times and never interpolated. Where the speed
does not fall r(v) has two values: only the branch on which it falls is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.motion import Motion, sigma
from shipdrag_ros.estimation.result import FroudeMax, ResistanceCurve
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

SIGNIFICANT = 2.0  # fall or rise of dr/dFr, in its standard deviations
_MIN_POINTS = 3  # fewer are no curve


def specific_resistance(motion: Motion, ship: Ship) -> tuple[Float64, Float64, Float64]:
    """
    Return r, its sigma, and its sigma without the error of n_r.

    Notes
    -----
    S1 (12, 13); the error of n_r is independent of that of the motion.
    """
    inertia = 1.0 + ship.n_r(motion.speed)
    repeatable = inertia * sigma(motion.acceleration_error)
    of_n_r = np.abs(motion.acceleration) * ship.added_mass.sd
    # + 0.0: no negative zero
    return (
        0.0 - inertia * motion.acceleration,
        np.sqrt(repeatable**2 + of_n_r**2),
        repeatable,
    )


def resistance_curve(motion: Motion, ship: Ship, *, froude_min: float) -> ResistanceCurve:
    """
    Return r(v) on the monotone branch of the speed.

    The branch is the longest fall of the speed, in m/s, through consecutive
    times with dv/dt < 0 and Fr >= froude_min.

    Parameters
    ----------
    motion
        At times that ascend, dense enough to show the shape.

    Raises
    ------
    EstimationError
        If there is no such branch.
    """
    branch = motion[_falling(motion, ship, froude_min)][::-1]
    if len(branch.speed) < _MIN_POINTS:
        low, high = float(motion.speed.min()), float(motion.speed.max())
        raise EstimationError(
            f'the fitted speed, {low:.4g}..{high:.4g} m/s (Fr {ship.froude(low):.3g}..'
            f'{ship.froude(high):.3g}), does not fall steadily above froude_min {froude_min:g}: '
            'give a window that lies in a coastdown, or a smaller froude_min'
        )
    resistance, total, repeatable = specific_resistance(branch, ship)
    slope, slope_error = _slope(branch, ship)
    return ResistanceCurve(
        np.ascontiguousarray(branch.speed),
        resistance,
        total,
        repeatable,
        ship.froude(branch.speed),
        slope,
        sigma(slope_error),
    )


def _falling(motion: Motion, ship: Ship, froude_min: float) -> slice:
    """Find the times of the longest fall."""
    speed = motion.speed
    usable = (motion.acceleration < 0.0) & (ship.froude(speed) >= froude_min)
    # time i belongs with i + 1: both usable, the speed strictly lower
    linked = usable[:-1] & usable[1:] & (speed[1:] < speed[:-1])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], linked, [False]])))
    starts, ends = edges[::2], edges[1::2]
    if len(starts) == 0:
        return slice(0, 0)
    best = int(np.argmax(speed[starts] - speed[ends]))
    return slice(int(starts[best]), int(ends[best]) + 1)


def _slope(motion: Motion, ship: Ship) -> tuple[Float64, Float64]:
    """
    Return dr/dFr and its error, of the motion alone.

    With a = dv/dt: dr/dv = -((1 + n_r) da/dt / a + dn_r/dv a).
    """
    per_froude = float(ship.speed(1.0))
    # exact for the quadratic n_r up to rounding
    step = 1e-3 * per_froude
    n_r_slope = (ship.n_r(motion.speed + step) - ship.n_r(motion.speed - step)) / (2.0 * step)
    inertia = 1.0 + ship.n_r(motion.speed)
    a, jerk = motion.acceleration, motion.jerk
    slope = -per_froude * (inertia * jerk / a + n_r_slope * a)
    by_a = n_r_slope - inertia * jerk / a**2
    error = per_froude * (
        (inertia / a)[:, None] * motion.jerk_error + by_a[:, None] * motion.acceleration_error
    )
    return slope, error


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
    slope, slope_sigma = curve.slope, curve.slope_sigma
    rises = slope[1:-1] > slope[:-2]
    falls = slope[1:-1] >= slope[2:]
    for top in np.flatnonzero(rises & falls) + 1:
        doubt = np.maximum(slope_sigma[top], slope_sigma[top + 1 :])
        fall = (slope[top] - slope[top + 1 :]) / doubt
        if np.any(fall < -SIGNIFICANT):
            continue
        higher = np.flatnonzero(fall < 0.0)
        if np.any(fall[: higher[0] if len(higher) else None] > SIGNIFICANT):
            return float(curve.froude[top]), FroudeMax.INFLECTION
    return float(curve.froude[-1]), FroudeMax.BRANCH_TOP


@dataclass(frozen=True)
class ValidRange:
    """
    Where a curve may be used, and what S1 would say of it.

    Attributes
    ----------
    froude
        [Fr_min, Fr_max].
    by
        Which rule gave Fr_max.
    argmax
        argmax dr/dFr over the whole branch.
    w
        max sigma_r / max r over the range, of the repeatable sigma.
    """

    froude: tuple[float, float]
    by: FroudeMax
    argmax: float
    w: float

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
            froude=(float(curve.froude[0]), top),
            by=by,
            argmax=float(curve.froude[np.argmax(curve.slope)]),
            w=float(
                curve.sigma_repeatable_m_s2[inside].max() / curve.resistance_m_s2[inside].max()
            ),
        )
