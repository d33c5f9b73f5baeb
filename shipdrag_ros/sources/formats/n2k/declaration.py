# SPDX-License-Identifier: Apache-2.0
"""NMEA 2000 as a format of `shipdrag import`."""

from __future__ import annotations

from shipdrag_ros.sources.format import (
    CERTAIN,
    DATE,
    GEAR,
    NO,
    RATE,
    TRANSDUCER,
    Format,
    Head,
    Job,
)
from shipdrag_ros.sources.formats.n2k.frames import parse
from shipdrag_ros.sources.log import Log
from shipdrag_ros.sources.stream import StreamResult, read_stream


def _score(head: Head) -> float:
    return CERTAIN if head.share(parse) > 0.5 else NO


def _open(job: Job, log: Log) -> StreamResult:
    # the table of messages takes long to import
    from shipdrag_ros.sources.formats.n2k.reader import N2kReader, clock_of

    clock = clock_of(job)
    about = {key: job.options.get(key) for key in ('date', 'gear', 'rate', 'transducer')}
    return read_stream(
        job, log, 'n2k', lambda tally: N2kReader(tally, clock, job.options).read(job), about=about
    )


FORMAT = Format(
    name='n2k',
    kind='a log of NMEA 2000',
    about='Lines of candump, Actisense (N2K ASCII), Yacht Devices (RAW) or canboat. PGNs 128259 '
    'speed through water, 129026 speed over ground, 129025 and 129029 position, 127250 heading, '
    '130306 apparent wind, 128267 depth, 127245 rudder; of 127488, the engine, with --gear. A '
    'time of day takes its date from 126992 or 129029; lines without any time are counted with '
    '--rate.',
    score=_score,
    read=_open,
    options=(DATE, GEAR, RATE, TRANSDUCER),
)
