# SPDX-License-Identifier: Apache-2.0
"""Least squares: polynomials in time, any columns, and the order they should have."""
