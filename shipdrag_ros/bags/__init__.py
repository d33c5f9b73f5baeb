# SPDX-License-Identifier: Apache-2.0
"""MCAP in and out."""

from shipdrag_ros.bags.check import FileCheck, check
from shipdrag_ros.bags.coasts import clocks_apart, coast_windows
from shipdrag_ros.bags.columns import parse_input, parse_time
from shipdrag_ros.bags.comparison import Recorded
from shipdrag_ros.bags.csv_import import ImportResult, import_csv
from shipdrag_ros.bags.damage import Damage, DamageKind
from shipdrag_ros.bags.nmea_import import NmeaResult, import_nmea
from shipdrag_ros.bags.nmea_log import Checksum
from shipdrag_ros.bags.no_coastdown import why_no_coastdown
from shipdrag_ros.bags.playback import InputCounts, ReplayResult, replay
from shipdrag_ros.bags.reader import open_runs
from shipdrag_ros.bags.recover import Recovery, recover
from shipdrag_ros.bags.run import Inputs, ResetMark, Run, TopicInfo
from shipdrag_ros.bags.sailing import accepted_samples
from shipdrag_ros.bags.summary import BagInfo, info
from shipdrag_ros.bags.writer import BagWriter, Compression

__all__ = [
    'BagInfo',
    'BagWriter',
    'Checksum',
    'Compression',
    'Damage',
    'DamageKind',
    'FileCheck',
    'ImportResult',
    'InputCounts',
    'Inputs',
    'NmeaResult',
    'Recorded',
    'Recovery',
    'ReplayResult',
    'ResetMark',
    'Run',
    'TopicInfo',
    'accepted_samples',
    'check',
    'clocks_apart',
    'coast_windows',
    'import_csv',
    'import_nmea',
    'info',
    'open_runs',
    'parse_input',
    'parse_time',
    'recover',
    'replay',
    'why_no_coastdown',
]
