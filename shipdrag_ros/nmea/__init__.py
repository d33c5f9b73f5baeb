# SPDX-License-Identifier: Apache-2.0
"""NMEA 0183: what its sentences measure, and how they are heard from a line, live or in a log."""
