# SPDX-License-Identifier: Apache-2.0
"""
Signal K deltas: the same figures for whatever else on board reads that format.

Own figures have paths of their own below `performance.shipdrag`; the speed has
the path that every instrument knows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from shipdrag_ros import __version__
from shipdrag_ros.live.bridge import Bridge

SOURCE = {'label': 'shipdrag', 'type': 'shipdrag_ros'}
UNITS = {
    'navigation.speedThroughWater': 'm/s',
    'performance.shipdrag.specificResistance': 'm/s2',
    'performance.shipdrag.resistance': 'N',
    'performance.shipdrag.effectivePower': 'W',
    'performance.shipdrag.overCleanHull': 'ratio',
}
_ALARMS = {'good': 'normal', 'watch': 'normal', 'act': 'alert', 'bad': 'warn'}


def hello() -> dict[str, Any]:
    """
    Return the message that opens a stream.
    """
    return {
        'name': 'shipdrag_ros',
        'version': __version__,
        'self': 'vessels.self',
        'roles': ['master'],
        'timestamp': _time(datetime.now(UTC).timestamp()),
    }


def deltas(bridge: Bridge, now_s: float) -> list[dict[str, Any]]:
    """
    Return the latest figures and the state as deltas; none before there are any.

    Parameters
    ----------
    now_s
        On the clock of the bridge.
    """
    if not bridge.now_ns:
        return []
    parts = bridge.parts(now_s)
    figures, said = parts['figures'], parts['headline']
    assert isinstance(figures, dict)
    assert isinstance(said, dict)
    values: dict[str, Any] = {'navigation.speedThroughWater': figures['speed_m_s']}
    ship, r = bridge.ship, bridge.resistance
    if r is not None:
        values['performance.shipdrag.specificResistance'] = r.value
    usual = figures.get('usual')
    if usual is not None and ship is not None:
        force_n = usual['r'] * ship.mass_kg
        values['performance.shipdrag.resistance'] = force_n
        values['performance.shipdrag.effectivePower'] = force_n * usual['speed_m_s']
        values['performance.shipdrag.overCleanHull'] = usual.get('over_clean')
    notice = {
        'state': _ALARMS[said['tone']],
        'method': ['visual'],
        'message': f'{said["text"]}. {said["action"]}',
    }
    time = _time(bridge.now_ns * 1e-9)
    # apart: signalk-server names itself as the source of all that stands beside a notification
    groups = (_values(values), _values({'notifications.performance.shipdrag': notice}))
    return [
        {
            'context': 'vessels.self',
            'updates': [{'source': SOURCE, 'timestamp': time, 'values': each}],
        }
        for each in groups
        if each
    ]


def units() -> dict[str, Any]:
    """
    Return the delta that says in which unit each figure is.
    """
    meta = [{'path': path, 'value': {'units': unit}} for path, unit in UNITS.items()]
    return {'context': 'vessels.self', 'updates': [{'source': SOURCE, 'meta': meta}]}


def _values(values: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [{'path': path, 'value': value} for path, value in values.items() if _is_known(value)]


def _is_known(value: object) -> bool:
    return value is not None and not (isinstance(value, float) and not math.isfinite(value))


def _time(seconds: float) -> str:
    moment = datetime.fromtimestamp(seconds, UTC)
    return moment.strftime('%Y-%m-%dT%H:%M:%S.') + f'{moment.microsecond // 1000:03d}Z'
