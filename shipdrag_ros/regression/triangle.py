# SPDX-License-Identifier: Apache-2.0
"""
A tall matrix condensed to its triangular factor.

The factor of [A | z] holds all that least squares needs of A and z: any
weighting against other data, any number of leading columns and the residual
sums follow from it, at a cost that no longer depends on the number of rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shipdrag_ros.samples import Float64

# Small enough that BLAS never splits the work between threads, so that the last
# bit does not depend on how many there are; at least twice the columns.
_BLOCK = 128


def triangle(rows: Float64) -> Float64:
    """
    Return the triangular factor R of rows = Q R, without Q.

    Parameters
    ----------
    rows : (n, k)
        With more than 64 columns the last bit may depend on the threads of BLAS.

    Returns
    -------
    (k, k)
        Upper triangular; rows of zeros at the end where n < k.

    Notes
    -----
    Householder on blocks of rows, then on the stacked factors.
    """
    k = rows.shape[1]
    block = max(_BLOCK, 2 * k)
    householder: Any = np.linalg.qr  # numpy's types do not know that mode 'r' gives one array
    while len(rows) > block:
        blocks = -(-len(rows) // block)
        padded = np.zeros((blocks * block, k))
        padded[: len(rows)] = rows
        rows = householder(padded.reshape(blocks, block, k), mode='r').reshape(-1, k)
    if len(rows) < k:
        rows = np.concatenate([rows, np.zeros((k - len(rows), k))])
    factor: Float64 = householder(rows, mode='r')
    return factor


def inverse(upper: Float64) -> Float64:
    """
    Return the inverse of a small upper triangular matrix.

    Parameters
    ----------
    upper : (k, k)
        Without zeros on the diagonal.

    Notes
    -----
    Back substitution; the library's solver starts threads for any size.
    """
    result = np.eye(len(upper))
    for i in reversed(range(len(upper))):
        result[i] -= upper[i, i + 1 :] @ result[i + 1 :]
        result[i] /= upper[i, i]
    return result
