# SPDX-License-Identifier: Apache-2.0
"""A coastdown as its instruments read it, in their standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.errors import SensitivityError
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import STANDARD_SD, Action, Scenario, simulate_columns

KIND = 'coastdown'
LOG_SD_M_S = STANDARD_SD[Channel.SPEED_THROUGH_WATER]
POSITION_SD_M = STANDARD_SD[Channel.POSITION]
SPEED_FRACTION = 0.7  # of the highest that the baseline reaches: room for a ship half as long
SLOWED = 0.35  # part of the speed at which the record ends, if nothing ends it before
FROUDE_MIN = 0.05
_ABOVE = 1.1  # times the lowest speed of the baseline
_LEAST = 0.9  # part of the speed that a record ends at, or is too short
_LEAD_IN_S = 300.0
_SAMPLES = 400  # from the stop on
_LONGEST_S = 6 * 3600.0


@dataclass(frozen=True)
class Coast:
    """
    A coastdown of a ship, as it is read.

    Attributes
    ----------
    scenario
    time_s : (n,)
        Of the record, the steady part included.
    """

    scenario: Scenario
    time_s: Float64

    @property
    def name(self) -> str:
        """As `parse_coast` reads it."""
        return f'{KIND}:{self.scenario.speed_m_s:.4g}'

    @property
    def after_stop(self) -> slice:
        """The samples from the stop on."""
        return slice(int(np.searchsorted(self.time_s, self.scenario.lead_in_s)), None)

    def read(
        self, ship: Ship, actions: Sequence[Action], *, speed_m_s: float | None = None
    ) -> Float64:
        """
        Return what log and positions read (k, n, 3), in their standard deviations.

        Log, place ahead and place abeam of where the record begins; NaN where
        the simulation leaves the baseline's table. `speed_m_s` before the stop
        is the scenario's by default.
        """
        speed = self.scenario.speed_m_s if speed_m_s is None else speed_m_s
        columns = simulate_columns(
            ship,
            self.scenario,
            actions,
            self.time_s,
            speed_m_s=np.full(len(actions), speed),
        )
        place = columns.radar_position_m / POSITION_SD_M
        return np.concatenate([columns.log_m_s[..., None] / LOG_SD_M_S, place], axis=-1)


def coast_from(ship: Ship, speed_m_s: float | None = None) -> Coast:
    """
    Return the coastdown from a speed down to a third of it, if it may go so far.

    Parameters
    ----------
    ship
        With a baseline.
    speed_m_s
        `SPEED_FRACTION` of the highest of the baseline by default.

    Raises
    ------
    ShipdragError
        If the ship has no baseline.
    SensitivityError
        If it is not within the baseline, or too low to slow down from.
    """
    low, high = slowest_m_s(ship), ship.baseline_range_m_s[1]
    speed = SPEED_FRACTION * high if speed_m_s is None else speed_m_s
    # written so that NaN fails
    if not low <= speed <= high:
        raise SensitivityError(
            f'the coastdown begins at {speed:.4g} m/s, expected {low:.4g}..{high:.4g} m/s: within '
            f'the baseline, and room to slow down above Froude number {FROUDE_MIN:g}'
        )
    speeds = np.linspace(max(SLOWED * speed, _LEAST * low), speed, 200)
    slowness = ship.mass_kg * (1.0 + ship.n_r(speeds)) / ship.resistance_n(speeds)
    duration = float(np.trapezoid(slowness, speeds))
    if ship.propulsion is not None:
        duration += ship.propulsion.run_down_s
    duration = min(duration, _LONGEST_S)
    scenario = Scenario(speed_m_s=speed, lead_in_s=_LEAD_IN_S, duration_s=duration)
    step = duration / (_SAMPLES - 1)
    steady = np.arange(0.0, _LEAD_IN_S, step)
    return Coast(
        scenario, np.concatenate([steady, np.linspace(_LEAD_IN_S, scenario.length_s, _SAMPLES)])
    )


def slowest_m_s(ship: Ship) -> float:
    """
    Return the lowest speed that a coastdown may begin at.
    """
    low = ship.baseline_range_m_s[0]
    return max(_ABOVE * low, float(ship.speed(FROUDE_MIN))) / _LEAST


def parse_coast(ship: Ship, text: str) -> Coast:
    """
    Read `coastdown` or `coastdown:8.2`, the speed before the stop in m/s.

    Raises
    ------
    SensitivityError
        If it is neither, or the speed is not possible.
    ShipdragError
        If the ship has no baseline.
    """
    kind, separator, size = text.partition(':')
    try:
        speed = float(size) if separator else None
    except ValueError:
        kind = ''
    if kind != KIND:
        raise SensitivityError(
            f'manoeuvre {text!r}: the ship of a ship file coasts, expected {KIND} or '
            f'{KIND}:SPEED [m/s]; for zigzag and turn leave out --ship'
        )
    return coast_from(ship, speed)
