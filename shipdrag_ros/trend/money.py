# SPDX-License-Identifier: Apache-2.0
"""
When cleaning pays.

Added resistance grows by g a year and costs c a year for each unit of it; a cleaning
costs C and brings the hull back to where the last one left it. The mean cost a year is
least where the hull is cleaned as soon as the added resistance since the last cleaning
reaches sqrt(2 C g / c): the rule of optimal replacement under linear wear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.ship.sections import Economics
from shipdrag_ros.trend.hull_state import Mixture

_DRAWS, _SEED = 4000, 1
_SURE = 0.9  # of growth: with less no date is given
_FARTHEST_YEARS = 5.0
_WIDEST_YEARS = 3.0


@dataclass(frozen=True)
class CleaningDate:
    """
    When cleaning pays, years from now; 80 % of what is likely lies in the interval.

    Attributes
    ----------
    years, earliest, latest
        0 where it pays already.
    """

    years: float
    earliest: float
    latest: float


def usd_per_year(economics: Economics, force_n: float, speed_m_s: float) -> float:
    """
    Return what overcoming a force costs in a year.

    Parameters
    ----------
    economics
        Prices and efficiencies.
    force_n
        Added resistance [N].
    speed_m_s
        Service speed [m/s].
    """
    return fuel_t_per_day(economics, force_n * speed_m_s / 1000.0) * (
        economics.fuel_usd_per_t * economics.days_at_sea_per_year
    )


def fuel_t_per_day(economics: Economics, effective_kw: float) -> float:
    """
    Return the fuel that effective power takes in a day at sea [t].
    """
    return effective_kw / economics.propulsive_efficiency * economics.sfoc_g_per_kwh * 24.0e-6


def cleaning_date(
    economics: Economics, usd_per_unit: float, since_cleaning: Mixture, growth: Mixture
) -> CleaningDate | None:
    """
    Return when cleaning pays, or None where the data cannot carry a date.

    Parameters
    ----------
    economics
        With the price of a cleaning.
    usd_per_unit
        Cost of an added resistance of 1 [USD a year].
    since_cleaning
        Added resistance since the last cleaning, now.
    growth
        Of it, per year.
    """
    rng = np.random.default_rng(_SEED)
    added = rng.normal(since_cleaning.value[0], since_cleaning.sd[0], _DRAWS)
    rate = rng.normal(growth.value[0], growth.sd[0], _DRAWS)
    if np.mean(rate > 0.0) < _SURE or usd_per_unit <= 0.0:
        return None
    rate = np.maximum(rate, 1e-4)
    due = np.sqrt(2.0 * economics.cleaning_usd * rate / usd_per_unit)
    years = np.clip((due - added) / rate, 0.0, 100.0)
    earliest, middle, latest = (float(each) for each in np.quantile(years, (0.1, 0.5, 0.9)))
    if middle > _FARTHEST_YEARS or latest - earliest > _WIDEST_YEARS:
        return None
    return CleaningDate(middle, earliest, latest)
