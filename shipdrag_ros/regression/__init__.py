# SPDX-License-Identifier: Apache-2.0
"""Least squares: polynomials in time, surfaces, any columns, and the order they should have."""

from shipdrag_ros.regression.least_squares import LinearFit, inverse, least_squares, triangle
from shipdrag_ros.regression.order import OrderTable, fit_orders
from shipdrag_ros.regression.orthogonal import OrthogonalBasis, TimeScale
from shipdrag_ros.regression.surface import Domain, Prediction, Surface, fit_surface

__all__ = [
    'Domain',
    'LinearFit',
    'OrderTable',
    'OrthogonalBasis',
    'Prediction',
    'Surface',
    'TimeScale',
    'fit_orders',
    'fit_surface',
    'inverse',
    'least_squares',
    'triangle',
]
