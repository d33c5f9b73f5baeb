# SPDX-License-Identifier: Apache-2.0
"""Gaussian inference: rows, noise and algebra that estimate and diagnosis share."""
