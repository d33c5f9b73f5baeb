# SPDX-License-Identifier: Apache-2.0
"""
Standard manoeuvres, the motions of ships in them, and the figures by which they are judged.

A turning circle is a zigzag whose order never changes sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import inf, isinf, radians

import numpy as np

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64

_ANGLES_DEG = (1.0, 90.0)
KINDS = ('zigzag', 'turn')


class Side(StrEnum):
    """Sides of a ship."""

    STARBOARD = 'starboard'
    PORT = 'port'

    @property
    def sign(self) -> float:
        """Of headings and yaw rates to this side."""
        return 1.0 if self is Side.STARBOARD else -1.0


@dataclass(frozen=True)
class Manoeuvre:
    """
    Rudder orders of a helmsman.

    Attributes
    ----------
    rudder_rad
        Size of each order.
    reverse_rad
        Heading at which the order changes sides; infinite: never.
    first
        Side of the first turn.
    """

    rudder_rad: float
    reverse_rad: float = inf
    first: Side = Side.STARBOARD

    @property
    def name(self) -> str:
        """As `parse` reads it."""
        kind = 'turn' if isinf(self.reverse_rad) else 'zigzag'
        return f'{kind}:{np.degrees(self.rudder_rad):g}'


@dataclass(frozen=True)
class ManoeuvreMotion:
    """
    Motion of one ship through a manoeuvre.

    Attributes
    ----------
    time_s : (n,)
        From the first order on.
    surge_m_s, sway_m_s : (n,)
        Speed ahead and to starboard.
    yaw_rate_rad_s, heading_rad : (n,)
        To starboard positive.
    position_m : (n, 2)
        Ahead and to starboard of where the first order was given.
    rudder_rad : (n,)
        Positive where it turns the ship to starboard.
    """

    time_s: Float64
    surge_m_s: Float64
    sway_m_s: Float64
    yaw_rate_rad_s: Float64
    heading_rad: Float64
    position_m: Float64
    rudder_rad: Float64


@dataclass(frozen=True)
class Motions:
    """
    Motions of k ships at the same times.

    Attributes
    ----------
    time_s : (n,)
    speeds : (k, n, 3)
        Surge and sway [m/s], yaw rate [rad/s].
    position_m : (k, n, 2)
    heading_rad, rudder_rad : (k, n)
        All as in `ManoeuvreMotion`.
    """

    time_s: Float64
    speeds: Float64
    position_m: Float64
    heading_rad: Float64
    rudder_rad: Float64

    def __len__(self) -> int:
        return len(self.speeds)

    def __getitem__(self, column: int) -> ManoeuvreMotion:
        surge, sway, yaw = self.speeds[column].T
        return ManoeuvreMotion(
            time_s=self.time_s,
            surge_m_s=surge,
            sway_m_s=sway,
            yaw_rate_rad_s=yaw,
            heading_rad=self.heading_rad[column],
            position_m=self.position_m[column],
            rudder_rad=self.rudder_rad[column],
        )


def zigzag(angle_deg: float, *, first: Side = Side.STARBOARD) -> Manoeuvre:
    """
    Return a zigzag of equal rudder and heading angles.
    """
    return Manoeuvre(radians(angle_deg), radians(angle_deg), first)


def turn(angle_deg: float, *, first: Side = Side.STARBOARD) -> Manoeuvre:
    """
    Return a turning circle.
    """
    return Manoeuvre(radians(angle_deg), first=first)


def parse(text: str) -> Manoeuvre:
    """
    Read `zigzag:15` or `turn:35`, the angle in degrees; first to starboard.

    Raises
    ------
    SimulationError
        If it is neither, or the angle is impossible.
    """
    kind, separator, size = text.partition(':')
    try:
        angle = float(size)
    except ValueError:
        angle = np.nan
    low, high = _ANGLES_DEG
    # written so that NaN fails
    if kind not in KINDS or not separator or not low <= angle <= high:
        raise SimulationError(
            f'manoeuvre {text!r}, expected zigzag:ANGLE or turn:ANGLE with {low:g}..{high:g} '
            'degrees of rudder; write zigzag:15, for instance'
        )
    return zigzag(angle) if kind == 'zigzag' else turn(angle)


def overshoots_rad(motion: ManoeuvreMotion, manoeuvre: Manoeuvre) -> Float64:
    """
    Return by how much the heading exceeds that of the reversal, each time.

    Returns
    -------
    (m,)
        First to the side of the first turn, then by turns.
    """
    heading, rate = motion.heading_rad, motion.yaw_rate_rad_s
    ends = np.flatnonzero((rate[1:-1] * rate[2:] < 0.0) | (rate[1:-1] == 0.0)) + 1
    between = rate[ends] - rate[ends + 1]
    step = np.diff(motion.time_s)[ends]
    # the heading is a parabola between two samples
    peak = heading[ends] + 0.5 * step * rate[ends] ** 2 / np.where(between == 0.0, 1.0, between)
    over = np.abs(peak) - manoeuvre.reverse_rad
    side = manoeuvre.first.sign
    found = []
    for sign, beyond in zip(np.sign(peak), over):
        # wiggles on the way count neither as a turn nor twice
        if sign == side and beyond >= 0.0:
            found.append(beyond)
            side = -side
    return np.array(found)
