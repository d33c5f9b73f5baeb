# SPDX-License-Identifier: Apache-2.0
"""A coastdown as its instruments read it, in their sds; values of a ship file to change."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipdrag_ros.errors import SensitivityError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import (
    AddedMass,
    CoefficientBaseline,
    ConstantAddedMass,
    Ship,
    StatedEffect,
    TableAddedMass,
    TableBaseline,
)
from shipdrag_ros.simulation import STANDARD_SD, Action, Scenario, simulate_columns

_Change = Callable[[Ship, float], Ship]


@dataclass(frozen=True)
class Particular:
    """
    A value of a ship file.

    Attributes
    ----------
    key
        With its section.
    value
        NaN where it is more than one number.
    sd
        Stated standard deviation, relative to the value; NaN: none is stated.
    scaled
        From a ship and a factor to the ship with this value so many times as
        large.
    """

    key: str
    value: float
    sd: float
    scaled: _Change


def particulars(ship: Ship, *, speed_m_s: float) -> tuple[Particular, ...]:
    """
    List the values that act in a coastdown; what is 0 or not given is left out.

    Parameters
    ----------
    ship
        With a baseline.
    speed_m_s
        At which the uncertainty of n_r is made a relative one.
    """
    return tuple(one for one in _listed(ship, speed_m_s) if one.value != 0.0)


def _listed(ship: Ship, speed_m_s: float) -> Iterator[Particular]:
    base = ship.baseline
    yield _field('length_m', ship)
    yield _field('displaced_volume_m3', ship)
    if isinstance(base, CoefficientBaseline):
        yield _field('wetted_surface_m2', ship)
    yield _field('density_kg_m3', ship, section='water')
    if isinstance(base, CoefficientBaseline):
        yield _field('kinematic_viscosity_m2_s', ship, section='water')
    n_r = float(ship.n_r(speed_m_s))
    # where coastdowns have shown the retardation, the error of n_r is no part of it
    counts = base is None or base.relative_sd_of == 'resistance'
    yield Particular(
        'added_mass', n_r, ship.added_mass.sd / n_r if counts else np.nan, _added_mass
    )
    if ship.air is not None:
        yield _field('frontal_area_m2', ship, section='air')
        yield _field('drag_coefficient', ship, section='air')
    if ship.propulsion is not None and ship.propulsion.run_down_s > 0.0:
        sd = ship.propulsion.sd / ship.propulsion.run_down_s
        yield _field('run_down_s', ship, section='propulsion', sd=sd or np.nan)
    if isinstance(base, CoefficientBaseline):
        yield _field('form_factor', ship, section='baseline')
        yield _field('correlation_allowance', ship, section='baseline')
        yield Particular('baseline.C_V', np.nan, base.relative_sd.friction, _viscous)
        if any(base.wave_coefficient):
            wave = base.relative_sd.wave
            yield _field('wave_coefficient', ship, section='baseline', sd=wave)
    elif isinstance(base, TableBaseline):
        yield _field('resistance_n', ship, section='baseline', sd=base.relative_sd)
    for effect in ship.effects:
        for name, stated in effect.parameters.items():
            sd = stated.sd / abs(stated.value) if stated.sd and stated.value else np.nan
            key = f'effects.{effect.name}.{name}'
            yield Particular(key, stated.value, sd, _effect(effect.name, name))


def _field(name: str, ship: Ship, *, section: str = '', sd: float = np.nan) -> Particular:
    """Return a number of the ship or of a section of hers, or all numbers of a table there."""

    def scaled(changed: Ship, factor: float) -> Ship:
        if not section:
            return replace(changed, **{name: factor * getattr(changed, name)})
        part: Any = getattr(changed, section)
        value = getattr(part, name)
        if isinstance(value, tuple):
            value = tuple(factor * each for each in value)
        else:
            value *= factor
        return replace(changed, **{section: replace(part, **{name: value})})

    value = getattr(getattr(ship, section) if section else ship, name)
    key = f'{section}.{name}' if section else name
    return Particular(key, np.nan if isinstance(value, tuple) else float(value), sd, scaled)


def _added_mass(ship: Ship, factor: float) -> Ship:
    model = ship.added_mass
    changed: AddedMass
    if isinstance(model, ConstantAddedMass):
        changed = replace(model, value=factor * model.value)
    else:
        rows = tuple(tuple(factor * c for c in row) for row in model.coefficients)
        changed = TableAddedMass(coefficients=rows, sd=model.sd)
    return replace(ship, added_mass=changed)


def _viscous(ship: Ship, factor: float) -> Ship:
    base = ship.baseline
    assert isinstance(base, CoefficientBaseline)
    changed = replace(
        base,
        form_factor=factor * (1.0 + base.form_factor) - 1.0,
        correlation_allowance=factor * base.correlation_allowance,
    )
    return replace(ship, baseline=changed)


def _effect(name: str, parameter: str) -> _Change:
    def scaled(ship: Ship, factor: float) -> Ship:
        return replace(ship, effects=tuple(_stated(one, factor) for one in ship.effects))

    def _stated(effect: StatedEffect, factor: float) -> StatedEffect:
        if effect.name != name:
            return effect
        stated = effect.parameters[parameter]
        values = {**effect.parameters, parameter: Parameter(factor * stated.value, stated.sd)}
        return replace(effect, parameters=values)

    return scaled


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
