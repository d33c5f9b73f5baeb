# SPDX-License-Identifier: Apache-2.0
"""Resistance against speed from a window of samples."""

from shipdrag_ros.estimation.choice import estimate, estimate_final
from shipdrag_ros.estimation.window import Series, Window

__all__ = ['Series', 'Window', 'estimate', 'estimate_final']
