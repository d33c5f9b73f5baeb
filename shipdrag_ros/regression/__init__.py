# SPDX-License-Identifier: Apache-2.0
"""Least squares on orthogonal polynomials, and the order they should have."""

from shipdrag_ros.regression.order import OrderTable, fit_orders
from shipdrag_ros.regression.orthogonal import OrthogonalBasis, TimeScale
from shipdrag_ros.regression.triangle import inverse, triangle

__all__ = ['OrderTable', 'OrthogonalBasis', 'TimeScale', 'fit_orders', 'inverse', 'triangle']
