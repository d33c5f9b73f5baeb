# SPDX-License-Identifier: Apache-2.0
"""
Linear models under Gaussian priors, averaged by their marginal likelihood.

The rows are condensed once; then every model, a choice of columns under a prior, is a matter of
one small triangular factor.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.gaussian import SUMS, factor, forward
from shipdrag_ros.samples import Float64

_NEGLIGIBLE = 1e-3  # weight of a model against the best; the rest is left out of the spread


@compiled('void(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])', fastmath=SUMS)
def _between(products: Float64, root: Float64, half: Float64, matrix: Float64) -> None:
    """Fill in half = G R and the matrix R' G R + 1, R lower, G the first k products."""
    k = len(root)
    for a in range(k):
        half[a] = 0.0
        matrix[a] = 0.0
        matrix[a, a] = 1.0
        for c in range(k):
            for b in range(c + 1):
                half[a, b] += products[a, c] * root[c, b]
    for c in range(k):
        for a in range(c + 1):
            for b in range(k):
                matrix[a, b] += root[c, a] * half[c, b]


@compiled('Tuple((f8[:, ::1], f8[::1]))(f8[:, :], f8[:], b1[:])')
def _part(matrix: Float64, vector: Float64, kept: NDArray[np.bool_]) -> tuple[Float64, Float64]:
    """Return the lines of a matrix and a vector that are kept."""
    columns = np.flatnonzero(kept)
    m = len(columns)
    part, right = np.empty((m, m)), np.empty(m)
    for a in range(m):
        right[a] = vector[columns[a]]
        for b in range(m):
            part[a, b] = matrix[columns[a], columns[b]]
    return part, right


@compiled(
    'Tuple((f8[::1], f8[:, ::1], f8[:, ::1]))'
    '(f8[:, ::1], f8[::1], b1[:, ::1], f8[::1], f8[:, ::1], f8[:, :, ::1])',
)
def average(
    products: Float64,
    start: Float64,
    families: NDArray[np.bool_],
    chance: Float64,
    means: Float64,
    roots: Float64,
) -> tuple[Float64, Float64, Float64]:
    """
    Average all families of columns under all priors.

    Parameters
    ----------
    products : (k + 1, k)
        See `posterior`.
    start : (k,)
        0 in every column that some family lacks.
    families : (f, k) bool
        Which columns each has; a coefficient that is not in is 0.
    chance : (f,)
        Prior probability of each.
    means : (p, k)
        Of the priors.
    roots : (p, k, k)
        Lower root R of the covariance R R' of each prior. What some family
        lacks is independent of the rest.

    Returns
    -------
    coefficients : (k,)
    covariance : (k, k)
        Within the models and between them.
    weight : (f, p)
        Of each model, summing to 1.

    Notes
    -----
    Mean and variance over models as Buckland, Burnham and Augustin (1997) have
    them; weights by marginal likelihood in place of an information criterion,
    because the models differ in how strongly coefficients are held, not in how
    many there are. Solved in units of the prior, in which it is the identity:
    no covariance is inverted, however strongly it holds.
    """
    k, f, p = len(start), len(families), len(roots)
    weight = np.empty((f, p))
    matrices, off = np.empty((p, k, k)), np.empty((p, f, k))
    slopes = np.empty((p, f, k))
    half = np.empty((k, k))
    for q in range(p):
        held, matrix = roots[q], matrices[q]
        _between(products, held, half, matrix)
        for g in range(f):
            distance, slope = off[q, g], slopes[q, g]
            # of the logarithm of the likelihood, at the mean of the prior
            at_mean = 0.0
            for a in range(k):
                distance[a] = means[q, a] - start[a] if families[g, a] else 0.0
            for a in range(k):
                half[0, a] = products[k, a]
                for b in range(k):
                    half[0, a] -= products[a, b] * distance[b]
                at_mean += 0.5 * distance[a] * (products[k, a] + half[0, a])
            for a in range(k):
                slope[a] = 0.0
                for c in range(a, k):
                    slope[a] += held[c, a] * half[0, c]
            lower, right = _part(matrix, slope, families[g])
            if not factor(lower):
                weight[g, q] = -np.inf
                continue
            forward(lower, right)
            evidence = at_mean + math.log(chance[g])
            for a in range(len(right)):
                evidence += 0.5 * right[a] * right[a] - math.log(lower[a, a])
            weight[g, q] = evidence
    weight = np.exp(weight - weight.max())
    weight = np.where(weight < _NEGLIGIBLE, 0.0, weight)
    weight /= weight.sum()

    coefficients, second, step = np.zeros(k), np.zeros((k, k)), np.empty(k)
    for g in range(f):
        columns = np.flatnonzero(families[g])
        rows = np.empty((k, len(columns)))
        for q in range(p):
            share = weight[g, q]
            if share == 0.0:
                continue
            lower, right = _part(matrices[q], slopes[q, g], families[g])
            factor(lower)
            forward(lower, right)
            # rows of a root of the covariance, and with it the step
            for a in range(k):
                step[a] = off[q, g, a]
                for b in range(len(columns)):
                    rows[a, b] = roots[q, a, columns[b]] if families[g, a] else 0.0
                forward(lower, rows[a])
                for b in range(len(columns)):
                    step[a] += rows[a, b] * right[b]
                coefficients[a] += share * step[a]
                for b in range(a + 1):
                    # moments about the start, which is near: nothing cancels
                    total = step[a] * step[b]
                    for c in range(len(columns)):
                        total += rows[a, c] * rows[b, c]
                    second[a, b] += share * total
    for a in range(k):
        for b in range(a + 1):
            second[a, b] -= coefficients[a] * coefficients[b]
            second[b, a] = second[a, b]
    return start + coefficients, second, weight
