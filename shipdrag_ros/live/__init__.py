# SPDX-License-Identifier: Apache-2.0
"""The page on the bridge: what a node says, or what a bag holds, for a browser."""

FASTEST = 1000.0
"""Seconds of a bag that are played in a second."""
