# SPDX-License-Identifier: Apache-2.0
"""A check of an r(v) that shares nothing with the estimator but the samples."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.samples import Float64


def second_opinion(found: Estimate) -> Float64:
    """
    Fit v' = -(c0 + c1 v + c2 v |v|) to the samples and return c0, c1, c2.

    Least squares through the equation of motion: it shares the samples with
    the estimate and nothing else. The speed is fitted; without one the
    distance, and then no coefficient is negative, or noise would rule them.
    """
    name = next((each for each in found.tracks if each != 'position'), 'position')
    track = found.tracks[name]
    time_s = (track.time_ns - found.start_ns) * 1e-9
    column = 1 if name == 'position' else 0

    def residual(x: Float64) -> Float64:
        solved = solve_ivp(
            lambda _, s: (-(x[1] + x[2] * s[0] + x[3] * s[0] * abs(s[0])), s[0]),
            (time_s[0], time_s[-1]),
            (x[0], x[4]),
            t_eval=time_s,
            rtol=1e-7,
            atol=1e-9,
        )
        return np.asarray(solved.y[column] - track.measured)

    v0 = float(found.curve.speed_m_s[-1])
    quadratic = float(found.curve.resistance_m_s2.mean()) / v0**2
    start = [v0, 1e-3 * quadratic, 1e-3 * quadratic, quadratic, 0.0]
    low = [-np.inf, *(3 * [0.0 if name == 'position' else -np.inf]), -np.inf]
    fit = least_squares(residual, start, bounds=(low, np.inf), x_scale='jac')
    return np.asarray(fit.x[1:4])
