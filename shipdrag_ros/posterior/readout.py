# SPDX-License-Identifier: Apache-2.0
"""What is read from the one posterior: r(v), its band and the parts of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.laplace import RunPosterior
from shipdrag_ros.samples import Float64

PARTS = {
    'log': (motion.SCALE, motion.OFFSET, motion.LAG),
    'n_r': (motion.INERTIA,),
}
"""Unknowns that a part of sigma is due to."""


@dataclass(frozen=True)
class ReadOut:
    """
    r at some speeds.

    Attributes
    ----------
    speed_m_s, resistance_m_s2, sigma_m_s2 : (m,)
    repeatable_m_s2 : (m,)
        sigma without what n_r adds, which repeats from run to run.
    slope_1_s, slope_sigma_1_s : (m,)
        dr/dv.
    parts_m_s2
        What log and n_r add to sigma, by name (m,).
    """

    speed_m_s: Float64
    resistance_m_s2: Float64
    sigma_m_s2: Float64
    repeatable_m_s2: Float64
    slope_1_s: Float64
    slope_sigma_1_s: Float64
    parts_m_s2: dict[str, Float64]


def read(found: RunPosterior, speed_m_s: Float64) -> ReadOut:
    """
    Read r(v) and its band.

    Parameters
    ----------
    found
    speed_m_s : (m,)
        Through water.
    """
    problem, k = found.problem, found.problem.coefficients
    theta = found.mean[:k]
    known, (columns, slopes) = motion.shapes_at(problem.forces, speed_m_s)
    covariance = found.covariance
    cross = columns.T @ covariance[:k]  # of r with every unknown
    variance = np.einsum('km,mk->m', columns, cross[:, :k])
    parts = {
        name: np.sqrt(_due(cross, covariance, [k + one for one in which]))
        for name, which in PARTS.items()
    }
    own = np.maximum(variance - parts['n_r'] ** 2, 0.0)
    of_slope = np.einsum('km,kl,lm->m', slopes, covariance[:k, :k], slopes)
    return ReadOut(
        speed_m_s,
        known[0] + theta @ columns,
        np.sqrt(variance),
        np.sqrt(own),
        known[1] + theta @ slopes,
        np.sqrt(of_slope),
        parts,
    )


def _due(cross: Float64, covariance: Float64, which: list[int]) -> Float64:
    """Return the variance (m,) that would go if some unknowns were known."""
    block = covariance[np.ix_(which, which)]
    part = cross[:, which]
    result: Float64 = np.maximum(
        np.einsum('mi,im->m', part, np.linalg.pinv(block, hermitian=True) @ part.T), 0.0
    )
    return result
