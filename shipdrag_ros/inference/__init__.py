# SPDX-License-Identifier: Apache-2.0
"""Gaussian inference: algebra, noise and rows that estimate and diagnosis share."""

from shipdrag_ros.inference.averaging import average
from shipdrag_ros.inference.gaussian import cholesky, condense, posterior

__all__ = ['average', 'cholesky', 'condense', 'posterior']
