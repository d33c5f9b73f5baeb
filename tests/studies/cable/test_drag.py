# SPDX-License-Identifier: Apache-2.0
"""A towed cable: the figures of the source, and what must hold for any cable."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.ship.model import QuadraticDrag
from shipdrag_ros.studies.cable.drag import (
    Cable,
    CableSurface,
    Tangent,
    base_coefficient,
    compare_errors,
    drag_coefficient,
    naive_error,
    naive_range_m_s,
    tangent_error,
    tangent_range,
)

SURFACE = pytest.mark.parametrize('surface', CableSurface)
FEW = settings(max_examples=60, deadline=None)
SLENDERNESS = st.floats(20.0, 1e5, exclude_min=True)
SPEED = st.floats(1e-2, 50.0)
TOLERANCE = st.floats(1e-8, 0.99)


@pytest.mark.parametrize(
    ('surface', 'slenderness', 'zeta0', 'c0'),
    [  # pi/4 zeta0 / lambda, by hand
        (CableSurface.SMOOTH, 100.0, 1.98, 0.015550883635269476),
        (CableSurface.SMOOTH, 1000.0, 10.89, 0.008552985999398212),
        (CableSurface.ROUGH, 100.0, 4.90, 0.03848451000647496),
        (CableSurface.ROUGH, 1000.0, 40.18, 0.03155729820530947),
    ],
)
def test_the_coefficient_is_that_of_the_source(surface, slenderness, zeta0, c0):
    np.testing.assert_allclose(base_coefficient(slenderness, surface), zeta0, rtol=1e-14)
    np.testing.assert_allclose(drag_coefficient(slenderness, surface), c0, rtol=1e-14)


@SURFACE
@FEW
@given(a=SLENDERNESS, b=SLENDERNESS)
def test_a_longer_cable_has_a_smaller_coefficient_and_more_drag(surface, a, b):
    short, long = sorted((a, b))
    if long < short * (1.0 + 1e-9):
        return
    assert drag_coefficient(long, surface) < drag_coefficient(short, surface)
    one, other = (Cable(0.1 * value, 0.1, surface) for value in (short, long))
    assert one.in_water(1025.0).drag_area_m2 < other.in_water(1025.0).drag_area_m2
    assert drag_coefficient(long, surface) > 0.25 * math.pi * (
        0.0392 if surface is CableSurface.ROUGH else 0.0099
    )


def test_ten_per_cent_holds_where_it_is_solved_and_not_where_it_was_published():
    low, high = tangent_range(0.1)
    assert (round(low, 4), round(high, 4)) == (0.7597, 1.4625)
    np.testing.assert_allclose(
        tangent_error([0.7, 1.5]), [float(-(Fraction(3, 7) ** 2)), -1.0 / 9.0], rtol=1e-14
    )
    assert np.all(np.abs(tangent_error([0.7, 1.5])) > 0.1)


@FEW
@given(tolerance=TOLERANCE, inside=st.floats(1e-6, 1.0 - 1e-6))
def test_at_the_ends_the_tangent_errs_by_the_tolerance_and_inside_by_less(tolerance, inside):
    low, high = tangent_range(tolerance)
    assert low < 1.0 < high
    # 1/u - 1 loses the digits that u = 1 + s has not
    np.testing.assert_allclose(
        tangent_error([low, high]), [-tolerance, -tolerance], rtol=1e-11 / math.sqrt(tolerance)
    )
    assert abs(tangent_error(low + inside * (high - low))) <= tolerance
    assert abs(tangent_error(low * (1.0 - 1e-6))) > tolerance
    assert abs(tangent_error(high * (1.0 + 1e-6))) > tolerance


@FEW
@given(tolerance=TOLERANCE)
def test_at_the_ends_the_naive_line_errs_by_the_tolerance(tolerance):
    low, high = naive_range_m_s(tolerance)
    np.testing.assert_allclose(
        naive_error([low, high]), [tolerance, -tolerance], rtol=0.0, atol=1e-15
    )
    assert tangent_range(tolerance)[1] - tangent_range(tolerance)[0] > high - low


@pytest.mark.parametrize(('tolerance', 'low'), [(1.0, 0.5), (4.0, 1.0 / 3.0), (1e6, 1.0 / 1001.0)])
def test_from_a_tolerance_of_one_there_is_no_upper_end(tolerance, low):
    np.testing.assert_allclose(tangent_range(tolerance)[0], low, rtol=1e-14)
    assert tangent_range(tolerance)[1] == math.inf
    assert abs(tangent_error(1e9)) < tolerance
    np.testing.assert_allclose(tangent_error(low), -tolerance, rtol=1e-12)
    assert naive_range_m_s(tolerance)[1] == math.inf


@FEW
@given(area=st.floats(1e-6, 10.0), density=st.floats(900.0, 1100.0), v0=SPEED, u=st.floats(0.1, 9))
def test_the_tangent_touches_at_v0_and_nowhere_else(area, density, v0, u):
    drag = QuadraticDrag(area, density)
    tangent = Tangent(drag, v0)
    np.testing.assert_allclose(
        tangent.force_n(np.array([v0])), drag.force_n(np.array([v0])), rtol=1e-13
    )
    step = 1e-3 * v0  # central difference: exact of a parabola
    ends = drag.force_n(np.array([v0 - step, v0 + step]))
    np.testing.assert_allclose(tangent.gain_n_per_m_s, (ends[1] - ends[0]) / (2 * step), rtol=1e-9)
    np.testing.assert_allclose(tangent.force_n(np.zeros(1)), -tangent.drag_n, rtol=1e-13)
    # its error depends on u alone, and is the closed form
    true = drag.force_n(np.array([u * v0]))
    found = tangent.force_n(np.array([u * v0])) / true - 1.0
    np.testing.assert_allclose(found, tangent_error(u), rtol=1e-9, atol=1e-12)
    assert tangent_error(u) <= 0.0


@FEW
@given(v0=SPEED, tolerance=st.floats(1e-3, 3.0))
def test_errors_are_listed_with_the_ends_of_the_range(v0, tolerance):
    u, naive, touching = compare_errors(v0, tolerance).T
    assert np.all(np.diff(u) > 0.0)
    assert {0.5, 0.7, 1.0, 1.5, 2.0} <= set(u)
    assert {end for end in tangent_range(tolerance) if math.isfinite(end)} <= set(u)
    np.testing.assert_allclose(naive, 1.0 / (u * v0) - 1.0, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(touching, 2.0 / u - 1.0 / u**2 - 1.0, rtol=1e-9, atol=1e-12)


def test_all_impossible_values_are_told_at_once():
    with pytest.raises(SimulationError) as told:
        Cable(-1.0, math.nan, 0.0)
    for part in ('length_m is -1.0', 'diameter_m is nan', 'C0 is 0.0'):
        assert part in str(told.value)
    with pytest.raises(SimulationError, match='length_m is inf'):
        Cable(math.inf, 0.1, CableSurface.ROUGH)
    with pytest.raises(SimulationError, match='length over diameter is inf'):
        Cable(1e200, 1e-200, CableSurface.ROUGH)


@SURFACE
@pytest.mark.parametrize('slenderness', [20.0, 3.0])
def test_a_short_cable_needs_a_stated_coefficient(surface, slenderness):
    with pytest.raises(SimulationError, match='above 20; state C0'):
        Cable(0.5 * slenderness, 0.5, surface)
    assert Cable(0.5 * slenderness, 0.5, 0.03).c0 == 0.03


@pytest.mark.parametrize(
    ('slenderness', 'drag', 'warned'),
    [
        (1000.0, CableSurface.SMOOTH, ''),
        (1001.0, CableSurface.SMOOTH, '1001; the formula for a smooth cylinder'),
        (5e4, CableSurface.ROUGH, '5e+04; the formula for a rough cylinder'),
        (5e4, 0.01, ''),
        (5e4, 0.04, ''),
        (100.0, 1.2, 'C0 is 1.2; ropes along the flow have 0.01 to 0.04'),
    ],
)
def test_a_doubtful_coefficient_is_warned_of(slenderness, drag, warned):
    warnings = Cable(slenderness, 1.0, drag).warnings
    assert len(warnings) == bool(warned)
    assert warned in ''.join(warnings)


@pytest.mark.parametrize('value', [0.0, -1.0, math.nan, math.inf])
def test_impossible_speeds_and_tolerances_are_refused(value):
    with pytest.raises(SimulationError, match=r'speed_m_s of a tangent is .*above 0'):
        Tangent(QuadraticDrag(1.0, 1025.0), value)
    with pytest.raises(SimulationError, match=r'tolerance is .*0\.1 is 10 %'):
        tangent_range(value)
    with pytest.raises(SimulationError, match='tolerance is'):
        naive_range_m_s(value)
