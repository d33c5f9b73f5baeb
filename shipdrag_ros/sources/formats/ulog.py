# SPDX-License-Identifier: Apache-2.0
"""ULog of PX4 vessels, read by pyulog, an extra."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from math import pi, remainder
from typing import Any

import numpy as np

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import SHAFTS, Channel, Float64
from shipdrag_ros.sources.format import CERTAIN, NO, Format, Head, Job, missing_library
from shipdrag_ros.sources.log import Log
from shipdrag_ros.sources.stream import Origin, Reading, StreamResult, Tally, read_stream

_MAGIC = b'ULog\x01\x12\x35'
_BASE_NS = 946_684_800 * 10**9  # 2000-01-01, for a log that never had a fix
_LIMIT_BYTES = 2 << 30  # pyulog holds the whole log in memory
_TOPICS = (
    'vehicle_gps_position',
    'sensor_gps',
    'vehicle_global_position',
    'vehicle_attitude',
    'esc_status',
)
_GPS = _TOPICS[:2]
_FIX = 3


def _score(head: Head) -> float:
    return CERTAIN if head.raw.startswith(_MAGIC) else NO


def _open(job: Job, log: Log) -> StreamResult:
    try:
        from pyulog import ULog
    except ModuleNotFoundError:
        raise missing_library(job, 'an ULog', 'pyulog') from None
    if job.source.stat().st_size > _LIMIT_BYTES:
        raise ImportDataError(
            f'{str(job.source)!r} has more than {_LIMIT_BYTES >> 30} GiB; cut it into parts'
        )
    try:
        with redirect_stdout(StringIO()):  # it prints what it finds
            found = ULog(str(job.source), list(_TOPICS), True)
    except Exception as error:  # the parser raises what a damaged byte happens to raise
        raise ImportDataError(
            f'{str(job.source)!r} is an ULog that cannot be read: {error or type(error).__name__}'
        ) from error

    def read(tally: Tally) -> Iterator[Reading]:
        try:
            readings = list(_read(found, tally))
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            # definitions that are damaged name other columns
            raise ImportDataError(
                f'{str(job.source)!r} is an ULog whose definitions are damaged: {error!r}'
            ) from error
        yield from readings

    return read_stream(job, log, 'ulog', read)


def _read(log: Any, tally: Tally) -> Iterator[Reading]:
    """Yield the readings of all topics by time."""
    epoch_us = _epoch_us(log)
    if epoch_us is None:
        tally.note('The log has no fix that gives the date; its times count from 2000-01-01.')
    found: list[Reading] = []
    for data in log.data_list:
        name = data.name if data.multi_id == 0 else f'{data.name} {data.multi_id}'
        columns = {key: np.asarray(value) for key, value in data.data.items()}
        times = columns.get('timestamp')
        if times is None:
            continue
        tally.records += len(times)
        base_ns = _BASE_NS if epoch_us is None else epoch_us * 1000
        stamps = [int(each) * 1000 + base_ns for each in times.tolist()]
        for channel, a, b in _values(data.name, columns):
            origin = Origin(_TOPICS.index(data.name), name)
            found += [
                Reading(channel, origin, stamp_ns, one, two)
                for stamp_ns, one, two in zip(stamps, a.tolist(), b.tolist(), strict=True)
                if np.isfinite(one) and np.isfinite(two)
            ]
    yield from sorted(found, key=lambda reading: reading.stamp_ns)


def _epoch_us(log: Any) -> int | None:
    """Return the date of time 0 [us], of the first fix that gives one."""
    for data in log.data_list:
        utc = data.data.get('time_utc_usec')
        if data.name in _GPS and utc is not None:
            known = np.flatnonzero(np.asarray(utc) > 10**15)
            if len(known):
                return int(utc[known[0]]) - int(data.data['timestamp'][known[0]])
    return None


def _values(name: str, columns: dict[str, Any]) -> Iterator[tuple[Channel, Float64, Float64]]:
    if name in _GPS and 'fix_type' in columns:
        fixed = np.where(columns['fix_type'] >= _FIX, 1.0, np.nan)
        if 'latitude_deg' in columns:
            latitude, longitude = columns['latitude_deg'] * fixed, columns['longitude_deg'] * fixed
            yield Channel.POSITION_GEODETIC, latitude, longitude
        elif 'lat' in columns and columns['lat'].dtype.kind == 'i':
            yield (
                Channel.POSITION_GEODETIC,
                columns['lat'] * 1e-7 * fixed,
                columns['lon'] * 1e-7 * fixed,
            )
        if 'vel_m_s' in columns:
            speed = columns['vel_m_s'].astype(np.float64) * fixed
            yield Channel.SPEED_OVER_GROUND, speed, np.zeros(len(speed))
    elif name == 'vehicle_global_position' and 'lat' in columns:
        latitude, longitude = columns['lat'], columns['lon']
        if latitude.dtype.kind == 'f':
            yield Channel.POSITION_GEODETIC, latitude, longitude
    elif name == 'vehicle_attitude' and 'q[3]' in columns:
        w, x, y, z = (columns[f'q[{k}]'].astype(np.float64) for k in range(4))
        # from north, clockwise; REP-103 counts from east and the other way
        north = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        yaw = np.array([remainder(pi / 2.0 - each, 2.0 * pi) for each in north])
        yield Channel.HEADING, yaw, np.zeros(len(yaw))
    elif name == 'esc_status':
        for place, channel in enumerate(SHAFTS):
            if (rpm := columns.get(f'esc[{place}].esc_rpm')) is not None:
                yield channel, rpm * pi / 30.0, np.zeros(len(rpm))


FORMAT = Format(
    name='ulog',
    kind='an ULog (PX4)',
    about='GNSS position and speed, position of the estimator, heading, revolutions of motors. '
    "Needs pyulog: pip install 'shipdrag_ros[logs]'.",
    score=_score,
    read=_open,
)
