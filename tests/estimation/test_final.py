# SPDX-License-Identifier: Apache-2.0
"""The figure of a whole coastdown where an input does not fit the others."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.simulation.scenario import GaussMarkov
from tests.runs import CARGO as SHIP

DRAG_1_M = 3e-4  # v' = -DRAG v^2


@pytest.mark.parametrize('track', ['circle', 'still', 'none'])
def test_a_track_of_something_else_costs_no_figure(track: str) -> None:
    rng = np.random.default_rng(0)
    time_s = np.arange(900.0)
    stamps = (time_s * 1e9).astype(np.int64) + 10**15
    speed = 1.0 / (1.0 / 8.2 + DRAG_1_M * time_s) + rng.normal(0.0, 0.05, 900)
    blocks = [Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed)]
    if track != 'none':
        place = rng.normal(0.0, 1e-3, (900, 2))
        if track == 'circle':
            place += 5e3 * np.c_[np.cos(time_s / 50.0), np.sin(time_s / 50.0)]
        blocks.append(Block.of(Channel.POSITION, stamps, place))
    window = Window.from_block(in_arrival_order(blocks), int(stamps[0]), int(stamps[-1]))
    found = estimate_final(window, SHIP, Parameters())
    curve = found.valid_curve
    r = np.interp(5.0, curve.speed_m_s, curve.resistance_m_s2)
    sigma = np.interp(5.0, curve.speed_m_s, curve.sigma_m_s2)
    expected = (1.0 + float(SHIP.n_r(5.0))) * DRAG_1_M * 25.0
    assert abs(r - expected) < 3.0 * sigma < 0.3 * expected


@pytest.mark.parametrize('size', [1e303, 1e150, 1e12])
@pytest.mark.parametrize('estimator', ['one', 's1_position'])
def test_positions_where_no_ship_is_are_refused(size: float, estimator: str) -> None:
    time_s = np.arange(900.0)
    stamps = (time_s * 1e9).astype(np.int64) + 10**15
    speed = 1.0 / (1.0 / 8.2 + DRAG_1_M * time_s)
    speed += np.random.default_rng(0).normal(0.0, 0.05, 900)
    place = size + np.c_[size * time_s / 900.0, 0.0 * time_s]
    log = Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed)
    track = Block.of(Channel.POSITION, stamps, place)
    alone = Window.from_block(track, int(stamps[0]), int(stamps[-1]))
    with pytest.raises(EstimationError, match='no ship has'):
        estimate_final(alone, SHIP, Parameters(estimator=estimator))
    if estimator == 'one':
        both = in_arrival_order([log, track])
        window = Window.from_block(both, int(stamps[0]), int(stamps[-1]))
        found = estimate_final(window, SHIP, Parameters())
        assert found.samples == {'speed_through_water': 900}


def cut(block: Block) -> Window:
    return Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1]))


def test_a_log_that_errs_slowly_widens_the_band_and_is_said(coast, ship) -> None:
    # N = 20, seeds 0..19: the share of the range inside +-2 sigma is 0.84 (0.5 if not widened)
    covered, said = [], 0
    for seed in range(20):
        block = coast.block(500, seed=seed)
        rows = np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)
        time_s = (block.stamp_ns[rows] - block.stamp_ns[0]) * 1e-9
        block.value[rows, 0] += GaussMarkov(0.05, 60.0).sample(time_s, np.random.default_rng(seed))
        found = estimate_final(cut(block), ship, Parameters())
        curve = found.valid_curve
        away = curve.resistance_m_s2 - coast.resistance(curve.speed_m_s, ship)
        covered.append(np.mean(np.abs(away) <= 2.0 * curve.sigma_repeatable_m_s2))
        said += any('slow disturbances learnt' in note for note in found.notes)
    assert said >= 18
    assert np.mean(covered) > 0.7
