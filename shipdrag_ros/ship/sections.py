# SPDX-License-Identifier: Apache-2.0
"""Small sections of the ship file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from shipdrag_ros.fields import choice, declare, named, number, section, text
from shipdrag_ros.parameter import Parameter

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class Water:
    """
    Water that the ship sails in; sea water at 15 degrees by default.
    """

    density_kg_m3: float = declare(number(900.0, 1100.0, 'kg/m^3'), 'density', default=1025.0)
    kinematic_viscosity_m2_s: float = declare(
        number(5e-7, 3e-6, 'm^2/s'), 'kinematic viscosity', default=1.19e-6
    )


@dataclass(frozen=True)
class Air:
    """
    Above-water ship, for the air drag along it.
    """

    frontal_area_m2: float = declare(number(1e-3, 1e4, 'm^2'), 'frontal area above water')
    drag_coefficient: float = declare(number(0.05, 2.0), 'drag coefficient on that area')


@dataclass(frozen=True)
class Propeller:
    """
    Propeller, and how it is while coasting.
    """

    diameter_m: float = declare(number(0.01, 15.0, 'm'), 'diameter')
    state_in_baseline: str = declare(
        choice('free', 'locked', 'none'), 'what the baseline contains'
    )


@dataclass(frozen=True)
class Propulsion:
    """
    How thrust and shaft speed decay after the stop: exp(-t / run_down_s).
    """

    run_down_s: float = declare(number(0.0, 600.0, 's'), 'time constant; 0: at once')
    sd: float = declare(number(0.0, 600.0, 's'), 'standard deviation of it', default=0.0)


@dataclass(frozen=True)
class StatedEffect:
    """
    An effect added to the baseline, as a diagnosis writes it.
    """

    name: str = declare(text(), 'which effect')
    parameters: Mapping[str, Parameter] = declare(
        named(section(Parameter, required=('value', 'sd'))), 'its parameters', hashed=False
    )


@dataclass(frozen=True)
class Economics:
    """
    Prices and efficiencies, by which a trend says what fouling costs and when cleaning pays.
    """

    fuel_usd_per_t: float = declare(number(1.0, 1e5, 'USD/t'), 'price of the fuel')
    sfoc_g_per_kwh: float = declare(number(50.0, 1000.0, 'g/kWh'), 'fuel for a brake kWh')
    propulsive_efficiency: float = declare(number(0.05, 1.0), 'effective power over brake power')
    days_at_sea_per_year: float = declare(number(0.0, 366.0, 'd'), 'days under way in a year')
    cleaning_usd: float = declare(
        number(0.0, 1e8, 'USD'), 'price of a cleaning, off-hire included'
    )
    service_speed_m_s: float | None = declare(
        number(0.1, 40.0, 'm/s'), 'speed at which runs are compared', default=None
    )
