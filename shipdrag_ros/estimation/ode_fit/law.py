# SPDX-License-Identifier: Apache-2.0
"""r(v) as a sum of powers of the speed and of humps of wave making; compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64, Int64


class Law(NamedTuple):
    """
    What is not fitted.

    Attributes
    ----------
    powers : (k,)
        Of the speed, ascending.
    v_ref_m_s
        Speed that the powers are relative to.
    run_down_s
        Time constant of the shaft, the T of `coast`; 0: the thrust ended at once.
    n_r : (j,)
        Polynomial of n_r in v, lowest power first.
    humps
        How many B-splines multiply v^2 besides the powers; they add humps and
        hollows of wave making.
    first_hump, spacing
        Middle of the first, and distance of one from the next, over `v_ref_m_s`.
    """

    powers: Int64
    v_ref_m_s: float
    run_down_s: float
    n_r: Float64
    humps: int = 0
    first_hump: float = 0.0
    spacing: float = 1.0

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.powers) + self.humps


@compiled
def shapes(law: Law, s: float, value: Float64, slope: Float64) -> None:
    """
    Fill in what each coefficient is multiplied by at a relative speed.

    Parameters
    ----------
    s
        v / v_ref.
    value, slope : (k,)
        Of r, and of its derivative by s.
    """
    k = len(law.powers)
    # the powers by one chain of products; what is between the powers is skipped
    power = 1.0
    exponent = 0
    for j in range(k):
        while exponent < law.powers[j] - 1:
            power *= s
            exponent += 1
        slope[j] = law.powers[j] * power
        power *= s
        exponent += 1
        value[j] = power
    for j in range(law.humps):
        # cubic B-spline, of r / s^2
        d = (s - law.first_hump) / law.spacing - j
        side = 1.0 if d > 0.0 else -1.0
        d = abs(d)
        b, by_d = 0.0, 0.0
        if d < 1.0:
            b = 2.0 / 3.0 - d * d + 0.5 * d * d * d
            by_d = side * (1.5 * d * d - 2.0 * d)
        elif d < 2.0:
            b = (2.0 - d) ** 3 / 6.0
            by_d = -side * 0.5 * (2.0 - d) ** 2
        value[k + j] = s * s * b
        slope[k + j] = 2.0 * s * b + s * s * by_d / law.spacing


@compiled
def shape_table(law: Law, speed_m_s: Float64) -> tuple[Float64, Float64]:
    """
    Return the shapes of r and of dr/dv at (m,) speeds, each (m, k).
    """
    m, k = len(speed_m_s), len(law.powers) + law.humps
    value, slope = np.empty((m, k)), np.empty((m, k))
    for i in range(m):
        shapes(law, speed_m_s[i] / law.v_ref_m_s, value[i], slope[i])
    return value, slope / law.v_ref_m_s


@compiled
def sums_and_sd(shape: Float64, unknowns: Float64, covariance: Float64) -> tuple[Float64, Float64]:
    """
    Return sums of the coefficients, and their standard deviations.

    Parameters
    ----------
    shape : (m, k)
        What the coefficients are multiplied by.
    unknowns, covariance : (k + 8,), (k + 8, k + 8)
    """
    m, k = shape.shape
    value, sd = np.empty(m), np.empty(m)
    for i in range(m):
        total, variance = 0.0, 0.0
        for a in range(k):
            total += shape[i, a] * unknowns[a]
            half = 0.5 * covariance[a, a] * shape[i, a]
            for b in range(a):
                half += covariance[a, b] * shape[i, b]
            variance += 2.0 * shape[i, a] * half
        value[i] = total
        sd[i] = np.sqrt(max(variance, 0.0))
    return value, sd
