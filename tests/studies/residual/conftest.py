# SPDX-License-Identifier: Apache-2.0
"""River ships whose resistance is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.residual.fit import Hulls

RIVER_SHIP = """
name: River ship
length_m: 130.0
breadth_m: 16.5
draught_m: 4.1
displaced_volume_m3: 7370.0
wetted_surface_m2: 2900.0
added_mass: {model: constant, value: 0.05, sd: 0.02}
baseline:
  source: estimate
  form_factor: 0.20
  correlation_allowance: 3.0e-4
  wave_froude: [0.0, 0.12, 0.22]
  wave_coefficient: [0.0, 5.0e-5, 8.0e-4]
  relative_sd: {friction: 0.02, wave: 0.10}
"""
NAMES = ('L_B', 'B_T', 'C_B', 'lcb', 'Fr')


def physical(hulls: Hulls) -> Float64:
    """10^3 c_R that rises with Fr and B/T and falls with slenderness, in no form's terms."""
    assert hulls.lcb is not None
    waves = 60.0 * hulls.Fr**2 * hulls.C_B
    return (
        6.0 / hulls.slenderness
        + waves
        + 0.16 * (hulls.B_T - 2.5)
        + 150.0 * (hulls.lcb - 0.005) ** 2
    )


@pytest.fixture
def fleet() -> Callable[[int, int], Hulls]:
    """`count` hulls at eight speeds each, from a seed."""

    def make(count: int, seed: int) -> Hulls:
        rng = np.random.default_rng(seed)
        shapes = rng.uniform([6.0, 2.8, 0.80, -0.01], [9.5, 5.5, 0.87, 0.02], (count, 4))
        froude = np.tile(np.linspace(0.08, 0.20, 8), count)
        rows = np.column_stack([np.repeat(shapes, 8, axis=0), froude])
        return Hulls.of('fleet', NAMES, rows)

    return make


@pytest.fixture
def resistance() -> Callable[[Hulls], Float64]:
    return physical
