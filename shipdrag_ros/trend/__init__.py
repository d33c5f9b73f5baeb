# SPDX-License-Identifier: Apache-2.0
"""Added resistance over months: growth, cleanings, and which hull comes first."""

from shipdrag_ros.trend.ship_trend import ShipTrend as ShipTrend
from shipdrag_ros.trend.ship_trend import fleet_trends as fleet_trends
