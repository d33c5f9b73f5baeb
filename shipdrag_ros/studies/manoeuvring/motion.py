# SPDX-License-Identifier: Apache-2.0
"""How steered ships move: many at once, and one of them."""

from __future__ import annotations

from dataclasses import dataclass

from shipdrag_ros.samples import Float64


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
