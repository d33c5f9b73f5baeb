# SPDX-License-Identifier: Apache-2.0
"""The hull of the data, in any number of variables and in none too few."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from shipdrag_ros.studies.surface.fit import Domain


@pytest.mark.parametrize('variables', [2, 3, 4])
def test_agrees_with_a_triangulation(variables: int) -> None:
    rng = np.random.default_rng(variables)
    data, asked = rng.normal(size=(30, variables)), 1.5 * rng.normal(size=(300, variables))
    names = [f'x{i}' for i in range(variables)]
    inside = Delaunay(data).find_simplex(asked) >= 0
    domain = Domain.of(names, data)
    assert 10 < inside.sum() < 290
    np.testing.assert_array_equal(domain.distance(asked) == 0.0, inside)
    assert [not told for told in domain.reasons(asked)] == inside.tolist()


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 5), st.integers(2, 12), st.integers(0, 10**6))
def test_means_of_data_are_inside_however_flat_they_lie(variables, count, seed):
    rng = np.random.default_rng(seed)
    # all on a line, at sizes apart by orders
    data = np.outer(rng.normal(size=count), rng.normal(size=variables)) * 10.0 ** np.arange(
        variables
    )
    domain = Domain.of([f'x{i}' for i in range(variables)], data)
    weights = rng.dirichlet(np.ones(count), size=5)
    assert domain.reasons(np.vstack([weights @ data, data])) == [[]] * (5 + count)


def test_says_what_is_outside() -> None:
    domain = Domain.of(('a', 'b'), np.array([[0.0, 0.0], [1.0, 10.0], [0.5, 5.0]]))
    assert domain.ranges == {'a': [0.0, 1.0], 'b': [0.0, 10.0]}
    ((far,), (between,)) = domain.reasons(np.array([[2.0, 5.0], [0.2, 8.0]]))
    assert far == 'a 2 is outside 0..1 of the data'
    assert 'outside their convex hull by 0.42 of their range' in between
    np.testing.assert_allclose(
        domain.distance(np.array([[0.2, 8.0]])), [0.6 / np.sqrt(2.0)], rtol=1e-5
    )
    line = Domain.of(('x',), np.array([[0.0], [1.0]]))
    np.testing.assert_allclose(line.distance(np.array([[3.0], [-0.5]])), [2.0, 0.5], rtol=1e-5)
