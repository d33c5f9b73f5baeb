# SPDX-License-Identifier: Apache-2.0
"""The scale of a log is unknown by 2 %, whether or not another input can show it."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.priors import LOG_SCALE
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, sense, simulate

SHIP = replace(Ship.load(files('shipdrag_ros') / 'data/vitus_bering.yaml'), baseline=None)
DRAG_1_M, NOISE_M_S = 3e-4, 0.02  # v' = -DRAG v^2
AT_M_S = 5.0


def _window(scale: float, *, position: bool) -> Window:
    time_s = np.arange(900.0)
    stamps = (time_s * 1e9).astype(np.int64) + 10**15
    rng = np.random.default_rng(0)
    speed = 1.0 / (1.0 / 8.2 + DRAG_1_M * time_s)
    read = (1.0 + scale) * speed + rng.normal(0.0, NOISE_M_S, 900)
    blocks = [Block.of(Channel.SPEED_THROUGH_WATER, stamps, read)]
    if position:
        way = np.log1p(8.2 * DRAG_1_M * time_s) / DRAG_1_M
        place = np.c_[way, 0.0 * way] + rng.normal(0.0, 1.0, (900, 2))
        blocks.append(Block.of(Channel.POSITION, stamps, place))
    return Window.from_block(in_arrival_order(blocks), int(stamps[0]), int(stamps[-1]))


@pytest.mark.parametrize('scale', [-0.03, 0.02])
@pytest.mark.parametrize('estimator', [estimate, estimate_final])
def test_the_band_of_a_log_alone_holds_its_scale(estimator, scale: float) -> None:  # type: ignore[no-untyped-def]
    curve = estimator(_window(scale, position=False), SHIP, Parameters()).valid_curve
    r, sigma = (
        float(np.interp(AT_M_S, curve.speed_m_s, each))
        for each in (curve.resistance_m_s2, curve.sigma_repeatable_m_s2)
    )
    true = (1.0 + float(SHIP.n_r(AT_M_S))) * DRAG_1_M * AT_M_S**2
    assert abs(r - true) < 2.0 * sigma
    # r at a speed goes with the scale where it is quadratic
    assert sigma == pytest.approx(LOG_SCALE.sd * r, rel=0.4)


@pytest.mark.parametrize('scale', [-0.03, 0.02])
@pytest.mark.parametrize('estimator', [estimate, estimate_final])
def test_a_baseline_does_not_make_a_log_exact(estimator, scale: float) -> None:  # type: ignore[no-untyped-def]
    """Of the hull of the file, and of one with 16 % more friction and half of its waves."""
    stated = Ship.load(files('shipdrag_ros') / 'data/vitus_bering.yaml')
    for window, of in ((_window(scale, position=False), None), (_of_file(scale), stated)):
        curve = estimator(window, stated, Parameters()).valid_curve
        r, sigma = (
            float(np.interp(AT_M_S, curve.speed_m_s, each))
            for each in (curve.resistance_m_s2, curve.sigma_repeatable_m_s2)
        )
        true = (1.0 + float(SHIP.n_r(AT_M_S))) * DRAG_1_M * AT_M_S**2
        if of is not None:
            true = float(of.resistance_n(AT_M_S)) / of.mass_kg
        assert abs(r - true) < 2.0 * sigma
        assert 0.5 * LOG_SCALE.sd * r < sigma < 1.5 * LOG_SCALE.sd * r


def _of_file(scale: float) -> Window:
    ship = Ship.load(files('shipdrag_ros') / 'data/vitus_bering.yaml')
    effects = [StatedEffect('log_scale', {'factor': Parameter(scale)})]
    scenario = Scenario(speed_m_s=8.2, lead_in_s=0.0, duration_s=900.0)
    truth = simulate(replace(ship, propulsion=None), scenario, effects=effects)
    sensors = [Sensor(channel=Channel.SPEED_THROUGH_WATER, rate_hz=1.0, sd=NOISE_M_S)]
    block = sense(truth, sensors, seed=1)
    return Window.from_block(block, START_NS, START_NS + 900 * 10**9)


def test_positions_show_the_scale_and_it_is_said() -> None:
    found = estimate_final(_window(0.02, position=True), SHIP, Parameters())
    curve = found.valid_curve
    r, sigma = (
        float(np.interp(AT_M_S, curve.speed_m_s, each))
        for each in (curve.resistance_m_s2, curve.sigma_repeatable_m_s2)
    )
    true = (1.0 + float(SHIP.n_r(AT_M_S))) * DRAG_1_M * AT_M_S**2
    assert abs(r - true) < 3.0 * sigma
    assert sigma < 0.8 * LOG_SCALE.sd * r
    assert any('the log reads +' in note and 'in the band' in note for note in found.notes)
