# SPDX-License-Identifier: Apache-2.0
"""The instruments of a ship: what kind, how good, how often."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

KNOT = 1852.0 / 3600.0


@dataclass(frozen=True)
class Kit:
    """
    The instruments of a ship.

    Attributes
    ----------
    log_filter_s, log_every_s, log_step_m_s, log_sd_m_s, log_gain
        Of the speed log; `log_gain` the sd of its wander, relative.
    zeros, gaps_per_hour
        Share of readings that are exactly zero; breaks of any source.
    fix
        `gnss`, `geodetic` (the same in degrees) or `radar`.
    fix_every_s, wander_m, step_m
        Of the positions; wander and steps of GNSS.
    range_sd_m, bearing_sd_rad, marks_m
        Of the radar: two marks, from the place of the stop.
    """

    log_filter_s: float
    log_every_s: float
    log_step_m_s: float
    log_sd_m_s: float
    log_gain: float
    log_depth_m: float
    log_scale: float
    log_offset_m_s: float
    zeros: float
    gaps_per_hour: float
    fix: str
    fix_every_s: float
    wander_m: float
    step_m: float
    range_sd_m: float
    bearing_sd_rad: float
    marks_m: tuple[tuple[float, float], tuple[float, float]]
    origin_deg: tuple[float, float]
    wind_gain: float
    wind_turn_rad: float
    turn_step: float


def draw_kit(
    rng: np.random.Generator, time_s: float, speed_m_s: float, draught_m: float, far_m: float
) -> Kit:
    """
    Draw the instruments of a ship.

    Parameters
    ----------
    rng
    time_s, speed_m_s, draught_m
        Of the ship.
    far_m
        How far she goes in a run.
    """
    slow = float(np.clip(0.015 * time_s, 0.5, 15.0))  # a fast craft has a quick log
    fix = str(rng.choice(['gnss', 'geodetic', 'radar'], p=[0.3, 0.2, 0.5]))
    marks = []
    for side in rng.permutation([0.0, rng.uniform(0.4, 0.8)]):
        angle = rng.uniform(0, 2 * np.pi) + side * np.pi
        away = max(1500.0, 0.7 * far_m) * rng.uniform(0.8, 1.6)
        marks.append((float(away * np.cos(angle)), float(away * np.sin(angle))))
    return Kit(
        log_filter_s=rng.uniform(min(2.0, 0.7 * slow), slow),
        log_every_s=float(rng.choice([0.2, 0.5, 1.0, 1.0, 2.0])),
        log_step_m_s=float(rng.choice([0.1 * KNOT, 0.01 * KNOT, 0.01, 0.05])),
        log_sd_m_s=speed_m_s * 10 ** rng.uniform(-3.0, -1.9),
        log_gain=10 ** rng.uniform(-3.5, -2.7),
        log_depth_m=draught_m,
        log_scale=rng.uniform(-0.003, 0.003),
        log_offset_m_s=rng.uniform(-0.0012, 0.0012) * speed_m_s,
        zeros=float(rng.choice([0.0, 0.0, 0.001, 0.006])),
        gaps_per_hour=float(rng.choice([0.0, 1.0, 4.0])),
        fix=fix,
        fix_every_s=float(rng.choice([2.0, 3.0, 5.0]) if fix == 'radar' else 1.0),
        wander_m=rng.uniform(0.4, 2.0),
        step_m=float(rng.choice([0.0, rng.uniform(0.3, 2.5)])),
        range_sd_m=rng.uniform(2.0, 9.0),
        bearing_sd_rad=np.radians(rng.uniform(0.05, 0.25)),
        marks_m=(marks[0], marks[1]),
        origin_deg=(rng.uniform(-55.0, 65.0), rng.uniform(-180.0, 180.0)),
        wind_gain=rng.uniform(0.92, 1.06),
        wind_turn_rad=np.radians(rng.normal(0.0, 2.0)),
        turn_step=float(rng.choice([0.1, 1.0])) * 2 * np.pi / 60.0,
    )
