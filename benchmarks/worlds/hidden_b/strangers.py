# SPDX-License-Identifier: Apache-2.0
"""Effects outside the library: the answer is `unknown`."""

from __future__ import annotations

import numpy as np

from benchmarks.worlds.hidden_b.effects import Draw, Hidden, changed, hidden
from benchmarks.worlds.hidden_b.hulls import Array


def _along(u: Array) -> Array:
    return np.tanh(u / 0.05)


def swinging_force(d: Draw) -> Hidden:
    """A force that begins to swing at or after the stop, by 5 to 25 % over 100 to 600 s."""
    share = float(np.clip(d.rng.uniform(0.07, 0.2) * d.size, 0.05, 0.25))
    shortest = min(100.0, 0.5 * d.coast_s)
    period = d.rng.uniform(shortest, max(min(600.0, 0.7 * d.coast_s), 1.2 * shortest))
    start = float(d.rng.choice([0.0, d.rng.uniform(0.0, 0.15) * d.coast_s]))
    phase, force = d.rng.uniform(0, 2 * np.pi), d.first_n

    def law(t: Array, u: Array) -> Array:
        swing = np.sin(2 * np.pi * (t - start) / period + phase)
        return share * force * swing * np.clip((t - start) / (0.1 * period), 0.0, 1.0)

    return hidden('swinging_force', 'run', {'share': share, 'period_s': period}, timed=law)


def dragging_anchor(d: Draw) -> Hidden:
    """An anchor drags over ground: dry friction, jerking."""
    force = d.first_n * d.rng.uniform(0.08, 0.25) * d.size
    start = d.rng.uniform(0.05, 0.35) * d.coast_s
    jerk, phase = d.rng.uniform(60.0, 200.0), d.rng.uniform(0, 2 * np.pi)

    def law(t: Array, u: Array) -> Array:
        uneven = 1.0 + 0.35 * np.sin(2 * np.pi * t / jerk + phase)
        return force * uneven * _along(u) * np.clip((t - start) / 10.0, 0.0, 1.0)

    return hidden('dragging_anchor', 'run', {'force_n': force, 'start_s': start}, timed=law)


def ice(d: Draw) -> Hidden:
    """Fields of brash ice: crushing, and a part linear in the speed."""
    force = d.first_n * d.rng.uniform(0.08, 0.25) * d.size
    edges = np.sort(d.rng.uniform(0.03, 0.8, 4)) * d.coast_s
    first = d.hull.speed_m_s

    def law(t: Array, u: Array) -> Array:
        inside = ((t > edges[0]) & (t < edges[1])) | ((t > edges[2]) & (t < edges[3]))
        return inside * force * (0.6 * _along(u) + 0.4 * u / first)

    return hidden('ice', 'run', {'force_n': force}, timed=law)


def bank(d: Draw) -> Hidden:
    """Along a bank for a while: suction, a sheer, helm against it."""
    share = d.rng.uniform(0.15, 0.4) * d.size
    start, lasts = d.rng.uniform(0.05, 0.25) * d.coast_s, d.rng.uniform(0.15, 0.3) * d.coast_s
    sheer = np.radians(d.rng.uniform(1.0, 5.0)) * d.sign
    area = d.area(share)

    def near(t: Array) -> Array:
        return np.exp(-0.5 * ((t - start - 0.5 * lasts) / (0.25 * lasts)) ** 2)

    def drags(t: Array, u: Array) -> Array:
        return 512.0 * area * u * np.abs(u) * near(t) * (t > 0.0)

    def helm(t: Array) -> Array:
        off = t - (start + 0.5 * lasts)
        return -sheer * off / (0.25 * lasts) ** 2 * near(t) * (t > 0.0)

    return hidden('bank', 'run', {'share': share, 'start_s': start}, timed=drags, helm=helm)


def list_change(d: Draw) -> Hidden:
    """Ballast is shifted: list and trim change within a minute or so."""
    share = d.sign * d.rng.uniform(0.12, 0.35) * d.size
    start, takes = d.rng.uniform(0.1, 0.35) * d.coast_s, d.rng.uniform(0.01, 0.05) * d.coast_s
    area = d.area(max(share, -0.4))

    def law(t: Array, u: Array) -> Array:
        return 512.0 * area * u * np.abs(u) * np.clip((t - start) / takes, 0.0, 1.0)

    return hidden('list_change', 'run', {'share': share, 'start_s': start}, timed=law)


def caught_net(d: Draw) -> Hidden:
    """A net or weed is caught, and comes off again."""
    area = d.area(d.rng.uniform(0.15, 0.5) * d.size)
    start, lasts = d.rng.uniform(0.05, 0.3) * d.coast_s, d.rng.uniform(0.1, 0.3) * d.coast_s

    def law(t: Array, u: Array) -> Array:
        return 512.0 * area * u * np.abs(u) * ((t > start) & (t < start + lasts))

    return hidden('caught_net', 'run', {'start_s': start, 'duration_s': lasts}, timed=law)


def gyro_ballistic(d: Draw) -> Hidden:
    """The slowing throws the gyro off: its error swings out and back; radar bearings follow."""
    size, period = d.sign * np.radians(1.5) * d.size, 5064.0

    def law(t: Array) -> Array:
        since = np.maximum(t, 0.0)
        quick = 1.0 - np.exp(-since / (0.15 * d.coast_s))
        return size * quick * np.cos(2 * np.pi * since / period) * np.exp(-since / 4000.0)

    return changed('gyro_ballistic', 'sensor', {'angle_rad': float(size)}, gyro=law)


def aerated_log(d: Draw) -> Hidden:
    """Air under the hull: the log's gain swings from the stop on."""
    share = float(np.clip(d.rng.uniform(0.02, 0.05) * d.size, 0.01, 0.2))
    period, phase = d.rng.uniform(0.12, 0.35) * d.coast_s, d.rng.uniform(0, 2 * np.pi)

    def law(t: Array) -> Array:
        return share * np.sin(2 * np.pi * t / period + phase) * np.clip(t / (0.1 * period), 0, 1)

    return changed('aerated_log', 'run', {'share': share, 'period_s': period}, swing=law)


_MAKERS = (
    swinging_force, dragging_anchor, ice, bank, list_change, caught_net, gyro_ballistic,
    aerated_log,
)  # fmt: skip
OUTSIDE = {make.__name__: make for make in _MAKERS}
