# SPDX-License-Identifier: Apache-2.0
"""
How samples of one input are weighed by the variances that they state.

Only relative to each other: how large the noise is, is found from its scatter. And only as far
as that scatter bears them out: a receiver that is sure of its worst readings is not believed.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.regression.orthogonal import OrthogonalBasis
from shipdrag_ros.samples import Float64

_ORDER = 12  # of the polynomial that stands for the motion
_RANGE = 100.0  # of a variance over the typical one, up and down
_PRIOR_SD = 0.5  # of the power of the stated variance that holds, about 1
_OF_LOG_CHI2 = np.pi / np.sqrt(2.0)  # sd of ln(z^2) of a standard normal z
_LEAST = 1e-12  # of the largest residual: none is 0


def stated_weight(time_s: Float64, value: Float64, variance: Float64) -> Float64:
    """
    Return the weight of each sample, 1 for the typical stated variance.

    Parameters
    ----------
    time_s, value : (n,)
        In ascending time.
    variance : (n,), of a position (n, 2)
        One that is not above 0 and finite is not stated.

    Returns
    -------
    (n,)
        All 1 where a sample states no variance, or all state the same one.

    Notes
    -----
    The variance is that stated to a power, found from how the logarithm of the squared residual
    of a polynomial follows that of the stated variance; before, 1 +- 0.5, and within 0 to 1.
    """
    ones = np.ones(len(value))
    if len(value) <= _ORDER or not np.all(variance[0] > 0.0) or np.all(variance == variance[0]):
        return ones
    variance = variance.reshape(len(value), -1).mean(axis=1)
    if not np.all(np.isfinite(variance) & (variance > 0.0)):
        return ones
    log = np.log(np.clip(variance / np.median(variance), 1.0 / _RANGE, _RANGE))
    middle = 0.5 * (time_s[0] + time_s[-1])
    basis = OrthogonalBasis.on((time_s - middle) / (time_s[-1] - middle), _ORDER)
    coefficients, _ = basis.fit(value)
    size = np.abs(value - np.einsum('k,kn->n', coefficients, basis.columns))
    follows = 2.0 * np.log(size + _LEAST * float(size.max()) + np.finfo(np.float64).tiny)
    away = log - log.mean()
    spread = float((away * away).sum())
    precision, of_prior = spread / _OF_LOG_CHI2**2, 1.0 / _PRIOR_SD**2
    found = float((away * follows).sum()) / spread
    power = (precision * found + of_prior) / (precision + of_prior)
    result: Float64 = np.exp(-min(max(power, 0.0), 1.0) * log)
    return result
