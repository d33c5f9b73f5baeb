# SPDX-License-Identifier: Apache-2.0
"""Ratios of hulls, which are tied to each other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.studies.residual.fit import Hulls

ROW = np.array([[8.18, 4.0, 0.851, 0.15]])
NAMES = ('L_B', 'B_T', 'C_B', 'Fr')


def test_the_missing_ratio_follows() -> None:
    hulls = Hulls.of('one', NAMES, ROW)
    np.testing.assert_allclose(hulls.slenderness, [(8.18**2 * 4.0 / 0.851) ** (1 / 3)], rtol=1e-14)
    assert hulls.lcb is None
    slender = np.column_stack([ROW[:, :2], hulls.slenderness, ROW[:, 3:]])
    back = Hulls.of('one', ('L_B', 'B_T', 'slenderness', 'Fr'), slender)
    np.testing.assert_allclose(back.C_B, [0.851], rtol=1e-14)


def test_contradictions_are_counted() -> None:
    names = (*NAMES, 'slenderness')
    rows = np.array([[8.18, 4.0, 0.851, 0.15, 6.80], [8.18, 4.0, 0.851, 0.15, 6.0]])
    assert Hulls.of('two', names, rows).contradictions == 1


@settings(max_examples=30, deadline=None)
@given(st.floats(5.0, 10.0), st.floats(2.0, 8.0), st.floats(0.5, 0.9), st.floats(0.8, 1.25))
def test_moves_keep_the_ratios_consistent(l_b: float, b_t: float, c_b: float, by: float) -> None:
    hulls = Hulls.of('one', NAMES, np.array([[l_b, b_t, c_b, 0.15]]))
    for moved in (hulls.longer(by), hulls.flatter(by), hulls.faster(by)):
        volume_ratio = moved.L_B**2 * moved.B_T / moved.C_B
        np.testing.assert_allclose(moved.slenderness**3, volume_ratio, rtol=1e-12)
        np.testing.assert_array_equal(moved.C_B, hulls.C_B)
    assert hulls.longer(by).B_T == hulls.B_T
    assert hulls.flatter(by).slenderness == hulls.slenderness
    np.testing.assert_allclose(hulls.flatter(by).B_T, b_t * by)
    np.testing.assert_allclose(hulls.faster(by).Fr, 0.15 * by)
    np.testing.assert_array_equal(hulls.at(np.array([0.1, 0.2])).L_B, [l_b, l_b])


def test_rows_of_one_hull_belong_together(fleet: Callable[[int, int], Hulls]) -> None:
    hulls = fleet(5, 1)
    groups = hulls.groups()
    assert sorted(np.bincount(groups)) == [8] * 5
    assert len(hulls.take(groups == 2)) == 8
    assert np.ptp(hulls.take(groups == 2).L_B) == 0.0
