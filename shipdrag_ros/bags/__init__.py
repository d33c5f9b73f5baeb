# SPDX-License-Identifier: Apache-2.0
"""MCAP files in and out; nothing that estimates."""

from shipdrag_ros.bags.run import ResetMark as ResetMark
from shipdrag_ros.bags.run import Run as Run
from shipdrag_ros.bags.run import StopMark as StopMark
from shipdrag_ros.bags.run import WindowedRun as WindowedRun
from shipdrag_ros.bags.run import WindowSpan as WindowSpan
from shipdrag_ros.bags.run import open_runs as open_runs
from shipdrag_ros.bags.writer import BagWriter as BagWriter
from shipdrag_ros.bags.writer import Compression as Compression
