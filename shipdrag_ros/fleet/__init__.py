# SPDX-License-Identifier: Apache-2.0
"""Thousands of bags: found, replayed and diagnosed by many workers, one row a coastdown."""
