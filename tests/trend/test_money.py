# SPDX-License-Identifier: Apache-2.0
"""When cleaning pays, against the cost of every date."""

import numpy as np
import pytest

from shipdrag_ros.ship.sections import Economics
from shipdrag_ros.trend.hull_state import Mixture
from shipdrag_ros.trend.ship_trend import cleaning_date, fuel_t_per_day, usd_per_year

PRICES = Economics(
    fuel_usd_per_t=600.0,
    sfoc_g_per_kwh=180.0,
    propulsive_efficiency=0.6,
    days_at_sea_per_year=240.0,
    cleaning_usd=30_000.0,
)


def known(value, sd):
    return Mixture(np.array([value]), np.array([sd]))


def test_fuel_and_money():
    # 600 kW effective are 1000 kW brake: 180 kg an hour
    assert fuel_t_per_day(PRICES, 600.0) == pytest.approx(4.32)
    assert usd_per_year(PRICES, 100_000.0, 6.0) == pytest.approx(4.32 * 600.0 * 240.0)


def test_the_date_is_the_one_of_least_cost_a_year():
    per_unit, growth = 1.0e6, 0.1
    found = cleaning_date(PRICES, per_unit, known(0.0, 1e-6), known(growth, 1e-6))
    interval = np.linspace(0.2, 3.0, 2000)
    cost = (PRICES.cleaning_usd + 0.5 * per_unit * growth * interval**2) / interval
    assert found.years == pytest.approx(interval[cost.argmin()], abs=0.01)


def test_what_is_due_is_due_now():
    found = cleaning_date(PRICES, 1.0e6, known(0.4, 0.01), known(0.1, 0.01))
    assert (found.years, found.latest) == (0.0, 0.0)


@pytest.mark.parametrize('growth', [known(0.05, 0.1), known(-0.05, 0.01), known(0.002, 0.0005)])
def test_no_date_where_the_data_cannot_carry_one(growth):
    assert cleaning_date(PRICES, 1.0e6, known(0.0, 0.02), growth) is None
