# SPDX-License-Identifier: Apache-2.0
"""Robust scale: the median absolute deviation."""

MAD_TO_SD = 1.482602218505602
"""Standard deviation of normal noise over the median of its size."""
