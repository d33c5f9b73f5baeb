# SPDX-License-Identifier: Apache-2.0
"""
Particulars checked against each other.

A length in feet or a volume in tonnes is a plausible number by itself; beside
the other particulars it is not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval

from shipdrag_ros.ship.baseline import CoefficientBaseline, TableBaseline
from shipdrag_ros.ship.sections import MerchantAddedMass, n_r_polynomial

SLENDERNESS = (2.0, 15.0)  # L / V^(1/3): car to racing shell
SLENDERNESS_MERCHANT = (4.0, 8.0)  # outside it the merchant n_r is meaningless
SLENDERNESS_MERCHANT_TRUSTED = (4.5, 7.0)
_FROUDE = np.linspace(0.0, 0.4, 41)  # of displacement ships, for the sign of n_r


def slenderness(length_m: float, displaced_volume_m3: float) -> float:
    """
    Return L / V^(1/3).
    """
    return length_m / float(np.cbrt(displaced_volume_m3))


def inconsistencies(values: Mapping[str, Any]) -> Iterator[str]:
    """
    Check valid top-level values; those that are missing are not used.
    """
    length, volume = values.get('length_m'), values.get('displaced_volume_m3')
    yield from _section_lengths(values)
    if length is None or volume is None:
        return
    psi = slenderness(length, volume)
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
        yield (
            f'breadth_m: {breadth!r} beside length_m: {length!r}, expected '
            f'{length / 20:.3g}..{length:.3g} m'
        )
    if breadth is not None and draught is not None:
        block = volume / (length * breadth * draught)
        if not 0.3 <= block <= 1.0:
            yield (
                f'draught_m: {draught!r}, breadth_m: {breadth!r}, length_m: {length!r} and '
                f'displaced_volume_m3: {volume!r} give a block coefficient of {block:.3g}, '
                'expected 0.3..1 (hull without keel fin; the hulls of a catamaran together)'
            )
    if surface is not None:
        usual = usual_wetted_surface_m2(length, volume)
        if not 0.5 <= surface / usual <= 2.0:
            yield (
                f'wetted_surface_m2: {surface!r}, expected {usual / 2:.4g}..{2 * usual:.4g} m^2 '
                f'for this length and volume'
            )
    if air is not None and air.frontal_area_m2 > length**2:
        yield (
            f'air.frontal_area_m2: {air.frontal_area_m2!r}, expected less than the square of '
            f'length_m, {length**2:.3g} m^2'
        )
    if propeller is not None and propeller.diameter_m > (limit := 1.2 * (draught or length)):
        yield f'propeller.diameter_m: {propeller.diameter_m!r}, expected at most {limit:.3g} m'


def _section_lengths(values: Mapping[str, Any]) -> Iterator[str]:
    base = values.get('baseline')
    if isinstance(base, CoefficientBaseline):
        pairs = ('wave_froude', base.wave_froude), ('wave_coefficient', base.wave_coefficient)
    elif isinstance(base, TableBaseline):
        pairs = ('speed_m_s', base.speed_m_s), ('resistance_n', base.resistance_n)
    else:
        return
    (name, points), (name_of_values, table) = pairs
    if len(points) != len(table):
        yield (
            f'baseline.{name_of_values}: {len(table)} values, expected {len(points)}, '
            f'one for each of {name}'
        )
    elif points[0] == 0.0 and isinstance(base, TableBaseline) and table[0] != 0.0:
        yield f'baseline.resistance_n[0]: {table[0]!r} at rest, expected 0'


def _baseline(values: Mapping[str, Any], length: float, volume: float) -> Iterator[str]:
    base = values.get('baseline')
    surface = values.get('wetted_surface_m2')
    if isinstance(base, CoefficientBaseline) and surface is None:
        yield (
            'wetted_surface_m2: missing, the coefficients of the baseline are on it; about '
            f'{usual_wetted_surface_m2(length, volume):.3g} m^2 is usual for this hull'
        )
    if isinstance(base, TableBaseline) and 'water' in values:
        top, force = base.speed_m_s[-1], base.resistance_n[-1]
        area = surface or usual_wetted_surface_m2(length, volume)
        total = force / (0.5 * values['water'].density_kg_m3 * area * top**2)
        if not 1e-5 <= total <= 0.5:
            yield (
                f'baseline.resistance_n[-1]: {force!r} at {top:g} m/s is a resistance '
                f'coefficient of {total:.2g}, expected 1e-5..0.5; are they N and m/s?'
            )


def usual_wetted_surface_m2(length_m: float, displaced_volume_m3: float) -> float:
    """
    Return the wetted surface [m^2] that such a hull usually has.

    Notes
    -----
    Taylor: S = C sqrt(V L), C about 2.6 for ship forms.
    """
    return 2.6 * float(np.sqrt(displaced_volume_m3 * length_m))
