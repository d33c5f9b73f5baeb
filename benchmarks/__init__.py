# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: worlds by other hands, and scripts that print every figure of the documentation."""

import os
from pathlib import Path

# as the package compiles, or the worlds, which compile first, would change its last digits;
# and matrices are too small for threads, or processes share the cores with each other alone
for name, value in (
    ('NUMBA_CPU_NAME', 'generic'), ('OPENBLAS_NUM_THREADS', '1'), ('OMP_NUM_THREADS', '1'),
):  # fmt: skip
    os.environ.setdefault(name, value)

ROOT = Path(__file__).resolve().parents[1]
