# SPDX-License-Identifier: Apache-2.0
"""Coastdowns with a known answer: quadratic drag has one in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from shipdrag_ros.samples import Block, Channel, Float64, Int64, in_arrival_order
from shipdrag_ros.ship import Ship

START_NS = 1_700_000_000_123_456_789


@dataclass(frozen=True)
class QuadraticCoast:
    """
    dv/dt = -c v^2 from v0: v = v0 / (1 + c v0 t), x = ln(1 + c v0 t) / c.
    """

    speed_m_s: float = 8.2
    c_1_m: float = 5e-4
    duration_s: float = 1500.0

    def speed(self, time_s: Float64) -> Float64:
        return self.speed_m_s / (1.0 + self.c_1_m * self.speed_m_s * time_s)

    def distance(self, time_s: Float64) -> Float64:
        return np.log1p(self.c_1_m * self.speed_m_s * time_s) / self.c_1_m

    def resistance(self, speed_m_s: Float64, ship: Ship) -> Float64:
        return (1.0 + ship.n_r(speed_m_s)) * self.c_1_m * speed_m_s**2

    def stamps(self, n: int) -> Int64:
        return START_NS + np.round(np.linspace(0.0, self.duration_s, n) * 1e9).astype(np.int64)

    def block(
        self,
        n: int,
        *,
        speed_sigma: float = 0.05,
        position_sigma: float = 10.0,
        course_rad: float = 0.7,
        seed: int = 0,
    ) -> Block:
        """Log and positions at the same n stamps, arriving as measured."""
        rng = np.random.default_rng(seed)
        stamps = self.stamps(n)
        time_s = (stamps - START_NS) * 1e-9
        speed = self.speed(time_s) + speed_sigma * rng.normal(size=n)
        along = self.distance(time_s)[:, None] * [np.cos(course_rad), np.sin(course_rad)]
        position = along + position_sigma * rng.normal(size=(n, 2)) + [5e5, 6e6]
        return in_arrival_order(
            [
                Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed),
                Block.of(Channel.POSITION, stamps, position),
            ]
        )


@pytest.fixture(scope='session')
def coast() -> QuadraticCoast:
    return QuadraticCoast()


@pytest.fixture(scope='session')
def ship() -> Ship:
    return Ship(length_m=150.0, displaced_volume_m3=20200.0)
