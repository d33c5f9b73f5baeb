# SPDX-License-Identifier: Apache-2.0
"""Logs and tables of measurements made bags."""
