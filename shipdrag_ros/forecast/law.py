# SPDX-License-Identifier: Apache-2.0
"""
The deceleration at speeds that a glide has not reached yet, with its covariance.

ln a(u) = ln a_0(u) + d(ln u). a_0 is that of the ship file, or of a hull of her length and volume,
with a share of a force that does not fall with the speed: craft that are no hull have more of it.
d is a Gaussian process: an unknown level, an unknown exponent and a smooth rest. It is given what
is known of r(v), and beyond that is the prior. Shares, widths of d and how much rougher a record
is than its estimate says are families, weighed by their evidence.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.forecast import priors
from shipdrag_ros.posterior.law import parts_n
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

_POINTS = 25  # of the curve, evenly in ln u
_ALIKE_RANGE = (0.03, 3.0)  # of ln u, over which errors of the estimate may be alike
_ROUNDING = 1e-4


class KnownCurve(NamedTuple):
    """
    r(v) as it is known, speeds ascending.

    `alike` (m,) is over how much of ln u its errors are alike, `level_sd` that of r as a whole,
    relative, beside `sigma_m_s2`.
    """

    speed_m_s: Float64
    resistance_m_s2: Float64
    sigma_m_s2: Float64
    alike: Float64
    level_sd: float = 0.0

    @classmethod
    def of(cls, estimate: Estimate) -> KnownCurve:
        """
        Return what an estimate knows of all that slows her in the run.

        Errors at two speeds are alike over sigma / sd of the slope.
        An error of n_r cancels: r / (1 + n_r) was measured, and is foretold.
        """
        curve = estimate.whole.between(*estimate.froude_valid)
        if len(curve) < _POINTS:
            curve = estimate.whole
        sd = curve.sigma_repeatable_m_s2
        alike = sd / np.maximum(curve.slope_sigma * curve.froude, 1e-12)
        return cls(curve.speed_m_s, curve.resistance_m_s2, sd, alike)


class Deceleration(NamedTuple):
    """
    ln of the deceleration without thrust at some speeds (m,), and its covariance (m, m).

    `roughness` is how many times larger the variance of gusts is than stated.
    """

    log_m_s2: Float64
    covariance: Float64
    roughness: float


def deceleration(known: KnownCurve, ship: Ship, speed_m_s: Float64) -> Deceleration:
    """
    Return the law that a known curve and the prior give.

    Parameters
    ----------
    known
    ship
        For n_r and the hull.
    speed_m_s : (m,)
        Above 0.

    Notes
    -----
    Regression by Gaussian processes (Rasmussen, Williams 2006, ch. 2).
    """
    top = float(known.speed_m_s[-1])
    x = np.linspace(np.log(known.speed_m_s[0]), np.log(top), _POINTS)
    measured, error = _measured(known, ship, np.exp(x))
    u = np.concatenate([np.exp(x), speed_m_s])
    hull = parts_n(ship, u).sum(axis=0) / (1.0 + ship.n_r(u))
    (share, of_form), (width, of_width), (rougher, of_rougher) = (
        np.array(each).T for each in (priors.FORMS, priors.WIDTHS, priors.ROUGHER)
    )
    base = measured[-1] + np.log(np.outer(hull / hull[_POINTS - 1], 1.0 - share) + share)
    off = measured[:, None] - base[:_POINTS]
    prior = _prior(np.log(u / top), width)
    # (width, roughness, ...): neither changes the mean of a form
    error = rougher[:, None, None] ** 2 * error + known.level_sd**2 + _ROUNDING * np.eye(_POINTS)
    of_curve = prior[:, None, :_POINTS, :_POINTS] + error
    to_curve = prior[:, None, :_POINTS, _POINTS:]
    gain = np.linalg.solve(of_curve, to_curve)
    fit = np.linalg.solve(of_curve, np.broadcast_to(off, (*of_curve.shape[:3], len(share))))
    log_root = np.log(np.diagonal(np.linalg.cholesky(of_curve), axis1=2, axis2=3)).sum(axis=2)
    log = np.log(of_width[:, None, None] * of_rougher[:, None] * of_form) - log_root[..., None]
    log -= 0.5 * (off * fit).sum(axis=2)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    means = base[_POINTS:] + np.swapaxes(gain, 2, 3) @ off
    mean = np.einsum('abf,abmf->m', weight, means)
    apart = (means - mean[:, None]) * np.sqrt(weight)[:, :, None]
    left = prior[:, None, _POINTS:, _POINTS:] - np.swapaxes(gain, 2, 3) @ to_curve
    covariance = np.tensordot(weight.sum(axis=2), left, 2)
    covariance += np.einsum('abmf,abnf->mn', apart, apart)
    return Deceleration(mean, covariance, float(weight.sum(axis=(0, 2)) @ rougher**2))


def _prior(x: Float64, width: Float64) -> Float64:
    """Return the covariance of d from the top on, of each width."""
    apart = x[:, None] - x
    shape = priors.EXPONENT.sd**2 * np.outer(x, x)
    shape += priors.SMOOTH.sd**2 * np.exp(-0.5 * (apart / priors.ALIKE.mean) ** 2)
    return np.asarray(priors.LEVEL.sd**2 + width[:, None, None] ** 2 * shape)


def _measured(known: KnownCurve, ship: Ship, u: Float64) -> tuple[Float64, Float64]:
    """Return ln a of the curve and the covariance of its error."""

    def at(values: Float64) -> Float64:
        return np.interp(u, known.speed_m_s, values)

    r = np.maximum(at(known.resistance_m_s2), 1e-3 * float(known.resistance_m_s2.max()))
    alike = np.clip(at(known.alike), *_ALIKE_RANGE)
    x, relative = np.log(u), at(known.sigma_m_s2) / r
    squares = alike[:, None] ** 2 + alike**2
    # Gibbs (1997): positive definite where the length changes
    correlation = np.sqrt(2.0 * np.outer(alike, alike) / squares) * np.exp(
        -((x[:, None] - x) ** 2) / squares
    )
    error = np.outer(relative, relative) * correlation
    return np.log(r / (1.0 + ship.n_r(u))), error
