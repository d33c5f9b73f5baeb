# SPDX-License-Identifier: Apache-2.0
"""The condensed matrix says about least squares what the whole one says."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from shipdrag_ros.regression import inverse, triangle


@pytest.mark.parametrize('n', [1, 5, 127, 128, 129, 5000])
def test_same_gram_matrix(n: int) -> None:
    rows = np.random.default_rng(1).normal(size=(n, 6)) * 10.0 ** np.arange(6)
    factor = triangle(rows)
    assert factor.shape == (6, 6)
    np.testing.assert_array_equal(factor, np.triu(factor))
    size = np.linalg.norm(rows, axis=0)
    np.testing.assert_allclose(
        factor.T @ factor / np.outer(size, size),
        rows.T @ rows / np.outer(size, size),
        rtol=0.0,
        atol=1e-13,
    )


def test_residual_sum_without_cancellation() -> None:
    rng = np.random.default_rng(2)
    noise = rng.normal(size=2000)
    design = np.stack([np.ones(2000), np.linspace(-1.0, 1.0, 2000)], axis=1)
    noise -= design @ np.linalg.lstsq(design, noise)[0]
    data = design @ [1e7, 3e6] + noise
    factor = triangle(np.column_stack([design, data]))
    np.testing.assert_allclose(factor[2, 2] ** 2, noise @ noise, rtol=1e-8)


def test_many_columns() -> None:
    rows = np.random.default_rng(4).normal(size=(700, 165))
    factor = triangle(rows)
    np.testing.assert_allclose(factor.T @ factor, rows.T @ rows, rtol=0.0, atol=1e-10)


def test_inverse() -> None:
    upper = triangle(np.random.default_rng(3).normal(size=(60, 20)))
    np.testing.assert_allclose(inverse(upper) @ upper, np.eye(20), rtol=0.0, atol=1e-13)
    np.testing.assert_array_equal(inverse(upper), np.triu(inverse(upper)))


def test_threads_of_blas_change_no_bit() -> None:
    code = (
        'import numpy as np, zlib\n'
        'from shipdrag_ros.regression import triangle\n'
        'rows = np.random.default_rng(0).normal(size=(30000, 41))\n'
        'print(zlib.crc32(triangle(rows).tobytes()))\n'
    )
    found = {
        subprocess.run(
            [sys.executable, '-c', code],
            env={**os.environ, 'OPENBLAS_NUM_THREADS': threads},
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        ).stdout
        for threads in ('1', '2')
    }
    assert len(found) == 1
