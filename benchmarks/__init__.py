# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: worlds by other hands, and scripts that print every figure of the documentation."""

import os

# as the package compiles, or the worlds, which compile first, would change its last digits
os.environ.setdefault('NUMBA_CPU_NAME', 'generic')
