# SPDX-License-Identifier: Apache-2.0
"""The estimators of S1, as published."""
