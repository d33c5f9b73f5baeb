# SPDX-License-Identifier: Apache-2.0
"""A shaft that the water turns on after the stop makes r no worse."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship

SHIP = Ship.from_yaml(
    'name: bare\nlength_m: 150.0\ndisplaced_volume_m3: 20200.0\n', subject='bare ship'
)
DRAG_1_M, LEAD_S, COAST_S = 3e-4, 1800, 1200


def final(shaft_rad_s: Float64 | None, seed: int = 0) -> Estimate:
    """Estimate from a log of 0.05 m/s after half an hour at 8 m/s, with a shaft or without."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(LEAD_S + COAST_S) - LEAD_S
    stamps = (np.arange(len(time_s)) * 10**9) + 10**15
    log = speed(time_s) + rng.normal(0.0, 0.05, len(time_s))
    blocks = [Block.of(Channel.SPEED_THROUGH_WATER, stamps, log)]
    if shaft_rad_s is not None:
        read = shaft_rad_s + rng.normal(0.0, 0.02, len(time_s))
        blocks.append(Block.of(Channel.SHAFT, stamps, read))
    start_ns = int(stamps[LEAD_S])
    window = Window.from_block(
        in_arrival_order(blocks), start_ns, int(stamps[-1]), before_ns=int(stamps[0])
    )
    return estimate_final(window, SHIP, Parameters())


def speed(time_s: Float64) -> Float64:
    return np.asarray(1.0 / (1.0 / 8.0 + DRAG_1_M * np.maximum(time_s, 0.0)))


@pytest.mark.parametrize('part', [0.35, 0.5, 0.8])
def test_the_water_turns_it_on(part: float) -> None:
    time_s = np.arange(LEAD_S + COAST_S) - LEAD_S
    run_down = 10.0 * np.exp(-np.maximum(time_s, 0.0) / 8.0)
    shaft = np.maximum(run_down, part * 10.0 * speed(time_s) / 8.0)
    with_shaft = final(shaft)
    assert any('as the water turns it' in note for note in with_shaft.notes)
    for at in (4.0, 5.0, 6.0, 7.0):
        expected = (1.0 + float(SHIP.n_r(at))) * DRAG_1_M * at**2
        curve = with_shaft.curve
        r = float(np.interp(at, curve.speed_m_s, curve.resistance_m_s2))
        sigma = float(np.interp(at, curve.speed_m_s, curve.sigma_m_s2))
        assert abs(r - expected) < 3.0 * sigma < 0.2 * expected
        alone = final(None).curve
        without = float(np.interp(at, alone.speed_m_s, alone.resistance_m_s2))
        assert abs(r - without) < 0.03 * expected


def test_a_sensor_that_always_reads_zero_is_called_dead() -> None:
    notes = ' '.join(final(np.zeros(LEAD_S + COAST_S)).notes)
    assert 'stood before the stop too: it shows nothing, or its sensor is dead' in notes
    assert 'stands whenever it is received' not in notes
