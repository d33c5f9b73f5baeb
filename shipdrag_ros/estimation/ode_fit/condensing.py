# SPDX-License-Identifier: Apache-2.0
"""A coastdown condensed to a row a step of the integration and input; compiled."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import KIND_COUNT, Rows
from shipdrag_ros.samples import Float64


@compiled
def means(
    rows: Rows, first: int, residual: Float64, variance: Float64, grid_s: Float64
) -> tuple[Rows, Float64]:
    """
    Return the weighted means of rows over each step of a grid.

    Parameters
    ----------
    rows, residual, variance : (n,)
        The value of a mean is that of the residual.
    first
        Where to begin.
    grid_s
        Ascending from 0; what lies before is in one step more.

    Returns
    -------
    rows, variance
        In ascending time.
    """
    n, cells = len(rows.time_s), len(grid_s) + 1
    sums = np.zeros((cells, KIND_COUNT, 3))
    cell = 0
    for i in range(first, n):
        while cell < cells - 1 and rows.time_s[i] >= grid_s[cell]:
            cell += 1
        weight = 1.0 / variance[i]
        of = sums[cell, rows.kind[i]]
        of[0] += weight
        of[1] += weight * rows.time_s[i]
        of[2] += weight * residual[i]
    most = cells * KIND_COUNT
    time_s, value, spread = np.empty(most), np.empty(most), np.empty(most)
    kind = np.empty(most, np.int64)
    m = 0
    for cell in range(cells):
        for of_kind in range(KIND_COUNT):
            weight, time, total = sums[cell, of_kind]
            if weight > 0.0:
                time_s[m], kind[m] = time / weight, of_kind
                value[m], spread[m] = total / weight, 1.0 / weight
                m += 1
    order = np.argsort(time_s[:m], kind='mergesort')
    return Rows(time_s[:m][order], kind[:m][order], value[:m][order]), spread[:m][order]
