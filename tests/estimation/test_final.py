# SPDX-License-Identifier: Apache-2.0
"""The figure of a whole coastdown where an input does not fit the others."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship

SHIP = Ship.load(files('shipdrag_ros') / 'data/vitus_bering.yaml')
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
    assert found.samples == {'speed_through_water': 900}
    curve = found.valid_curve
    r = np.interp(5.0, curve.speed_m_s, curve.resistance_m_s2)
    sigma = np.interp(5.0, curve.speed_m_s, curve.sigma_m_s2)
    expected = (1.0 + float(SHIP.n_r(5.0))) * DRAG_1_M * 25.0
    assert abs(r - expected) < 3.0 * sigma < 0.3 * expected
    said = any('by speed_through_water alone, without position' in note for note in found.notes)
    assert said == (track != 'none')


@pytest.mark.parametrize('size', [1e303, 1e150, 1e12])
@pytest.mark.parametrize('estimator', ['auto', 'log_time', 'ode_fit', 's1_position'])
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
    if estimator == 'auto':
        both = in_arrival_order([log, track])
        window = Window.from_block(both, int(stamps[0]), int(stamps[-1]))
        found = estimate_final(window, SHIP, Parameters())
        assert found.samples == {'speed_through_water': 900}
