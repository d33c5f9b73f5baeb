# SPDX-License-Identifier: Apache-2.0
"""What `shipdrag trend --json` writes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from shipdrag_ros import display
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.trend import ShipTrend


def document(trends: Sequence[ShipTrend], skipped: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """
    Return the document.

    Parameters
    ----------
    trends
        In the order of their rank.
    skipped
        Bag and reason of what the fleet could not use.
    """
    return {
        'ships': [_ship(trend) for trend in trends],
        'skipped': [{'bag': bag, 'reason': reason} for bag, reason in skipped],
    }


def _ship(trend: ShipTrend) -> dict[str, Any]:
    series = trend.series
    now = _value(trend.now)
    if now is not None:
        now['power_kw'] = _value(trend.power_kw)
    cleaning = trend.cleaning_from_ns
    return {
        'name': series.name,
        'coastdowns': len(series.points),
        'reference_speed_m_s': series.reference_speed_m_s,
        'clean_hull': series.clean,
        'added_resistance': [
            {
                'time_ns': point.time_ns,
                'bag': point.bag,
                'value': point.value,
                'sd': point.sd,
                'used': point.used,
                'reason': point.reason,
            }
            for point in trend.points
        ],
        'growth_per_year': _value(trend.growth_per_year),
        'now': now,
        'events': [
            {
                'time_ns': event.time_ns,
                'kind': event.kind,
                'known': event.known,
                'probability': event.probability,
                'change': _value(event.change),
            }
            for event in trend.events
        ],
        'costs': None
        if trend.costs is None
        else {name: _value(figure) for name, figure in vars(trend.costs).items()},
        'cleaning_pays_from': None if cleaning is None else display.day(cleaning),
        'scatter': trend.scatter,
        'rank': trend.rank,
        'notes': list(trend.notes),
    }


def _value(found: Parameter | None) -> dict[str, Any] | None:
    return None if found is None else {'value': found.value, 'sd': found.sd}
