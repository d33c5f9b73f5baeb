# SPDX-License-Identifier: Apache-2.0
"""Bags through the monitor that runs on board."""

from shipdrag_ros.replay.coasts import accepted_samples as accepted_samples
from shipdrag_ros.replay.coasts import clocks_apart as clocks_apart
from shipdrag_ros.replay.coasts import coast_windows as coast_windows
from shipdrag_ros.replay.coasts import why_no_coastdown as why_no_coastdown
from shipdrag_ros.replay.comparison import Recorded as Recorded
from shipdrag_ros.replay.playback import ReplayResult as ReplayResult
from shipdrag_ros.replay.playback import replay as replay
