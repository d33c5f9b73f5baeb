# SPDX-License-Identifier: Apache-2.0
"""By how much something moves r: without noise, from the stop on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.worlds.hidden_b.hulls import Array
from benchmarks.worlds.hidden_b.instruments import Kit, faulty_log, faulty_place
from benchmarks.worlds.hidden_b.setting import Setting
from benchmarks.worlds.hidden_b.voyage import Track, sail


def quiet(setting: Setting) -> Setting:
    """
    Return the run without anything random, and with longer steps.
    """
    step = min(4.0 * setting.step_s, setting.hull.time_s / 120.0)
    return replace(setting, quiet=True, step_s=step)


def seen(track: Track, setting: Setting, kit: Kit) -> tuple[Array, Array]:
    """
    Return what log and track say of the speed, without noise.
    """
    log = faulty_log(track.t, track.water_m_s, setting.faults)
    place = faulty_place(track, kit, setting.faults)
    velocity = np.gradient(place, track.t, axis=0)
    c, s = np.cos(setting.heading_rad), np.sin(setting.heading_rad)
    return log, velocity[:, 0] * c + velocity[:, 1] * s


def moved(changed: Setting, plain: Setting, kit: Kit) -> float:
    """
    Return by how much a change of the setting moves r, relative to its largest value.

    The retardation of log and of track, each against what the plain run shows at the same
    reading, and twice the gap between log and track over the first speed (r goes about as the
    square): the largest of the three, rms.
    """
    found = [sail(quiet(setting)) for setting in (plain, changed)]
    plain_seen, changed_seen = (
        seen(track, setting, kit) for track, setting in zip(found, (plain, changed), strict=True)
    )
    t, first = found[0].t, plain.speed_m_s
    skip = t > min(0.06 * plain.hull.time_s, 20.0)
    sizes = []
    for before, after in zip(plain_seen, changed_seen, strict=True):
        slope = -np.gradient(before, t)[skip]
        order = np.argsort(before[skip])
        largest = float(np.max(slope[before[skip] > 0.3 * first]))
        inside = (after > 0.3 * first) & (after < 1.1 * first)
        # a reading that falls to nothing has no slope
        inside[1:-1] &= inside[2:] & inside[:-2]
        use = skip & inside
        if use.sum() > 5:
            usual = np.interp(after[use], before[skip][order], slope[order])
            gap = -np.gradient(after, t)[use] - usual
            sizes.append(float(np.sqrt(np.mean(gap**2))) / largest)
    between = (changed_seen[0] - changed_seen[1]) - (plain_seen[0] - plain_seen[1])
    fast = found[0].water_m_s > 0.15 * first
    sizes.append(2.0 * float(np.sqrt(np.mean(between[fast] ** 2))) / first)
    return max(sizes)


def run_down_s(setting: Setting) -> float:
    """
    Return the time in which the thrust falls to a third after the stop.
    """
    track = sail(replace(setting, quiet=True, coast_s=max(60.0, 0.3 * setting.hull.time_s)))
    hull = setting.hull
    still = np.interp(track.water_m_s, hull.grid_m_s, setting.still_n())
    thrust = track.force_n + still
    under = np.flatnonzero(thrust < 0.37 * thrust[0])
    return max(float(track.t[under[0]]) if len(under) else 10.0, 2.0 * setting.step_s)
