# SPDX-License-Identifier: Apache-2.0
"""Gaussian inference: algebra, noise and rows that estimate and diagnosis share."""
