# SPDX-License-Identifier: Apache-2.0
"""What stands beside the forms of S4: a cubic with more terms, and a Gaussian process."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.residual.fit import Hulls, RegressionForm
from shipdrag_ros.studies.surface.fit import monomials, terms_up_to

WRONG = 0.15  # a prediction this far off, relative, is a bad one
SHAPES = ('L_B', 'B_T', 'C_B', 'lcb', 'Fr')
CUBE = terms_up_to(3, [3] * len(SHAPES))
CUBIC = RegressionForm(
    'cubic',
    lambda hulls: dict(
        zip(
            map(str, CUBE),
            monomials(np.column_stack([getattr(hulls, name) for name in SHAPES]), CUBE).T,
        )
    ),
    SHAPES,
)
Predictor = Callable[[Hulls], Float64]


def gauss(hulls: Hulls, values: Float64, offset: float) -> Predictor:
    """
    Fit a Gaussian process to the logarithm, about a power law with physical signs.

    The mean is in 1, log Fr, Fr^2, log slenderness and log B/T.
    """

    def mean(of: Hulls) -> Float64:
        return np.column_stack(
            [np.ones(len(of)), np.log(of.Fr), of.Fr**2, np.log(of.slenderness), np.log(of.B_T)]
        )

    def place(of: Hulls) -> Float64:
        return (CUBIC.place(of) - centre) / scale

    centre = CUBIC.place(hulls).mean(axis=0)
    scale = CUBIC.place(hulls).std(axis=0) + 1e-9
    logarithm = np.log(values + offset)
    law = np.linalg.lstsq(mean(hulls), logarithm)[0]
    left = logarithm - mean(hulls) @ law
    size = left.std()
    kernel = ConstantKernel() * RBF(np.full(len(SHAPES), 2.0), (0.1, 100.0)) + WhiteKernel(0.01)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # a length that reaches its bound
        process = GaussianProcessRegressor(kernel).fit(place(hulls), left / size)
    return lambda of: np.exp(mean(of) @ law + size * process.predict(place(of))) - offset


def rms(values: Float64) -> float:
    """
    Return the root mean square; NaN of nothing.
    """
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float('nan')


def shown(value: float, digits: str = '.2f') -> str:
    """
    Return a figure for a cell.
    """
    return '-' if np.isnan(value) else format(value, digits)
