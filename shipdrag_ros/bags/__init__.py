# SPDX-License-Identifier: Apache-2.0
"""MCAP in and out."""

from shipdrag_ros.bags.comparison import Recorded
from shipdrag_ros.bags.reader import open_runs
from shipdrag_ros.bags.replay import InputCounts, ReplayResult, replay
from shipdrag_ros.bags.run import Inputs, ResetMark, Run, TopicInfo
from shipdrag_ros.bags.writer import BagWriter, Compression

__all__ = [
    'BagWriter',
    'Compression',
    'InputCounts',
    'Inputs',
    'Recorded',
    'ReplayResult',
    'ResetMark',
    'Run',
    'TopicInfo',
    'open_runs',
    'replay',
]
