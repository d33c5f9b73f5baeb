# SPDX-License-Identifier: Apache-2.0
"""
Values of a ship file as numbers that can be changed, one at a time.

A list of coefficients, and what is known as a whole, is one value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import (
    AddedMass,
    CoefficientBaseline,
    ConstantAddedMass,
    Ship,
    StatedEffect,
    TableAddedMass,
    TableBaseline,
)

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
            yield Particular('baseline.wave_coefficient', np.nan, wave, _wave)
    elif isinstance(base, TableBaseline):
        yield Particular('baseline.resistance_n', np.nan, base.relative_sd, _table)
    for effect in ship.effects:
        for name, stated in effect.parameters.items():
            sd = stated.sd / abs(stated.value) if stated.sd and stated.value else np.nan
            key = f'effects.{effect.name}.{name}'
            yield Particular(key, stated.value, sd, _effect(effect.name, name))


def _field(name: str, ship: Ship, *, section: str = '', sd: float = np.nan) -> Particular:
    """Return a single number of the ship or of a section of hers."""

    def scaled(changed: Ship, factor: float) -> Ship:
        if not section:
            return replace(changed, **{name: factor * getattr(changed, name)})
        part: Any = getattr(changed, section)
        values = {name: factor * getattr(part, name)}
        return replace(changed, **{section: replace(part, **values)})

    holder = getattr(ship, section) if section else ship
    key = f'{section}.{name}' if section else name
    return Particular(key, float(getattr(holder, name)), sd, scaled)


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


def _wave(ship: Ship, factor: float) -> Ship:
    base = ship.baseline
    assert isinstance(base, CoefficientBaseline)
    values = tuple(factor * value for value in base.wave_coefficient)
    return replace(ship, baseline=replace(base, wave_coefficient=values))


def _table(ship: Ship, factor: float) -> Ship:
    base = ship.baseline
    assert isinstance(base, TableBaseline)
    values = tuple(factor * value for value in base.resistance_n)
    return replace(ship, baseline=replace(base, resistance_n=values))


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
