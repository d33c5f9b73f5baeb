# SPDX-License-Identifier: Apache-2.0
"""Hydrodynamic resistance of a ship from its coastdowns, live and from bags."""

__version__ = '0.1.0'
