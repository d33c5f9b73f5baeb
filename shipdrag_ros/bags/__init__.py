# SPDX-License-Identifier: Apache-2.0
"""MCAP in and out."""

from shipdrag_ros.bags.reader import open_runs
from shipdrag_ros.bags.run import Inputs, ResetMark, Run, TopicInfo
from shipdrag_ros.bags.writer import BagWriter, Compression

__all__ = ['BagWriter', 'Compression', 'Inputs', 'ResetMark', 'Run', 'TopicInfo', 'open_runs']
