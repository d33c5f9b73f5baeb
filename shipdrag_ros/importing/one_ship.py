# SPDX-License-Identifier: Apache-2.0
"""Logs that are joined must be of one ship: she is nowhere twice at one time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from shipdrag_ros.display import utc
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import ABSURD_SPEED_M_S, SECOND_NS, Block, Channel, Float64, Int64

_APART_M = (
    2000.0  # more than a ship is long, and more than clocks make of it that disagree a little
)
_METRES_PER_DEGREE = 1852.0 * 60.0


class LogTrack:
    """
    Where the ship of a log was, at most once a second.

    Parameters
    ----------
    name
        Of the log.
    blocks
        Its samples, in their order.
    """

    def __init__(self, name: str, blocks: Iterator[Block]) -> None:
        self.name = name
        times, places = [np.empty(0, np.int64)], [np.empty((0, 2))]
        for block in blocks:
            chosen = block[block.channel == Channel.POSITION_GEODETIC]
            seconds, first = np.unique(chosen.stamp_ns // SECOND_NS, return_index=True)
            times.append(seconds * SECOND_NS)
            places.append(chosen.value[first])
        order = np.argsort(np.concatenate(times), kind='stable')
        self.time_ns: Int64 = np.concatenate(times)[order]
        self.degrees: Float64 = np.concatenate(places)[order]

    def away_m(self, other: LogTrack) -> tuple[Float64, Int64]:
        """
        Return how far the other is from here when she is there, less the way between.

        Parameters
        ----------
        other
            With a place at least.

        Returns
        -------
        distances, times
            [m], beyond what a ship can sail from the nearest time of this log; [ns].
        """
        after = np.searchsorted(self.time_ns, other.time_ns).clip(1, len(self.time_ns) - 1)
        before_ns = other.time_ns - self.time_ns[after - 1]
        after_ns = self.time_ns[after] - other.time_ns
        near = np.where(np.abs(before_ns) <= np.abs(after_ns), after - 1, after)
        north = other.degrees[:, 0] - self.degrees[near, 0]
        east = (other.degrees[:, 1] - self.degrees[near, 1] + 180.0) % 360.0 - 180.0
        east *= np.cos(np.radians(other.degrees[:, 0]))
        apart_m = np.hypot(north, east) * _METRES_PER_DEGREE
        between_s = np.abs(other.time_ns - self.time_ns[near]) / SECOND_NS
        return apart_m - ABSURD_SPEED_M_S * between_s, other.time_ns


def refuse_two_ships(ways: Sequence[LogTrack]) -> None:
    """
    Refuse logs that hold a ship at two places at one time.

    Raises
    ------
    ImportDataError
        If half of the common fixes of two logs are further apart than a ship is long.

    Notes
    -----
    Positions in metres have origins of their own and are not held against each other.
    """
    known = [way for way in ways if len(way.time_ns) > 1]
    for number, one in enumerate(known):
        for other in known[:number]:
            away_m, times = other.away_m(one)
            if np.median(away_m) > _APART_M:
                at = utc(int(times[len(times) // 2]))
                raise ImportDataError(
                    f'{other.name!r} and {one.name!r} are {np.median(away_m) / 1000.0:.0f} km '
                    f'apart about {at}: they are of two ships, or one clock is wrong. Read each '
                    'by itself'
                )
