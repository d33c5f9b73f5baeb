# SPDX-License-Identifier: Apache-2.0
"""
River ships with a resistance that is known: what S4 holds its regressions against.

The paper recomputes a control curve from a prototype by Avdeev's diagrams. Here
the control is the diagrams of Guldhammer and Harvald as Andersen and Guldhammer
(1986) put them into formulas: rising with Fr and B/T, falling with L / V^(1/3),
in terms that neither form has.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.residual.fit import Hulls

NAMES = ('L_B', 'B_T', 'C_B', 'lcb', 'Fr')
PROTOTYPE = (8.18, 4.0, 0.851, 0.005)  # the ship of project 507; its lcb is not stated
LOW = np.array([6.0, 2.8, 0.80, -0.01])
HIGH = np.array([9.5, 5.5, 0.87, 0.02])
FROUDE = (0.08, 0.20)
SPEEDS = 8  # of each model
_MIDSHIP = 0.995  # midship coefficient of river ships
LINES = 0.03  # sd of what differs between hulls of the same ratios
NOISE = 0.01  # sd of one test


def control(hulls: Hulls) -> Float64:
    """
    Return 10^3 c_R; lcb off its best place adds to it.

    Notes
    -----
    10^3 C_R = E + G + K + 0.16 (B/T - 2.5) with M = L / V^(1/3); the term H of
    the formulas is nothing at these speeds and left out.
    """
    assert hulls.lcb is not None
    m, froude, prismatic = hulls.slenderness, hulls.Fr, hulls.C_B / _MIDSHIP
    a0 = 1.35 - 0.23 * m + 0.012 * m**2
    a1, n1 = 0.0011 * m**9.1, 2.0 * m - 3.7
    e = (a0 + 1.5 * froude**1.8 + a1 * froude**n1) * (0.98 + 2.5 / (m - 2.0) ** 4)
    e += (m - 5.0) ** 4 * (froude - 0.1) ** 4
    g = (7.0 - 0.09 * m**2) * (5.0 * prismatic - 2.5) ** 2
    g /= (600.0 * (froude - 0.315) ** 2 + 1.0) ** 1.5
    k = 180.0 * froude**3.7 * np.exp(20.0 * prismatic - 16.0)
    return e + g + k + 0.16 * (hulls.B_T - 2.5) + 150.0 * (hulls.lcb - 0.005) ** 2


def models(count: int, rng: np.random.Generator) -> tuple[Hulls, Float64]:
    """
    Return tests of models: the prototype and others, each at speeds of its own.
    """
    shapes = rng.uniform(LOW, HIGH, (count, 4))
    shapes[0] = PROTOTYPE
    froude = np.sort(rng.uniform(*FROUDE, (count, SPEEDS)), axis=1)
    hulls = rows(np.repeat(shapes, SPEEDS, axis=0), froude.ravel())
    lines = np.repeat(1.0 + LINES * rng.normal(size=count), SPEEDS)
    return hulls, control(hulls) * lines * (1.0 + NOISE * rng.normal(size=len(hulls)))


def wanted(count: int, rng: np.random.Generator) -> Hulls:
    """
    Return hulls to predict, up to a quarter of the range beyond the data.
    """
    wider = 0.25 * (HIGH - LOW)
    shapes = rng.uniform(LOW - wider, HIGH + wider, (count, 4))
    return rows(shapes, rng.uniform(*FROUDE, count))


def sweep(ratio: int, values: Float64, froude: float) -> Hulls:
    """
    Return the prototype with one of L/B (0) or B/T (1) varied.
    """
    shapes = np.tile(PROTOTYPE, (len(values), 1))
    shapes[:, ratio] = values
    return rows(shapes, np.full(len(values), froude))


def rows(shapes: Float64, froude: Float64) -> Hulls:
    """
    Return hulls from (n, 4) shapes and (n,) Froude numbers.
    """
    return Hulls.of('river ships', NAMES, np.column_stack([shapes, froude]))
