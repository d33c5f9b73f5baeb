# SPDX-License-Identifier: Apache-2.0
"""
GNSS position and speed, position of the estimator, heading, revolutions of motors. Needs
pyulog: pip install 'shipdrag_ros[logs]'.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros.errors import ImportDataError, reason_of
from shipdrag_ros.samples import SHAFTS, Channel, Float64
from shipdrag_ros.sources.format import CERTAIN, NO, Job, missing_library
from shipdrag_ros.sources.log import BASE_NS, UNDATED, Tally
from shipdrag_ros.sources.stream import Origin, Reading, stream_format, yaw

_MAGIC = b'ULog\x01\x12\x35'
_LIMIT_BYTES = 2 << 30  # pyulog holds the whole log in memory
_TOPICS = ['vehicle_gps_position', 'sensor_gps', 'vehicle_global_position', 'vehicle_attitude']
_TOPICS += ['esc_status']
_GPS = _TOPICS[:2]
_FIX = 3


def _read(job: Job, tally: Tally) -> Iterator[Reading]:
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
            found = ULog(str(job.source), _TOPICS, True)
    except Exception as error:  # the parser raises what a damaged byte happens to raise
        raise ImportDataError(
            f'{str(job.source)!r} is an ULog that cannot be read: {reason_of(error)}'
        ) from error
    try:
        with np.errstate(invalid='ignore'):  # a damaged number is rejected as what it is
            readings = _readings(found, tally)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        # definitions that are damaged name other columns
        raise ImportDataError(
            f'{str(job.source)!r} is an ULog whose definitions are damaged: {error!r}'
        ) from error
    yield from readings


def _readings(log: Any, tally: Tally) -> list[Reading]:
    """Return the readings of all topics by time."""
    base_ns = _base_ns(log)
    if base_ns == BASE_NS:
        tally.note(UNDATED)
    found: list[Reading] = []
    for data in log.data_list:
        columns = {key: np.asarray(value) for key, value in data.data.items()}
        if 'timestamp' not in columns:
            continue
        stamps = [int(each) * 1000 + base_ns for each in columns['timestamp'].tolist()]
        tally.records += len(stamps)
        name = data.name if data.multi_id == 0 else f'{data.name} {data.multi_id}'
        origin = Origin(_TOPICS.index(data.name), name)
        for channel, a, b in _values(data.name, columns):
            values = zip(stamps, *np.broadcast_arrays(a, b), strict=True)
            found += [
                Reading(channel, origin, stamp_ns, float(one), float(two))
                for stamp_ns, one, two in values
                if np.isfinite(one) and np.isfinite(two)
            ]
    return sorted(found, key=lambda reading: reading.stamp_ns)


def _base_ns(log: Any) -> int:
    """Return the date of time 0, of the first fix that gives one."""
    for data in log.data_list:
        utc = np.asarray(data.data.get('time_utc_usec', ())) if data.name in _GPS else np.empty(0)
        known = np.flatnonzero(utc > 10**15)
        if len(known):
            return 1000 * (int(utc[known[0]]) - int(data.data['timestamp'][known[0]]))
    return BASE_NS


def _values(name: str, columns: dict[str, Any]) -> Iterator[tuple[Channel, Float64, ArrayLike]]:
    if name in _GPS and 'fix_type' in columns:
        fixed = np.where(columns['fix_type'] >= _FIX, 1.0, np.nan)
        if 'latitude_deg' in columns:
            where = columns['latitude_deg'] * fixed, columns['longitude_deg'] * fixed
            yield Channel.POSITION_GEODETIC, *where
        elif 'lat' in columns and columns['lat'].dtype.kind == 'i':
            where = columns['lat'] * 1e-7 * fixed, columns['lon'] * 1e-7 * fixed
            yield Channel.POSITION_GEODETIC, *where
        if 'vel_m_s' in columns:
            yield Channel.SPEED_OVER_GROUND, columns['vel_m_s'].astype(np.float64) * fixed, 0.0
    elif name == 'vehicle_global_position' and 'lat' in columns:
        if columns['lat'].dtype.kind == 'f':
            yield Channel.POSITION_GEODETIC, columns['lat'], columns['lon']
    elif name == 'vehicle_attitude' and 'q[3]' in columns:
        w, x, y, z = (columns[f'q[{k}]'].astype(np.float64) for k in range(4))
        # from north, clockwise; REP-103 counts from east and the other way
        north = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        yield Channel.HEADING, np.array([*map(yaw, north)]), 0.0
    elif name == 'esc_status':
        for place, channel in enumerate(SHAFTS):
            if (rpm := columns.get(f'esc[{place}].esc_rpm')) is not None:
                yield channel, rpm * pi / 30.0, 0.0


FORMAT = stream_format(
    name='ulog',
    kind='an ULog (PX4)',
    about=__doc__,
    score=lambda head: CERTAIN if head.raw.startswith(_MAGIC) else NO,
    read=_read,
)
