# SPDX-License-Identifier: Apache-2.0
"""NMEA 0183 as a format of `shipdrag import`."""

from __future__ import annotations

import re

from shipdrag_ros.nmea.reading import Checksum
from shipdrag_ros.sources.format import (
    CERTAIN,
    DATE,
    LIKELY,
    NO,
    TRANSDUCER,
    Format,
    Head,
    Job,
    Option,
    head_of,
)
from shipdrag_ros.sources.formats.nmea.importer import NmeaResult, read_nmea
from shipdrag_ros.sources.log import Log

_SENTENCE = re.compile(r'[$!](?:[A-Z][A-Z0-9]{4}|P[A-Z0-9]{2,}),[^*]*(\*[0-9A-Fa-f]{2})?')
# sentences that wrap NMEA 2000, which has a format of its own
_WRAPPED = re.compile(r'[$!](PCDIN|MXPGN|PDGY),')


def _score(head: Head) -> float:
    share = head.share(_SENTENCE.search)
    if share == 0.0 or head.share(_WRAPPED.search) > 0.5:
        return NO
    return CERTAIN if share > 0.5 else LIKELY


def _without_checksums(head: Head) -> bool:
    """Say whether the logger has cut off all checksums: none of the first sentences has one."""
    found = [match for line in head.lines if (match := _SENTENCE.search(line))]
    return len(found) > 1 and not any(match[1] for match in found)


def _open(job: Job, log: Log) -> NmeaResult:
    checksum = job.options.get('no_checksum')
    cut_off = checksum is None and _without_checksums(head_of(job.source))
    return read_nmea(
        job.source,
        log,
        day=job.options.get('date'),
        transducer_m=job.options.get('transducer'),
        checksum=Checksum.OPTIONAL if checksum or cut_off else Checksum.REQUIRED,
        progress=job.progress,
    )


FORMAT = Format(
    name='nmea',
    kind='an NMEA 0183 log',
    about='VHW VBW VTG RMC GGA GLL HDT HDG THS RPM MWV DPT DBT RSA ZDA, each input from one '
    'talker; of RPM, up to four shafts (numbers 0 to 4) and their pitch. A sentence without a '
    'time has that of the last one with a time; where the logger wrote the time of receipt '
    'before each line (also as OpenRVDAS does), the time since is added.',
    score=_score,
    read=_open,
    options=(
        DATE,
        TRANSDUCER,
        Option(
            '--no-checksum',
            '',
            'take sentences without a checksum too; one that is there must be right',
        ),
    ),
)
