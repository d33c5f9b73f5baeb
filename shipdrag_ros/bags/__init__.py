# SPDX-License-Identifier: Apache-2.0
"""MCAP files in and out; nothing that estimates."""

from shipdrag_ros.bags.run import (
    BagInfo,
    Mark,
    ResetMark,
    Run,
    RunSamples,
    SilenceMark,
    StopMark,
    TopicInfo,
    info,
    open_runs,
)
from shipdrag_ros.bags.writer import BagWriter, Compression

__all__ = [
    'BagInfo',
    'BagWriter',
    'Compression',
    'Mark',
    'ResetMark',
    'Run',
    'RunSamples',
    'SilenceMark',
    'StopMark',
    'TopicInfo',
    'info',
    'open_runs',
]
