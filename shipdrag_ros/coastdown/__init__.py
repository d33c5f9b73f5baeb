# SPDX-License-Identifier: Apache-2.0
"""Coastdowns found in a sequence of samples: when they begin, run and end."""

from shipdrag_ros.coastdown.monitor import Monitor
from shipdrag_ros.coastdown.validate import validate

__all__ = ['Monitor', 'validate']
