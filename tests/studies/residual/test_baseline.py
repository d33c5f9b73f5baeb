# SPDX-License-Identifier: Apache-2.0
"""A fitted form as the wave resistance of a ship file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import DataError, ShipdragError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import CoefficientBaseline, Ship
from shipdrag_ros.studies.residual.baseline import with_residual
from shipdrag_ros.studies.residual.fit import Hulls, ResidualFit, fit_residual
from tests.studies.residual.conftest import RIVER_SHIP


@pytest.fixture
def ship() -> Ship:
    return Ship.from_yaml(RIVER_SHIP, subject='ship')


@pytest.fixture
def hulls(fleet: Callable[[int, int], Hulls]) -> Hulls:
    return fleet(60, 1)


@pytest.fixture
def found(hulls: Hulls, resistance: Callable[[Hulls], Float64]) -> ResidualFit:
    noise = np.random.default_rng(2).normal(size=len(hulls))
    return fit_residual(hulls, 1e-3 * resistance(hulls) * (1.0 + 0.02 * noise), form='sakhnovsky')


def test_the_ship_states_what_the_form_foretells(ship, found, resistance):
    written = Ship.from_yaml(with_residual(ship, found, lcb=0.005).to_yaml(), subject='again')
    base = written.baseline
    assert isinstance(base, CoefficientBaseline)
    assert base.form_factor == 0.0
    assert base.correlation_allowance == 3.0e-4
    assert base.relative_sd.friction == 0.02
    assert 0.02 < base.relative_sd.wave < 0.2
    assert 'sakhnovsky fitted to 60 hulls' in base.source
    row = np.array([[130.0 / 16.5, 16.5 / 4.1, written.slenderness, 0.005, 0.15]])
    truth = 1e-3 * resistance(Hulls.of('q', ('L_B', 'B_T', 'slenderness', 'lcb', 'Fr'), row))[0]
    assert abs(base.wave(np.array([0.15]))[0] / truth - 1.0) < 3.0 * base.relative_sd.wave
    with pytest.raises(ShipdragError, match='the table has'):
        written.resistance_n(written.speed(0.3))
    low, high = written.baseline_range_m_s
    assert 0.08 <= written.froude(low) < written.froude(high) <= 0.2 + 1e-9


def test_its_centre_of_buoyancy_counts(ship: Ship, found: ResidualFit) -> None:
    base, other = (with_residual(ship, found, lcb=lcb).baseline for lcb in (0.005, 0.008))
    assert base != other
    with pytest.raises(DataError, match=r'lcb 0\.1 is outside'):
        with_residual(ship, found, lcb=0.1)


def test_what_is_missing_is_told_together(ship: Ship, found: ResidualFit) -> None:
    with pytest.raises(DataError) as raised:
        with_residual(replace(ship, breadth_m=None, baseline=None), found, lcb=None)
    told = raised.value.problems
    assert [each.partition(':')[0] for each in told] == ['breadth_m', 'baseline', 'lcb']


def test_what_is_hardly_known_is_refused(ship, hulls, resistance):
    noise = 2e-3 * np.random.default_rng(3).normal(size=len(hulls))
    vague = fit_residual(hulls, 1e-3 * resistance(hulls) + noise, form='sirotina')
    with pytest.raises(DataError, match='times the value'):
        with_residual(ship, vague, lcb=None)


def test_other_units_are_refused(ship, hulls, resistance):
    thousandfold = fit_residual(hulls, resistance(hulls), form='sirotina')
    with pytest.raises(DataError, match='neither times 1000 nor a force'):
        with_residual(ship, thousandfold, lcb=None)
