# SPDX-License-Identifier: Apache-2.0
"""MCAP in and out."""

from shipdrag_ros.bags.writer import BagWriter, Compression

__all__ = ['BagWriter', 'Compression']
