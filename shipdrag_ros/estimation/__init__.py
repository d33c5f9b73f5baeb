# SPDX-License-Identifier: Apache-2.0
"""Resistance against speed from a window of samples."""

from shipdrag_ros.estimation.s1 import estimate
from shipdrag_ros.estimation.window import Series, Window

__all__ = ['Series', 'Window', 'estimate']
