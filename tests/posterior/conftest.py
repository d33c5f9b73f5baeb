# SPDX-License-Identifier: Apache-2.0
"""A coastdown of the cargo ship with its steady record, as an estimator is given it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.estimation import Window
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, sense, simulate

LEAD_S, COAST_S, SPEED_M_S = 900.0, 1200.0, 8.0


def window_of(
    ship: Ship,
    *,
    seed: int,
    log_factor: float = 0.0,
    shift_ns: int = 0,
    turned_rad: float = 0.0,
    positions: bool = True,
    spikes: int = 0,
) -> Window:
    """Simulate, read and cut one coastdown."""
    truth = simulate(
        ship,
        Scenario(
            speed_m_s=SPEED_M_S, lead_in_s=LEAD_S, duration_s=COAST_S, heading_rad=0.7, seed=seed
        ),
    )
    sensors = [
        Sensor(channel=Channel.SPEED_THROUGH_WATER, rate_hz=0.5, sd=0.05),
        Sensor(channel=Channel.POSITION, rate_hz=0.5, sd=10.0),
    ]
    block = sense(truth, sensors if positions else sensors[:1], seed=seed)
    value = block.value.copy()
    log = np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)
    value[log, 0] *= 1.0 + log_factor
    value[log[-1 - 7 * np.arange(spikes)], 0] += 3.0
    place = block.channel == Channel.POSITION
    cos, sin = np.cos(turned_rad), np.sin(turned_rad)
    value[place, :2] = value[place, :2] @ np.array([[cos, sin], [-sin, cos]])
    block = replace(
        block,
        value=value,
        stamp_ns=block.stamp_ns + shift_ns,
        receive_ns=block.receive_ns + shift_ns,
    )
    stop = START_NS + round(LEAD_S * 1e9) + shift_ns
    return Window.from_block(
        block, stop, stop + round(COAST_S * 1e9), before_ns=START_NS + shift_ns
    )


@pytest.fixture(scope='session')
def ship() -> Ship:
    """As her file says."""
    return Ship.example()
