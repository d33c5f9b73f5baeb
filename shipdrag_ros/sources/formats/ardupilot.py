# SPDX-License-Identifier: Apache-2.0
"""
GPS, POS, ATT, ESC and RPM: position, speed over ground, heading, revolutions. Needs
pymavlink: pip install 'shipdrag_ros[logs]'.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager, redirect_stdout
from io import StringIO
from math import pi, radians
from typing import Any

from shipdrag_ros.errors import reason_of
from shipdrag_ros.samples import SHAFTS, Channel
from shipdrag_ros.sources.format import CERTAIN, NO, Job, missing_library
from shipdrag_ros.sources.log import BASE_NS, DATE_FROM_NS, UNDATED, Tally
from shipdrag_ros.sources.stream import Origin, Reading, stream_format, yaw

# a message begins with A3 95, the first one defines the definitions (type 80)
_MAGIC = b'\xa3\x95\x80\x80'
_TYPES = ['GPS', 'POS', 'ATT', 'ESC', 'RPM']
_FIX = 3


def _read(job: Job, tally: Tally) -> Iterator[Reading]:
    try:
        from pymavlink.DFReader import DFReader_binary
    except ModuleNotFoundError:
        raise missing_library(job, 'a log of ArduPilot', 'pymavlink') from None
    found: list[Reading] = []
    try:
        with (
            redirect_stdout(StringIO()),
            _silence(),
            closing(DFReader_binary(str(job.source))) as stored,
        ):
            found.extend(_readings(stored, tally))
    except Exception as error:  # the parser raises what a damaged byte happens to raise
        tally.note(f'The log could not be read to its end: {reason_of(error)}.')
    yield from found


@contextmanager
def _silence() -> Iterator[None]:
    """Keep from stderr what the compiled part of the reader writes there of each bad header."""
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _readings(log: Any, tally: Tally) -> Iterator[Reading]:
    while (message := log.recv_match(type=_TYPES)) is not None:
        tally.records += 1
        stamp_ns = round(float(message._timestamp) * 1e6) * 1000
        if stamp_ns < DATE_FROM_NS:
            stamp_ns += BASE_NS
            tally.note(UNDATED)
        fields = message.to_dict()
        for channel, rank, name, a, b in _values(fields):
            yield Reading(channel, Origin(rank, name), stamp_ns, a, b)


def _values(fields: dict[str, Any]) -> Iterator[tuple[Channel, int, str, float, float]]:
    kind = fields['mavpackettype']
    number = int(fields.get('I', fields.get('Instance', 0)) or 0)
    name = f'{kind} {number}' if number else kind
    if kind == 'GPS' and fields.get('Status', 0) >= _FIX:
        yield Channel.POSITION_GEODETIC, number, name, float(fields['Lat']), float(fields['Lng'])
        yield Channel.SPEED_OVER_GROUND, number, name, float(fields['Spd']), 0.0
    elif kind == 'POS':
        yield Channel.POSITION_GEODETIC, 10, name, float(fields['Lat']), float(fields['Lng'])
    elif kind == 'ATT':
        yield Channel.HEADING, 0, name, yaw(radians(float(fields['Yaw']))), 0.0
    elif kind == 'ESC' and number < len(SHAFTS):
        yield SHAFTS[number], 0, name, float(fields['RPM']) * pi / 30.0, 0.0
    elif kind == 'RPM':
        for place, key in enumerate(('rpm1', 'rpm2')):
            if key in fields:
                yield SHAFTS[place], 1, f'{name} {key}', float(fields[key]) * pi / 30.0, 0.0


FORMAT = stream_format(
    name='ardupilot',
    kind='a log of ArduPilot (.bin)',
    about=__doc__,
    score=lambda head: CERTAIN if head.raw.startswith(_MAGIC) else NO,
    read=_read,
)
