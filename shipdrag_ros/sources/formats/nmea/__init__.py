# SPDX-License-Identifier: Apache-2.0
"""Logs of NMEA 0183."""
