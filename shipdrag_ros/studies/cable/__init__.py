# SPDX-License-Identifier: Apache-2.0
"""Drag of a towed cable, and the lines that may replace it: S2."""

from shipdrag_ros.studies import Study

STUDY = Study(
    'cable',
    'drag of a towed cable, and the line that may replace it',
    (
        'shipdrag cable --length 50 --diameter 0.1 --speed 3 --report cable.html',
        'shipdrag cable --length 50 --diameter 0.1 --speed 3 --rough --json cable.json',
    ),
)
