# SPDX-License-Identifier: Apache-2.0
"""Least squares: polynomials in time, any columns, and the order they should have."""

from shipdrag_ros.regression.least_squares import LinearFit, inverse, least_squares, triangle
from shipdrag_ros.regression.order import OrderTable, fit_orders
from shipdrag_ros.regression.orthogonal import OrthogonalBasis, TimeScale

__all__ = [
    'LinearFit',
    'OrderTable',
    'OrthogonalBasis',
    'TimeScale',
    'fit_orders',
    'inverse',
    'least_squares',
    'triangle',
]
