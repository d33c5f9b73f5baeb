# SPDX-License-Identifier: Apache-2.0
"""Bags through the monitor that runs on board."""

from shipdrag_ros.replay.coasts import accepted_samples, clocks_apart, coast_windows
from shipdrag_ros.replay.comparison import Recorded
from shipdrag_ros.replay.no_coastdown import why_no_coastdown
from shipdrag_ros.replay.playback import InputCounts, ReplayResult, replay

__all__ = [
    'InputCounts',
    'Recorded',
    'ReplayResult',
    'accepted_samples',
    'clocks_apart',
    'coast_windows',
    'replay',
    'why_no_coastdown',
]
