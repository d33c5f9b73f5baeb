# SPDX-License-Identifier: Apache-2.0
"""Added resistance over months: growth, cleanings, and which hull comes first."""

from shipdrag_ros.trend.ship_trend import ShipTrend, fleet_trends

__all__ = [
    'ShipTrend',
    'fleet_trends',
]
