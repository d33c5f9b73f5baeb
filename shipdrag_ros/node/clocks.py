# SPDX-License-Identifier: Apache-2.0
"""
Clocks that are set while the node runs, its own and those of the sensors.

A clock that is set amid a coastdown puts readings where the ship never was. Its
own clock the node knows by one that nobody sets; that of a sensor by the lag of
its stamps, whose smallest over some seconds changes only if a clock does:
a network that stalls makes lags longer for a while, and none shorter.
"""

from __future__ import annotations

import time
from collections import deque

STEP_S = 1.0  # a step this large is worth an end; slewing is slower
LOOKS = 20  # ticks on each side of a step back, at which lags are longer for good
_MOMENT_NS = 100_000_000
_LATEST = 2  # ticks that show a step forward


def boot_ns() -> int:
    """
    Return a time that nobody sets, and that goes on while the computer sleeps [ns].
    """
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def both_ns() -> tuple[int, int] | None:
    """
    Return the clock of this computer and `boot_ns` at one moment.

    None where the process was held up between the two.
    """
    before_ns, now_ns = boot_ns(), time.time_ns()
    after_ns = boot_ns()
    return (now_ns, after_ns) if after_ns - before_ns < _MOMENT_NS else None


class OwnClock:
    """The clock that arrivals are timed by, held against one that nobody sets."""

    def __init__(self) -> None:
        self._before: tuple[int, int] | None = None

    def step_s(self, now_ns: int, steady_ns: int) -> float:
        """
        Return by how much the clock was set since the last call [s], 0 if it was not.
        """
        before, self._before = self._before, (now_ns, steady_ns)
        if before is None:
            return 0.0
        step_s = ((now_ns - before[0]) - (steady_ns - before[1])) * 1e-9
        return step_s if abs(step_s) >= STEP_S else 0.0


class SensorClock:
    """The clock of one input, by the lags of its stamps."""

    def __init__(self) -> None:
        self._least_s: deque[float] = deque(maxlen=2 * LOOKS)

    def step_s(self, least_lag_s: float | None) -> float:
        """
        Return by how much the clock was set [s], 0 if it was not.

        Parameters
        ----------
        least_lag_s
            Smallest arrival minus stamp of the last second; None without a reading.
        """
        if least_lag_s is None:
            return 0.0
        self._least_s.append(least_lag_s)
        lags = list(self._least_s)
        if len(lags) > 2 * _LATEST:
            forward_s = min(lags[:-_LATEST]) - max(lags[-_LATEST:])
            if forward_s >= STEP_S:
                return self._begin_anew(forward_s)
        if len(lags) == 2 * LOOKS:
            back_s = min(lags[LOOKS:]) - min(lags[:LOOKS])
            if back_s >= STEP_S:
                return self._begin_anew(-back_s)
        return 0.0

    def _begin_anew(self, step_s: float) -> float:
        self._least_s.clear()
        return step_s


def set_by(step_s: float) -> str:
    """
    Return that a clock was set, in words.
    """
    side = 'forward' if step_s > 0.0 else 'back'
    return f'went {side} by {abs(step_s):.1f} s'
