# SPDX-License-Identifier: Apache-2.0
"""Windows: bounds, the plane of positions, and cuts that leave no trace."""

from __future__ import annotations

from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.estimation import Series, Window
from shipdrag_ros.samples import Block, Channel, concatenate, in_arrival_order

END_NS = 10**18


def east_north(latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    """Plane tangent to the WGS84 ellipsoid at the first point, by way of its centre."""
    a, e2 = 6378137.0, 6.69437999014e-3
    phi, lam = np.radians(latitude), np.radians(longitude)
    n = a / np.sqrt(1.0 - e2 * np.sin(phi) ** 2)
    centred = np.stack(
        [
            n * np.cos(phi) * np.cos(lam),
            n * np.cos(phi) * np.sin(lam),
            n * (1.0 - e2) * np.sin(phi),
        ]
    )
    d = centred - centred[:, :1]
    sin_phi, cos_phi = np.sin(phi[0]), np.cos(phi[0])
    sin_lam, cos_lam = np.sin(lam[0]), np.cos(lam[0])
    east = -sin_lam * d[0] + cos_lam * d[1]
    north = -sin_phi * cos_lam * d[0] - sin_phi * sin_lam * d[1] + cos_phi * d[2]
    return np.stack([east, north], axis=1)


def test_bounds_are_inclusive_and_channels_kept_apart() -> None:
    stamps = np.arange(10, 60, 10)
    block = in_arrival_order(
        [
            Block.of(Channel.SPEED_THROUGH_WATER, stamps, np.arange(5.0), variance=0.01),
            Block.of(Channel.SPEED_OVER_GROUND, stamps, np.arange(5.0) + 10.0),
            Block.of(Channel.POSITION, stamps, np.arange(10.0).reshape(5, 2), variance=4.0),
            Block.of(Channel.HEADING, stamps + 1, np.full(5, 0.3)),
            Block.of(Channel.SHAFT, stamps + 1, np.full(5, 9.0)),
            Block.of(Channel.DEPTH, stamps + 2, np.full(5, 30.0)),
        ]
    )
    window = Window.from_block(block, 20, 40)
    np.testing.assert_array_equal(window.speed_through_water.time_ns, [20, 30, 40])
    np.testing.assert_array_equal(window.speed_through_water.value, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(window.speed_through_water.variance, [0.01] * 3)
    np.testing.assert_array_equal(window.speed_over_ground.value, [11.0, 12.0, 13.0])
    np.testing.assert_array_equal(window.position.value, [[2.0, 3.0], [4.0, 5.0], [6.0, 7.0]])
    assert window.position.variance.shape == (3, 2)
    np.testing.assert_array_equal(window.heading.time_ns, [21, 31])
    np.testing.assert_array_equal(window.shaft.value, [9.0, 9.0])
    assert window.notes == ()
    assert len(Window.from_block(block, 41, 49).position) == 0


@pytest.mark.parametrize('latitude', [-55.0, 0.0, 62.0])
@pytest.mark.parametrize('longitude', [10.0, 179.98, -179.98])
def test_latitude_and_longitude_become_metres(latitude: float, longitude: float) -> None:
    # 10 km to the north-east, 12 km to the west, across the date line too
    steps = np.linspace(0.0, 1.0, 9)
    for to_north, to_east in ((0.07, 0.1), (0.0, -0.15)):
        degrees = np.stack([latitude + to_north * steps, longitude + to_east * steps], axis=1)
        degrees[:, 1] = (degrees[:, 1] + 180.0) % 360.0 - 180.0
        block = Block.of(Channel.POSITION_GEODETIC, np.arange(1, 10), degrees)
        found = Window.from_block(block, 0, END_NS).position.value
        np.testing.assert_array_equal(found[0], [0.0, 0.0])
        exact = east_north(degrees[:, 0], degrees[:, 1])
        # along the track: what the estimate sees; the curve of a parallel is across it
        chord = exact[-1] / np.linalg.norm(exact[-1])
        np.testing.assert_allclose(found @ chord, exact @ chord, rtol=0.0, atol=0.1)


def test_variances_of_latitude_and_longitude_turn_to_east_and_north() -> None:
    block = Block.of(
        Channel.POSITION_GEODETIC, [1, 2], [[60.0, 5.0], [60.1, 5.0]], variance=[[4.0, 9.0]] * 2
    )
    np.testing.assert_array_equal(
        Window.from_block(block, 0, 9).position.variance, [[9.0, 4.0]] * 2
    )


@pytest.mark.parametrize(('metres', 'degrees'), [(3, 2), (2, 3), (2, 2)])
def test_of_two_encodings_the_larger_is_used_and_said(metres: int, degrees: int) -> None:
    block = in_arrival_order(
        [
            Block.of(Channel.POSITION, np.arange(metres), np.full((metres, 2), 7.0)),
            Block.of(Channel.POSITION_GEODETIC, np.arange(degrees), np.full((degrees, 2), 60.0)),
        ]
    )
    window = Window.from_block(block, 0, 9)
    assert len(window.position) == max(metres, degrees)
    assert window.position.value[0, 0] == (0.0 if degrees > metres else 7.0)
    assert window.geodetic == ({'position'} if degrees > metres else set())
    assert len(window.notes) == 1
    assert f'metres ({metres})' in window.notes[0]


def test_stamps_that_do_not_ascend_are_refused() -> None:
    block = Block.of(Channel.SHAFT, [1, 3, 3], [1.0, 1.0, 1.0])
    with pytest.raises(ValueError, match='SHAFT: the stamps do not ascend'):
        Window.from_block(block, 0, 9)
    assert len(Window.from_block(block, 0, 2).shaft) == 1


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.lists(st.integers(0, 60), max_size=8))
def test_cuts_change_no_bit(seed: int, cuts: list[int]) -> None:
    rng = np.random.default_rng(seed)
    block = in_arrival_order(
        [
            Block.of(channel, np.cumsum(rng.integers(1, 50, 15)), rng.normal(size=(15, 2)))
            for channel in (Channel.SPEED_THROUGH_WATER, Channel.POSITION, Channel.HEADING)
        ]
    )
    edges = [0, *sorted(min(cut, len(block)) for cut in cuts), len(block)]
    again = concatenate([block[a:b] for a, b in pairwise(edges)])
    one, two = (Window.from_block(part, 40, 500) for part in (block, again))
    for item in fields(Window):
        a, b = getattr(one, item.name), getattr(two, item.name)
        of_a, of_b = (each if isinstance(each, tuple) else (each,) for each in (a, b))
        assert len(of_a) == len(of_b)
        for mine, other in zip(of_a, of_b, strict=True):
            if not isinstance(mine, Series):
                assert mine == other
                continue
            for name in ('time_ns', 'value', 'variance'):
                assert getattr(mine, name).tobytes() == getattr(other, name).tobytes()
                assert getattr(mine, name).flags.c_contiguous
                assert not np.shares_memory(getattr(mine, name), block.value)
