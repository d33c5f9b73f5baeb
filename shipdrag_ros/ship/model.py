# SPDX-License-Identifier: Apache-2.0
"""
The ship: what the ship file says, what follows from it, and where a run of hers differs.

Particulars are checked against each other. A length in feet or a volume in tonnes is a
plausible number by itself; beside the other particulars it is not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, replace
from functools import cached_property
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike

from shipdrag_ros import strict_yaml
from shipdrag_ros.display import LIGHT_KG
from shipdrag_ros.errors import ShipdragError, ShipFileError
from shipdrag_ros.fields import (
    declare,
    keys_of,
    list_of,
    number,
    parse,
    plain,
    read_keys,
    section,
    text,
    text_of,
)
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship.facts import Fact, fact_list, overriding
from shipdrag_ros.ship.sections import (
    GRAVITY_M_S2,
    AddedMass,
    Air,
    Baseline,
    CoefficientBaseline,
    Economics,
    MerchantAddedMass,
    Propeller,
    Propulsion,
    StatedEffect,
    TableBaseline,
    Water,
    added_mass,
    baseline,
    ittc57,
    n_r_polynomial,
)
from shipdrag_ros.ship.term import LearntTerm, learnt_terms

SHIP_FILE = 'ship.yaml'
"""Attached to a bag, or beside it."""

SLENDERNESS = (2.0, 15.0)  # L / V^(1/3): car to racing shell
SLENDERNESS_MERCHANT = (4.0, 8.0)  # outside it the merchant n_r is meaningless
SLENDERNESS_MERCHANT_TRUSTED = (4.5, 7.0)
_FROUDE = np.linspace(0.0, 0.4, 41)  # of displacement ships, for the sign of n_r
ROPES = (0.01, 0.04)  # C0 of towed ropes in practice
USUAL_FORM_FACTOR = 0.2  # where the baseline is a table


def _inconsistencies(values: Mapping[str, Any]) -> Iterator[str]:
    """Check valid top-level values; those that are missing are not used."""
    length, volume = values.get('length_m'), values.get('displaced_volume_m3')
    yield from _section_lengths(values)
    if length is None or volume is None:
        return
    psi = length / float(np.cbrt(volume))
    if not SLENDERNESS[0] <= psi <= SLENDERNESS[1]:
        yield (
            f'length_m: {length!r} beside displaced_volume_m3: {volume!r} gives '
            f'L/V^(1/3) = {psi:.3g}, expected {SLENDERNESS[0]:g}..{SLENDERNESS[1]:g}; '
            'is the length in metres and the volume in cubic metres?'
        )
    else:
        yield from _added_mass(values, psi)
    yield from _proportions(values, length, volume)
    yield from _baseline(values, length, volume)


def _added_mass(values: Mapping[str, Any], psi: float) -> Iterator[str]:
    model = values.get('added_mass')
    if model is None:
        return
    low, high = SLENDERNESS_MERCHANT
    if isinstance(model, MerchantAddedMass) and not low <= psi <= high:
        yield (
            f'added_mass.model: merchant with L/V^(1/3) = {psi:.3g}, expected {low:g}..{high:g}; '
            'use {model: constant, value: ..., sd: ...}'
        )
    elif np.min(smallest := polyval(_FROUDE, n_r_polynomial(model, psi))) <= 0.0:
        yield (
            f'added_mass: n_r = {np.min(smallest):.3g} at Fr = '
            f'{_FROUDE[np.argmin(smallest)]:.2g}, expected n_r > 0 for Fr 0..0.4'
        )


def _proportions(values: Mapping[str, Any], length: float, volume: float) -> Iterator[str]:
    breadth, draught = values.get('breadth_m'), values.get('draught_m')
    surface = values.get('wetted_surface_m2')
    air, propeller = values.get('air'), values.get('propeller')
    if breadth is not None and not 1.0 <= length / breadth <= 20.0:
        expected = f'{length / 20:.3g}..{length:.3g} m'
        yield f'breadth_m: {breadth!r} beside length_m: {length!r}, expected {expected}'
    if breadth is not None and draught is not None:
        block = volume / (length * breadth * draught)
        if not 0.3 <= block <= 1.0:
            yield (
                f'draught_m: {draught!r}, breadth_m: {breadth!r}, length_m: {length!r} and '
                f'displaced_volume_m3: {volume!r} give a block coefficient of {block:.3g}, '
                'expected 0.3..1 (hull without keel fin; the hulls of a catamaran together)'
            )
    if surface is not None:
        usual = _usual_wetted_surface_m2(length, volume)
        if not 0.5 <= surface / usual <= 2.0:
            expected = f'{usual / 2:.4g}..{2 * usual:.4g} m^2 for this length and volume'
            yield f'wetted_surface_m2: {surface!r}, expected {expected}'
    if air is not None and air.frontal_area_m2 > length**2:
        yield (
            f'air.frontal_area_m2: {air.frontal_area_m2!r}, expected less than the square of '
            f'length_m, {length**2:.3g} m^2'
        )
    if propeller is not None and propeller.diameter_m > (limit := 1.2 * (draught or length)):
        yield f'propeller.diameter_m: {propeller.diameter_m!r}, expected at most {limit:.3g} m'


def _section_lengths(values: Mapping[str, Any]) -> Iterator[str]:
    base = values.get('baseline')
    if base is None:
        return
    is_table = isinstance(base, TableBaseline)
    names = ('speed_m_s', 'resistance_n') if is_table else ('wave_froude', 'wave_coefficient')
    points, table = (getattr(base, name) for name in names)
    if len(points) != len(table):
        yield (
            f'baseline.{names[1]}: {len(table)} values, expected {len(points)}, '
            f'one for each of {names[0]}'
        )
    elif is_table and points[0] == 0.0 and table[0] != 0.0:
        yield f'baseline.resistance_n[0]: {table[0]!r} at rest, expected 0'


def _baseline(values: Mapping[str, Any], length: float, volume: float) -> Iterator[str]:
    base = values.get('baseline')
    surface = values.get('wetted_surface_m2')
    if isinstance(base, CoefficientBaseline) and surface is None:
        yield (
            'wetted_surface_m2: missing, the coefficients of the baseline are on it; about '
            f'{_usual_wetted_surface_m2(length, volume):.3g} m^2 is usual for this hull'
        )
    if isinstance(base, TableBaseline) and 'water' in values:
        top, force = base.speed_m_s[-1], base.resistance_n[-1]
        area = surface or _usual_wetted_surface_m2(length, volume)
        total = force / (0.5 * values['water'].density_kg_m3 * area * top**2)
        if not 1e-5 <= total <= 0.5:
            yield (
                f'baseline.resistance_n[-1]: {force!r} at {top:g} m/s is a resistance '
                f'coefficient of {total:.2g}, expected 1e-5..0.5; are they N and m/s?'
            )


def _usual_wetted_surface_m2(length_m: float, displaced_volume_m3: float) -> float:
    """Return the wetted surface that such a hull usually has, C sqrt(V L) after Taylor."""
    return 2.6 * float(np.sqrt(displaced_volume_m3 * length_m))


AIR_DENSITY_KG_M3 = 1.225
_SIZES = ('length_m', 'displaced_volume_m3', 'breadth_m', 'draught_m', 'wetted_surface_m2')


@dataclass(frozen=True, kw_only=True)
class Ship:
    """
    A ship as its file states it.

    `load` and `from_yaml` check every value and whether they fit each other; constructing
    one directly only that sizes are above 0. Only the length and the volume are needed to
    estimate r(v); the baseline is needed to simulate.

    Raises
    ------
    ShipFileError
        Naming every size that is not above 0.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> coaster = sd.Ship(name='Coaster', length_m=80.0, displaced_volume_m3=4000.0)
    >>> coaster.summary()
    'Coaster: length 80 m, displacement 4000 m³ (4,100 t)'
    """

    name: str = declare(text(), 'name of the ship', default='')
    length_m: float = declare(number(0.5, 500.0, 'm'), 'waterline length')
    displaced_volume_m3: float = declare(number(1e-4, 1e6, 'm^3'), 'displaced volume')
    breadth_m: float | None = declare(number(0.05, 100.0, 'm'), 'waterline breadth', default=None)
    draught_m: float | None = declare(number(0.01, 40.0, 'm'), 'draught', default=None)
    wetted_surface_m2: float | None = declare(
        number(0.01, 1e5, 'm^2'), 'wetted surface', default=None
    )
    water: Water = declare(section(Water), 'the water', default=Water())
    added_mass: AddedMass = declare(
        added_mass(), 'surge added mass over mass', default=MerchantAddedMass()
    )
    air: Air | None = declare(section(Air), 'above-water ship', default=None)
    propeller: Propeller | None = declare(section(Propeller), 'propeller', default=None)
    propulsion: Propulsion | None = declare(
        section(Propulsion), 'run-down after the stop', default=None
    )
    baseline: Baseline | None = declare(baseline(), 'expected resistance', default=None)
    effects: tuple[StatedEffect, ...] = declare(
        list_of(section(StatedEffect)), 'effects on top of the baseline', default=()
    )
    learnt: tuple[LearntTerm, ...] = declare(
        learnt_terms(), 'effects that the library lacks, as `learn` writes them', default=()
    )
    economics: Economics | None = declare(
        section(Economics), 'prices, for a trend over months', default=None
    )
    facts: tuple[Fact, ...] = declare(fact_list(), 'what a log book knows of all runs', default=())

    def __post_init__(self) -> None:
        # particulars that are varied may leave what is plausible of a file, never what can be
        given = {name: getattr(self, name) for name in _SIZES if getattr(self, name) is not None}
        problems = [
            f'{name}: {value!r}, expected a number above 0'
            for name, value in given.items()
            if not 0.0 < value < np.inf
        ]
        if problems:
            raise ShipFileError('Ship(...)', problems)
        # whole numbers, and those of numpy, become floats: what is compiled takes no other
        for name, value in given.items():
            object.__setattr__(self, name, float(value))

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Ship:
        """
        Read a ship file.

        Parameters
        ----------
        path
            Of a YAML file in UTF-8, in SI units.

        Returns
        -------
        Ship
            Checked: every value in its range, and all consistent.

        Raises
        ------
        ShipFileError
            Naming every problem of the file at once.

        Notes
        -----
        Source: the keys and their units are those that `declare` states in this package.

        Examples
        --------
        >>> from importlib import resources
        >>> from shipdrag_ros.ship import Ship
        >>> ship = Ship.load(resources.files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')
        >>> ship.name, ship.length_m
        ('Vitus Bering', 150.0)
        >>> f'{ship.n_r(5.0):.3f}'
        '0.077'
        """
        content = text_of(path, what='a ship file', error=ShipFileError)
        return cls.from_yaml(content, subject=str(path))

    @classmethod
    def example(cls) -> Ship:
        """
        Return the ship of the examples, a cargo ship of 150 m with a baseline.

        Returns
        -------
        Ship
            That of `config/vitus_bering.yaml`.
        """
        return cls.load(str(resources.files('shipdrag_ros') / 'data' / 'vitus_bering.yaml'))

    @classmethod
    def from_yaml(cls, content: str, *, subject: str) -> Ship:
        """
        Read the text of a ship file; `subject` names it in errors.

        Parameters
        ----------
        content
            YAML, in SI units.
        subject
            Names the text in errors, a path for instance.

        Returns
        -------
        Ship
            Checked: every value in its range, and all consistent.

        Raises
        ------
        ShipFileError
            Naming every problem of the text at once.

        Notes
        -----
        Source: the keys and their units are those that `declare` states in this package.

        Examples
        --------
        >>> from shipdrag_ros.ship import Ship
        >>> text = '{length_m: 80.0, displaced_volume_m3: 4000.0}'
        >>> ship = Ship.from_yaml(text, subject='coaster')
        >>> f'{ship.mass_kg / 1000.0:.0f} t'
        '4100 t'
        """
        data = parse(content, subject=subject, error=ShipFileError)
        problems: list[str] = []
        keys = keys_of(cls)
        if data and not (isinstance(data, dict) and keys.keys() & data.keys()):
            # nothing of it is repeated: it may be any file, and messages go to everybody
            needed = 'a ship file has length_m and displaced_volume_m3'
            raise ShipFileError(subject, [f'is no ship file, none of its keys is known; {needed}'])
        accepted = read_keys(keys, data, '', problems)
        # a section that was refused is not checked as if it were the default
        given = data if isinstance(data, dict) else {}
        defaults = {
            name: key.default
            for name, key in keys.items()
            if name not in given and key.default is not MISSING
        }
        problems.extend(_inconsistencies({**defaults, **accepted}))
        if problems:
            raise ShipFileError(subject, problems)
        return cls(**accepted)

    def to_yaml(self) -> str:
        """
        Return the text that `from_yaml` reads back as this ship.
        """
        return strict_yaml.dump(plain(self))

    @property
    def mass_kg(self) -> float:
        """Mass of the displaced water."""
        return self.water.density_kg_m3 * self.displaced_volume_m3

    @property
    def slenderness(self) -> float:
        """L / V^(1/3)."""
        return self.length_m / float(np.cbrt(self.displaced_volume_m3))

    def summary(self) -> str:
        """
        Return the ship in one line: name, length, displacement, mass.
        """
        light = self.mass_kg < LIGHT_KG
        mass = f'{self.mass_kg:.4g} kg' if light else f'{self.mass_kg * 1e-3:,.0f} t'
        return (
            f'{self.name or "a ship without a name"}: length {self.length_m:g} m, displacement '
            f'{self.displaced_volume_m3:g} m³ ({mass})'
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the results must know, a sentence each."""
        low, high = SLENDERNESS_MERCHANT_TRUSTED
        if isinstance(self.added_mass, MerchantAddedMass) and not low <= self.slenderness <= high:
            return (
                f'added_mass: merchant n_r at L/V^(1/3) = {self.slenderness:.3g}, outside the '
                f'{low:g}..{high:g} it is trusted for',
            )
        return ()

    @property
    def _froude_one(self) -> float:
        return math.sqrt(GRAVITY_M_S2 * self.length_m)

    def froude(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return the Froude number v / sqrt(g L).
        """
        return np.asarray(speed_m_s, np.float64) / self._froude_one

    def speed(self, froude: ArrayLike) -> Float64:
        """
        Return the speed [m/s] at a Froude number.
        """
        return np.asarray(froude, np.float64) * self._froude_one

    def n_r(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return the unsteady-motion correction n_r at |v|.

        Notes
        -----
        S1 (2).
        """
        magnitude = np.abs(np.asarray(speed_m_s, np.float64))
        return np.asarray(polyval(magnitude, self._n_r_coefficients), np.float64)

    def n_r_polynomial(self) -> Float64:
        """
        Return the coefficients of n_r in |v| [m/s], lowest power first.

        Notes
        -----
        The b0, b1, b2 of S1 (2).
        """
        return self._n_r_coefficients.copy()

    @cached_property
    def _n_r_coefficients(self) -> Float64:
        in_froude = n_r_polynomial(self.added_mass, self.slenderness)
        return in_froude / self._froude_one ** np.arange(len(in_froude))

    @property
    def baseline_range_m_s(self) -> tuple[float, float]:
        """
        Speeds at which the baseline is stated, lowest and highest.

        Raises
        ------
        ShipdragError
            Without a baseline.
        """
        base = self._stated_baseline()
        if isinstance(base, TableBaseline):
            return base.speed_m_s[0], base.speed_m_s[-1]
        low, high = self.speed((base.wave_froude[0], base.wave_froude[-1]))
        return float(low), float(high)

    def resistance_n(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return the baseline resistance [N], odd in the speed.

        Raises
        ------
        ShipdragError
            Without a baseline, or outside its table.
        """
        base = self._stated_baseline()
        v = np.asarray(speed_m_s, np.float64)
        magnitude = np.abs(v)
        if isinstance(base, TableBaseline):
            return np.sign(v) * base.resistance(magnitude)
        assert self.wetted_surface_m2 is not None  # the ship file was checked
        reynolds = magnitude * self.length_m / self.water.kinematic_viscosity_m2_s
        coefficient = base.viscous(reynolds) + base.wave(self.froude(magnitude))
        pressure = 0.5 * self.water.density_kg_m3 * v * magnitude
        return pressure * self.wetted_surface_m2 * coefficient + self.air_drag_n(v)

    def _stated_baseline(self) -> Baseline:
        if self.baseline is None:
            raise ShipdragError(
                f'ship {self.name!r} has no baseline resistance; add `baseline` to its ship file'
            )
        return self.baseline

    def air_drag_n(self, relative_wind_m_s: ArrayLike) -> Float64:
        """
        Return the air drag along the ship [N], retarding positive.

        Parameters
        ----------
        relative_wind_m_s
            Wind along the ship as felt on board, from ahead positive. In
            still air: the speed over ground.
        """
        wind = np.asarray(relative_wind_m_s, np.float64)
        if self.air is None:
            return np.zeros_like(wind)
        area = self.air.frontal_area_m2 * self.air.drag_coefficient
        return 0.5 * AIR_DENSITY_KG_M3 * area * wind * np.abs(wind)


def friction_n(ship: Ship, speed_m_s: Float64) -> Float64:
    """
    Return (1 + k) C_F times the pressure on the wetted surface [N].

    Parameters
    ----------
    speed_m_s
        Through water, 0 or more.

    Notes
    -----
    ITTC-57. A baseline that is a table has no form factor: k = 0.2.
    """
    base = ship.baseline
    k = base.form_factor if isinstance(base, CoefficientBaseline) else USUAL_FORM_FACTOR
    reynolds = speed_m_s * ship.length_m / ship.water.kinematic_viscosity_m2_s
    return (1.0 + k) * ittc57(reynolds) * _force_n(ship, speed_m_s)


def viscous_n(ship: Ship, speed_m_s: Float64) -> Float64:
    """
    Return the friction with the correlation allowance [N].
    """
    base = ship.baseline
    allowance = base.correlation_allowance if isinstance(base, CoefficientBaseline) else 0.0
    return friction_n(ship, speed_m_s) + allowance * _force_n(ship, speed_m_s)


def drag_n(ship: Ship, drag_area_m2: float, speed_m_s: Float64) -> Float64:
    """
    Return 0.5 rho A v^2 [N] in the water of a ship.
    """
    return QuadraticDrag(drag_area_m2, ship.water.density_kg_m3).force_n(speed_m_s)


@dataclass(frozen=True)
class QuadraticDrag:
    """
    A drag that grows with the square of the speed.

    Attributes
    ----------
    drag_area_m2
        C0 l d.
    density_kg_m3
        Of the water.
    """

    drag_area_m2: float
    density_kg_m3: float

    def force_n(self, speed_m_s: Float64) -> Float64:
        """
        Return 0.5 rho A v^2 [N] at speeds of 0 or more; S2 (11).
        """
        return 0.5 * self.density_kg_m3 * self.drag_area_m2 * speed_m_s**2


def _force_n(ship: Ship, speed_m_s: Float64) -> Float64:
    return drag_n(ship, surface_m2(ship), speed_m_s)


def surface_m2(ship: Ship) -> float:
    """
    Return the wetted surface, the usual one of her length and volume where none is stated.
    """
    return ship.wetted_surface_m2 or _usual_wetted_surface_m2(
        ship.length_m, ship.displaced_volume_m3
    )


@dataclass(frozen=True)
class RunWater:
    """
    The water of one run.
    """

    temperature_c: float | None = declare(
        number(-2.0, 40.0, 'degC'), 'temperature, from which the viscosity follows', default=None
    )
    density_kg_m3: float | None = declare(number(900.0, 1100.0, 'kg/m^3'), 'density', default=None)
    density: float | None = declare(
        number(900.0, 1100.0, 'kg/m^3'), 'the same in other words', default=None
    )


@dataclass(frozen=True)
class RunSheet:
    """
    One run, where it differs from the ship file.

    `load` and `from_yaml` check every value; constructing one directly does not.
    """

    facts: tuple[Fact, ...] = declare(fact_list(), 'what a log book knows of it', default=())
    draught_m: float | None = declare(number(0.01, 40.0, 'm'), 'draught', default=None)
    displaced_volume_m3: float | None = declare(
        number(1e-4, 1e6, 'm^3'), 'displaced volume', default=None
    )
    water: RunWater | None = declare(section(RunWater), 'the water', default=None)

    @property
    def temperature_c(self) -> float | None:
        """Temperature of the water [degC]; None where it is not stated."""
        return None if self.water is None else self.water.temperature_c

    @classmethod
    def load(cls, path: Path) -> RunSheet:
        """
        Read a file.

        Raises
        ------
        ShipFileError
            Naming every problem of the file at once.
        """
        content = text_of(path, what='a run file', error=ShipFileError)
        return cls.from_yaml(content, subject=str(path))

    @classmethod
    def from_yaml(cls, content: str, *, subject: str) -> RunSheet:
        """
        Read a text; `subject` names it in errors.

        Raises
        ------
        ShipFileError
            Naming every problem of the text at once.
        """
        data = parse(content, subject=subject, error=ShipFileError)
        problems: list[str] = []
        accepted = read_keys(keys_of(cls), data, '', problems)
        water = accepted.get('water')
        if water and water.density is not None and water.density_kg_m3 is not None:
            problems.append('water: density and density_kg_m3 are the same; keep one')
        if problems:
            raise ShipFileError(subject, problems)
        return cls(**accepted)

    def of(self, ship: Ship, *, subject: str, facts: Sequence[Fact] = ()) -> Ship:
        """
        Return the ship as she was in the run, with what is known of it.

        Parameters
        ----------
        ship
            As her file states her; the resistance coefficients stay hers.
        subject
            Names the run in errors.
        facts
            Of all runs, which override those of the ship and of the run.

        Raises
        ------
        ShipFileError
            If what is overridden does not fit the rest of the ship file.
        """
        mine, density = self.water or RunWater(), ship.water.density_kg_m3
        density = mine.density_kg_m3 or mine.density or density
        viscosity = ship.water.kinematic_viscosity_m2_s
        if mine.temperature_c is not None:
            viscosity = kinematic_viscosity(mine.temperature_c, density)
        changed = replace(
            ship,
            draught_m=self.draught_m or ship.draught_m,
            displaced_volume_m3=self.displaced_volume_m3 or ship.displaced_volume_m3,
            water=Water(density_kg_m3=density, kinematic_viscosity_m2_s=viscosity),
            facts=overriding(ship.facts, self.facts, facts),
        )
        problems = list(_inconsistencies({name: getattr(changed, name) for name in keys_of(Ship)}))
        if problems:
            raise ShipFileError(subject, problems)
        return changed


def kinematic_viscosity(temperature_c: float, density_kg_m3: float) -> float:
    """
    Return the kinematic viscosity of water [m^2/s].

    Parameters
    ----------
    temperature_c
        Of the water [degC].
    density_kg_m3
        From that of fresh water to that of the sea: how salt it is.

    Returns
    -------
    float
        Between fresh and sea water by the density.

    Notes
    -----
    The formulas of the ITTC 1978 performance prediction method for fresh and for
    sea water; within 2 % of ITTC 7.5-02-01-03 from 0 to 30 degrees.
    """
    fresh = (0.000585 * (temperature_c - 12.0) - 0.03361) * (temperature_c - 12.0) + 1.2350
    sea = (0.000659 * (temperature_c - 1.0) - 0.05076) * (temperature_c - 1.0) + 1.7688
    # by the densities of both at 15 degrees
    return 1e-6 * float(np.interp(density_kg_m3, (999.0, 1026.0), (fresh, sea)))
