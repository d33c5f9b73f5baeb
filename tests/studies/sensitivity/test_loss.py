# SPDX-License-Identifier: Apache-2.0
"""Sensitivity of simulators whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.errors import SensitivityError
from shipdrag_ros.studies.sensitivity.loss import CHANGES, Losses, Norm, partial_contribution, vary

TIME = np.linspace(0.0, 2.0, 50)
NAMES = ('size', 'rate', 'phase')
VALUES = np.array([2.0, -0.7, 0.3])


def swinging(sets):
    """Two quantities of a decaying wave."""
    size, rate, phase = sets.T[:, :, None]
    decay = size * np.exp(rate * TIME)
    return np.stack([decay * np.cos(TIME + phase), decay * np.sin(TIME + phase)], axis=-1)


def losses(changes, norm=Norm.ROOT_MEAN_SQUARE):
    return vary(swinging, NAMES, VALUES, np.multiply.outer(VALUES, changes)).losses(norm)


def test_all_changes_are_one_call_and_the_first_set_is_unchanged():
    calls = []

    def counted(sets):
        calls.append(sets)
        return swinging(sets)

    responses = vary(counted, NAMES, VALUES, np.multiply.outer(VALUES, CHANGES))
    assert len(calls) == 1
    assert calls[0].shape == (1 + 3 * len(CHANGES), 3)
    np.testing.assert_array_equal(calls[0][0], VALUES)
    assert responses.differences.shape == (3, 4, 50, 2)
    changed = VALUES * [1.0, 0.5, 1.0]  # the last change of the second
    expected = swinging(changed[None])[0] - swinging(VALUES[None])[0]
    np.testing.assert_allclose(responses.differences[1, 3], expected, rtol=1e-12)


@pytest.mark.parametrize('norm', Norm)
def test_loss_of_a_factor_is_the_size_of_the_motion(norm):
    table = losses((0.1, -0.5), norm).table
    size = np.exp(VALUES[1] * TIME) * VALUES[0]
    expected = np.sqrt(np.mean(size**2)) if norm is Norm.ROOT_MEAN_SQUARE else np.mean(size)
    np.testing.assert_allclose(table[0], [0.1 * expected, 0.5 * expected], rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(change=st.floats(1e-6, 1e-3), factor=st.floats(0.1, 10.0), norm=st.sampled_from(Norm))
def test_small_losses_grow_as_the_change(change, factor, norm):
    table = losses((change, -change, change * factor), norm).table
    np.testing.assert_allclose(table[:, 0], table[:, 1], rtol=3.0 * change)
    np.testing.assert_allclose(table[:, 2], factor * table[:, 0], rtol=10.0 * change)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 12), norm=st.sampled_from(Norm))
def test_norms_are_norms(seed, count, norm):
    a, b = np.random.default_rng(seed).standard_normal((2, count, 3))
    assert norm.of(a + b) <= (norm.of(a) + norm.of(b)) * (1 + 1e-12)
    assert norm.of(-3.0 * a) == pytest.approx(3.0 * norm.of(a), rel=1e-12)
    assert norm.of(a) > 0.0


@settings(max_examples=50, deadline=None)
@given(
    mean=st.lists(st.floats(0.0, 1e6, allow_subnormal=False), min_size=1, max_size=30),
    part=st.floats(0.0, 1.0),
)
def test_kept_ones_lie_above_the_threshold(mean, part):
    names = tuple(f'p{i}' for i in range(len(mean)))
    found = Losses(names, np.array(mean)[:, None])
    count = 1 + round(part * (len(mean) - 1))
    selection = found.select(count)
    assert len(selection.kept) == count
    assert selection.kept + selection.dropped == found.ranking
    assert sorted(found.ranking) == sorted(names)
    of = dict(zip(names, mean))
    slack = 1e-12 * selection.threshold
    assert min(of[name] for name in selection.kept) >= selection.threshold - slack
    assert max([of[name] for name in selection.dropped], default=0.0) <= (
        selection.threshold + slack
    )


def test_the_mean_is_over_changes_that_all_parameters_bear():
    def breaking(sets):
        motions = swinging(sets)
        motions[sets[:, 2] > 0.4] = np.nan
        return motions

    found = vary(breaking, NAMES, VALUES, np.multiply.outer(VALUES, CHANGES)).losses()
    assert np.argwhere(np.isnan(found.table)).tolist() == [[2, 2]]
    np.testing.assert_allclose(found.mean, found.table[:, [0, 1, 3]].mean(axis=1))

    def broken(sets):
        motions = swinging(sets)
        motions[sets[:, 0] != 2.0] = np.nan
        return motions

    lost = vary(broken, NAMES, VALUES, np.multiply.outer(VALUES, CHANGES)).losses()
    with pytest.raises(SensitivityError, match='size: no change can be simulated of all'):
        lost.select(1)


def test_a_step_that_is_not_a_number_is_not_made():
    steps = np.array([[0.1, np.nan], [0.1, 0.2], [0.1, 0.2]])
    table = vary(swinging, NAMES, VALUES, steps).losses().table
    assert np.isnan(table).tolist() == [[False, True], [False, False], [False, False]]


def test_questions_without_an_answer_are_told():
    with pytest.raises(SensitivityError, match='do not fit each other'):
        vary(swinging, NAMES, VALUES, np.ones((2, 4)))
    with pytest.raises(SensitivityError, match='unchanged parameters is not finite'):
        vary(lambda sets: np.full((len(sets), 5, 1), np.nan), NAMES, VALUES, np.ones((3, 1)))


def test_slopes_are_those_of_opposite_steps():
    responses = vary(swinging, NAMES, VALUES, np.multiply.outer(VALUES, (0.5, 1e-4, -1e-4)))
    slopes = responses.slopes(1, 2).reshape(3, 50, 2)
    np.testing.assert_allclose(slopes[0], 1e-4 * swinging(VALUES[None])[0], rtol=1e-6, atol=1e-12)


def test_partial_contribution_of_known_vectors():
    x, y, z = np.eye(3)
    shares = partial_contribution(np.array([x, x + y, 5.0 * z, 0.0 * x]))
    np.testing.assert_allclose(shares, [np.sqrt(0.5), np.sqrt(0.5), 1.0, 0.0], atol=1e-11)
    np.testing.assert_allclose(
        partial_contribution(np.array([x, -2.0 * x, y])), [0.0, 0.0, 1.0], atol=1e-11
    )

    # more parameters than numbers: each is a mixture of the others
    crowded = partial_contribution(np.array([x[:2], y[:2], (x + y)[:2]]))
    np.testing.assert_allclose(crowded, 0.0, atol=1e-11)
    np.testing.assert_array_equal(partial_contribution(np.zeros((2, 5))), 0.0)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 8))
def test_more_experiments_never_hide_a_parameter(seed, count):
    slopes = np.random.default_rng(seed).standard_normal((count, 30))
    size = np.linalg.norm(slopes, axis=1)
    first = partial_contribution(slopes[:, :15]) * np.linalg.norm(slopes[:, :15], axis=1)
    assert np.all(partial_contribution(slopes) * size >= first * (1 - 1e-9))
    # each to its unit, and the order, do not matter
    scale = np.arange(1.0, count + 1.0)[:, None]
    np.testing.assert_allclose(
        partial_contribution(slopes * scale), partial_contribution(slopes), rtol=1e-9
    )
