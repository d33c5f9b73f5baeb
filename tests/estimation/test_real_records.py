# SPDX-License-Identifier: Apache-2.0
"""Measured coastdowns; the folder is given by SHIPDRAG_DATA."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import curve_fit

from shipdrag_ros.estimation import Window, estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship

pytestmark = [
    pytest.mark.skipif('SHIPDRAG_DATA' not in os.environ, reason='SHIPDRAG_DATA is not set'),
]
START_NS = 1_700_000_000_000_000_000


def columns(name: str, *wanted: str) -> list[np.ndarray]:
    with (Path(os.environ['SHIPDRAG_DATA']) / name).open(newline='') as file:
        rows = list(csv.DictReader(file))
    return [np.array([float(row[column]) for row in rows]) for column in wanted]


def stamps(time_s: np.ndarray) -> np.ndarray:
    return START_NS + np.round(time_s * 1e9).astype(np.int64)


def test_ferry_path_from_speed_position_and_both() -> None:
    time_s, north, east, speed = columns(
        'milliampere_coast_t457_20hz.csv', 't_s', 'pos_n_m', 'pos_e_m', 'speed_mps'
    )
    part = time_s >= 458.1  # all motors at rest
    time_s, north, east, speed = (a[part] for a in (time_s, north, east, speed))
    by_speed = np.trapezoid(speed, time_s)
    summed = np.hypot(np.diff(north), np.diff(east)).sum()
    np.testing.assert_allclose([by_speed, summed], [4.41, 4.34], rtol=0.0, atol=0.005)

    block = in_arrival_order(
        [
            Block.of(Channel.SPEED_OVER_GROUND, stamps(time_s), speed),
            Block.of(Channel.POSITION, stamps(time_s), np.stack([east, north], axis=1)),
        ]
    )
    ferry = Ship(
        length_m=5.0, displaced_volume_m3=1.8, added_mass=ConstantAddedMass(value=0.3, sd=0.1)
    )
    window = Window.from_block(block, START_NS, START_NS + 10**12)
    speed_alone, track_alone, both = (
        estimate(window, ferry, Parameters(estimator=estimator, froude_min=0.005))
        for estimator in ('s1_speed', 's1_position', 's1_joint')
    )
    track = speed_alone.tracks['speed_over_ground']
    np.testing.assert_allclose(
        np.trapezoid(track.fitted, track.time_ns * 1e-9), by_speed, rtol=1e-3
    )
    lengths = [np.ptp(found.tracks['position'].fitted) for found in (track_alone, both)]
    # millimetres of noise at 20 Hz make the summed length 1 % too long
    chord = np.hypot(north[-1] - north[0], east[-1] - east[0])
    assert chord < min(lengths) < max(lengths) < summed - 0.02
    # the positions are far better: the speeds, 2.6 % higher, are what does not fit
    assert abs(lengths[1] - lengths[0]) < 0.01
    name = 'speed_over_ground'
    assert both.noise_sd[name] > 1.2 * speed_alone.noise_sd[name]


def test_model_ship_through_zero_speed() -> None:
    time_s, x, y, speed = columns('cse1_coast_153s_20hz.csv', 't_s', 'x_m', 'y_m', 'u_mps')
    # thrusters off at 153.2 s; the motion capture catches up until 154 s
    part = time_s >= 154.0
    time_s, x, y, speed = (a[part] for a in (time_s, x, y, speed))
    assert speed[0] > 0.18
    assert speed[-1] < 0.0
    block = in_arrival_order(
        [
            Block.of(Channel.SPEED_THROUGH_WATER, stamps(time_s), speed),
            Block.of(Channel.POSITION, stamps(time_s), np.stack([x, y], axis=1)),
        ]
    )
    model = Ship(
        length_m=1.105, displaced_volume_m3=0.0144, added_mass=ConstantAddedMass(value=0.1)
    )
    window = Window.from_block(block, START_NS, START_NS + 10**12)
    # an exponential towards a constant
    (v0, rate, rest), _ = curve_fit(
        lambda t, a, k, c: a * np.exp(-k * t) + c, time_s - time_s[0], speed, (0.2, 0.1, 0.0)
    )
    rms = np.std(speed - v0 * np.exp(-rate * (time_s - time_s[0])) - rest)
    np.testing.assert_allclose(rms, 2.5e-3, rtol=0.1)

    found = estimate(window, model, Parameters(estimator='s1_speed', froude_min=0.01))
    assert found.noise_sd['speed_through_water'] < 1.5e-3
    assert found.curve.froude[0] >= 0.01
    expected = 1.1 * rate * (found.curve.speed_m_s - rest)
    rmse = np.sqrt(np.mean((found.curve.resistance_m_s2 - expected) ** 2))
    assert rmse < 0.15 * expected.max()
    for estimator in ('s1_position', 's1_joint'):
        other = estimate(window, model, Parameters(estimator=estimator, froude_min=0.01))
        assert np.isfinite(other.curve.sigma_m_s2).all()
        both = np.linspace(0.04, 0.18, 30)
        one, two = (
            np.interp(both, e.curve.speed_m_s, e.curve.resistance_m_s2) for e in (found, other)
        )
        assert np.sqrt(np.mean((one - two) ** 2)) < 0.15 * one.max()
