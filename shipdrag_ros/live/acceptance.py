# SPDX-License-Identifier: Apache-2.0
"""
The checklist of a run: what must hold for its figures to be worth something.

What is not measured is said to be unknown; it is no refusal.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from shipdrag_ros.display import M_S_PER_KNOT
from shipdrag_ros.live.headline import clock, heading
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship

WIND_M_S = 5.4  # true wind, Beaufort 3: above it air drag is no small correction
RUDDER_RAD = math.radians(5.0)  # a mean angle above it is steering, and slows the ship
COURSE_RAD = 0.35  # the parameter `turn_rad` as it is set at first
_RECENT_S = 60
_GRAVITY_M_S2 = 9.81


class Held(StrEnum):
    """Whether a condition holds."""

    YES = 'yes'
    NO = 'no'
    WAIT = 'wait'
    UNKNOWN = 'unknown'
    SILENT = 'silent'


@dataclass(frozen=True)
class Check:
    """A line of the checklist."""

    name: str
    held: Held
    text: str


class Recent:
    """
    Means of what context inputs read in the last minute.
    """

    def __init__(self) -> None:
        self._seconds: dict[Channel, deque[tuple[int, float, float]]] = {
            channel: deque()
            for channel in (Channel.RUDDER, Channel.HEADING, Channel.WIND_APPARENT, Channel.DEPTH)
        }

    def add(self, block: Block) -> None:
        """
        Take readings.
        """
        for channel, kept in self._seconds.items():
            for row in np.flatnonzero(block.channel == channel).tolist():
                second = int(block.stamp_ns[row]) // 1_000_000_000
                first, other = block.value[row].tolist()
                if not (math.isfinite(first) and math.isfinite(other)):
                    continue
                if kept and kept[-1][0] == second:
                    continue  # one a second is enough
                kept.append((second, first, other))
                while kept[0][0] < second - _RECENT_S:
                    kept.popleft()

    def mean(self, channel: Channel, now_s: int) -> tuple[float, float] | None:
        """
        Return the mean of both columns; None where nothing was read in the last minute.
        """
        rows = [row[1:] for row in self._seconds[channel] if abs(now_s - row[0]) <= _RECENT_S]
        if not rows:
            return None
        first, other = np.array(rows).T
        return float(first.mean()), float(other.mean())

    def direction(self, now_s: int) -> float | None:
        """
        Return the mean heading as sent [rad].
        """
        rows = [row[1] for row in self._seconds[Channel.HEADING] if abs(now_s - row[0]) <= 5]
        if not rows:
            return None
        return math.atan2(float(np.sin(rows).mean()), float(np.cos(rows).mean()))


def lead_check(lead_s: float | None, ready_s: float | None) -> Check:
    """
    Say whether there was enough steady sailing.
    """
    name = 'Steady lead'
    if lead_s is None or ready_s is None:
        return Check(name, Held.UNKNOWN, 'no speed, or the node does not say')
    if lead_s >= ready_s:
        return Check(name, Held.YES, f'{clock(lead_s)}, at least {clock(ready_s)}')
    return Check(name, Held.WAIT, f'{clock(lead_s)} of {clock(ready_s)}')


def wind_check(apparent: tuple[float, float] | None, speed_m_s: float | None) -> Check:
    """
    Say whether the true wind is light; from the apparent wind and the ship's speed [m/s].
    """
    name = 'Wind'
    if apparent is None or speed_m_s is None:
        return Check(name, Held.UNKNOWN, 'look at the sea')
    true = math.hypot(apparent[0] + speed_m_s, apparent[1])
    light = true <= WIND_M_S
    limit = WIND_M_S / M_S_PER_KNOT
    text = f'{true / M_S_PER_KNOT:.0f} kn true, {"at most" if light else "over"} {limit:.0f} kn'
    return Check(name, Held.YES if light else Held.NO, text)


def depth_check(depth_m: float | None, speed_m_s: float | None, ship: Ship | None) -> Check:
    """
    Say whether the water is deep enough for the hull not to feel the ground.

    Notes
    -----
    ITTC 7.5-04-01-01.1: h > 3 sqrt(B T) and h > 2.75 v^2 / g.
    """
    name = 'Depth'
    if depth_m is None:
        return Check(name, Held.UNKNOWN, 'look at the chart')
    needed = 2.75 * (speed_m_s or 0.0) ** 2 / _GRAVITY_M_S2
    if ship is not None and ship.breadth_m and ship.draught_m:
        needed = max(needed, 3.0 * math.sqrt(ship.breadth_m * ship.draught_m))
    deep = depth_m >= needed
    text = f'{depth_m:.0f} m, {"at least" if deep else "less than"} {needed:.0f} m'
    return Check(name, Held.YES if deep else Held.NO, text)


def rudder_check(angle_rad: float | None) -> Check:
    """
    Say whether the rudder is amidships, by its mean of the last minute.
    """
    name = 'Rudder'
    if angle_rad is None:
        return Check(name, Held.UNKNOWN, 'keep it amidships')
    held = abs(angle_rad) <= RUDDER_RAD
    text = f'{math.degrees(abs(angle_rad)):.0f}° mean of the last minute'
    return Check(name, Held.YES if held else Held.NO, text if held else f'{text}: amidships')


def course_check(turned_rad: float | None, *, coasting: bool) -> Check:
    """
    Say whether the course is held; by the heading against that at the stop, or a while ago.
    """
    name = 'Course'
    if turned_rad is None:
        return Check(name, Held.UNKNOWN, 'keep the heading')
    swung = abs(math.degrees(math.remainder(turned_rad, 2.0 * math.pi)))
    held = swung < math.degrees(COURSE_RAD)
    since = 'from the stop' if coasting else 'in 5 min'
    text = f'{swung:.0f}° {since}, at most {math.degrees(COURSE_RAD):.0f}°'
    return Check(name, Held.YES if held else Held.NO, text)


def reciprocal_check(steer_deg: float | None, *, paired: bool, coasting: bool = False) -> Check:
    """
    Say whether the run on the other heading is made.

    Parameters
    ----------
    steer_deg
        The heading that it needs; None where there is no first run.
    paired
        Whether it is made.
    coasting
        Whether a run is under way.
    """
    name = 'Reciprocal run'
    if paired:
        return Check(name, Held.YES, 'done: current and log are separated')
    if steer_deg is None:
        return Check(name, Held.WAIT, 'after the first run')
    if coasting:
        return Check(name, Held.WAIT, f'this run, if on {heading(steer_deg)}')
    return Check(name, Held.WAIT, f'still to do: steer {heading(steer_deg)}')
