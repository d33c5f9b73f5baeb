# SPDX-License-Identifier: Apache-2.0
"""
How large an effect can be at most, and from which size on it would have been named.

Plain data in, plain data out, as `decision`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, ndtri, ndtri_exp

from shipdrag_ros.inference.decision import CERTAIN
from shipdrag_ros.parameter import Prior, Shape
from shipdrag_ros.samples import Float64

_POINTS = 400  # of the distribution of a size under one hypothesis
_UNLUCKY_SD = float(ndtri(CERTAIN))  # noise is kinder in so many of all runs
_AMOUNTS = np.geomspace(1e-3, 1e4, 700)  # steps of 2.3 %


class SizePosterior(NamedTuple):
    """
    The size of an effect under one hypothesis that holds it: Gaussian in z.

    Attributes
    ----------
    weight
        Probability of the hypothesis.
    z, sd
        Mean and standard deviation of z, before what is beyond the end of a one-sided prior is
        left out.
    prior
        That makes a size of z.
    """

    weight: float
    z: float
    sd: float
    prior: Prior


def quantile(sizes: Sequence[SizePosterior], share: float) -> float:
    """
    Return a quantile of the absolute size of an effect, given that it is there.

    Parameters
    ----------
    sizes
        Under each hypothesis that holds it.
    share
        0 .. 1; 0.95 for an upper limit.

    Raises
    ------
    ValueError
        If no hypothesis has a weight.

    Examples
    --------
    >>> from shipdrag_ros.parameter import normal
    >>> round(quantile([SizePosterior(1.0, 0.0, 1.0, normal(0.1))], 0.95), 3)
    0.196
    """
    known = [each for each in sizes if each.weight > 0.0 and np.isfinite(each.sd)]
    if not known:
        raise ValueError('no hypothesis with a weight: the size has no distribution')
    log_beyond = np.log1p(-(np.arange(_POINTS) + 0.5) / _POINTS)
    values, weights = [], []
    for each in known:
        sd = max(each.sd, 1e-12)
        # in logarithms: of a mean far beyond the end of a one-sided prior next to nothing is left
        left = log_ndtr(each.z / sd) if each.prior.shape is Shape.HALF_NORMAL else 0.0
        z = each.z - sd * ndtri_exp(log_beyond + left)
        values += [abs(each.prior.at(one)) for one in z.tolist()]
        weights += [each.weight] * _POINTS
    order = np.argsort(values)
    weight, value = np.array(weights)[order], np.array(values)[order]
    # between points: a step of the distribution at the last digit of a weight is none of the limit
    weight /= weight.sum()  # it may be as small as a number can be
    middle = np.cumsum(weight) - 0.5 * weight
    return float(np.interp(share, middle, value))


class Sensitivity(NamedTuple):
    """
    What a record says of e effects of unit amount, linear about nothing missing.

    Attributes
    ----------
    information : (e, e)
        Products of their whitened responses, less what the nuisances take up.
    mean, precision : (e,)
        Gaussian priors of the amounts.
    log_odds : (e,)
        Prior log odds over nothing.
    """

    information: Float64
    mean: Float64
    precision: Float64
    log_odds: Float64


def named_from(known: Sensitivity) -> Float64:
    """
    Return the amount from which each effect is named in nine of ten such records.

    Parameters
    ----------
    known

    Returns
    -------
    (e,)
        Infinite where no amount is: another effect has the same trace.

    Notes
    -----
    The log evidence of a linear effect with the score b and the information I, under a Gaussian
    prior of mean m and precision p, over that of nothing is ((b + p m)^2 / (I + p) - p m^2) / 2 -
    ln((I + p) / p) / 2. The scores of all effects under the truth of one are Gaussian; the
    evidence over each rival is taken where one record of ten has less, to first order in the
    scores.
    """
    count = len(known.mean)
    found = np.full(count, np.inf)
    own = np.diag(known.information)
    precision, mean = known.precision, known.mean
    for e in range(count):
        # scores by amount, (a, e)
        score = np.outer(_AMOUNTS, known.information[e])
        slope = (score + precision * mean) / (own + precision)
        gain = 0.5 * (slope * (score + precision * mean) - precision * mean**2)
        gain += known.log_odds - 0.5 * np.log((own + precision) / precision)
        # nothing is the first rival
        ahead = np.column_stack([gain[:, e], gain[:, [e]] - np.delete(gain, e, axis=1)])
        other = np.delete(slope, e, axis=1)
        shared = np.delete(known.information[e], e)
        of_own = slope[:, [e]]
        variance = (
            of_own**2 * own[e] + other**2 * np.delete(own, e) - 2.0 * of_own * other * shared
        )
        noise = np.sqrt(np.maximum(np.column_stack([of_own[:, 0] ** 2 * own[e], variance]), 0.0))
        least = ahead - _UNLUCKY_SD * noise
        sure = 1.0 / (1.0 + np.exp(-np.clip(least, -700.0, 700.0)).sum(axis=1)) >= CERTAIN
        # from there on for good
        missed = np.flatnonzero(~sure)
        if len(missed) == 0:
            found[e] = _AMOUNTS[0]
        elif missed[-1] + 1 < len(_AMOUNTS):
            found[e] = _AMOUNTS[missed[-1] + 1]
    return found
