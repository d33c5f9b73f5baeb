# SPDX-License-Identifier: Apache-2.0
"""The engine stop: when it was, and how fast the thrust ran down."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.estimation.window import Window
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship

_BAND = (0.08, 0.92)  # of the fall of the shaft speed from which its decay is found
_FALLEN = 0.8  # of the steady shaft speed: at more the engine was not stopped
_EARLIEST_S = 300.0  # before the onset as found
_SOON = (8.0, 16.0)  # after the fall, in half-lives
_ROUNDS = 3
_LEAST_SD = 0.01  # of the run-down, relative: no shaft falls exactly so
ONSET_SD_S = 30.0  # of an onset found from the speed alone: a loose bound, the fit finds it


@dataclass(frozen=True)
class RunDown:
    """
    What is known of the stop before the motion is fitted.

    Attributes
    ----------
    stop_ns
        Time of the stop [ns].
    stop_sd_s
        Its standard deviation; 0: not fitted.
    run_down_s, run_down_sd_s
        Time constant of the thrust and its standard deviation; 0: the thrust
        ended at once.
    source
        For the notes.
    """

    stop_ns: int
    stop_sd_s: float
    run_down_s: float
    run_down_sd_s: float
    source: str

    @classmethod
    def of(cls, window: Window, ship: Ship) -> RunDown:
        """
        Learn of the stop from the shaft, or else take what the ship file states.

        That the thrust runs down as the shaft does is what `propulsion` in the
        ship file says. Without it the thrust may end at any time up to then.
        """
        found = _from_shaft(window)
        if found is not None and ship.propulsion is None and found.run_down_s > 0.0:
            return found._loosened()
        if found is not None:
            return found
        if window.before is None:
            return cls(
                window.start_ns,
                0.0,
                0.0,
                0.0,
                'the thrust is taken to have ended before the window',
            )
        if ship.propulsion is None:
            return cls(window.start_ns, ONSET_SD_S, 0.0, 0.0, 'the thrust is taken to end at once')
        return cls(
            window.start_ns,
            ONSET_SD_S,
            ship.propulsion.run_down_s,
            ship.propulsion.sd,
            'the run-down of the thrust is that of the ship file',
        )

    def _loosened(self) -> RunDown:
        half_s = 0.5 * self.run_down_s
        return replace(
            self,
            run_down_s=half_s,
            run_down_sd_s=half_s,
            source='the thrust is taken to run down as fast as the shaft or faster',
        )


def _kept_up(time_s: Float64, shaft: Float64, high: float, low: float) -> Float64:
    """
    Return the shaft speed that the water keeps up, as a line from the fall on.

    A propeller that the water turns slows down with the ship; that is not the
    run-down of the engine.

    Parameters
    ----------
    time_s, shaft : (n,)
    high, low
        Before the stop, and a first guess.

    Returns
    -------
    (n,)
    """
    kept = np.full(len(time_s), low)
    near = time_s > -_EARLIEST_S
    for _ in range(_ROUNDS):
        half = np.flatnonzero(near & (shaft < 0.5 * (high + kept)))
        if len(half) == 0:
            break
        full = np.flatnonzero(shaft[: half[0]] > 0.95 * high + 0.05 * kept[: half[0]])
        if len(full) == 0:
            break
        after = (time_s - time_s[half[0]]) / (time_s[half[0]] - time_s[full[-1]])
        soon = (after > _SOON[0]) & (after < _SOON[1])
        if soon.sum() < 3:
            break
        slope, level = np.polyfit(after[soon], shaft[soon], 1)
        top = _FALLEN * high
        kept = np.clip(level + min(slope, 0.0) * np.clip(after, 0.0, _SOON[1]), 0.0, top)
    return kept


def _from_shaft(window: Window) -> RunDown | None:
    """Fit an exponential fall to the shaft speed; None if it shows none."""
    if window.before is None:
        return None
    time_ns: Int64 = np.concatenate([window.before.shaft.time_ns, window.shaft.time_ns])
    shaft: Float64 = np.abs(np.concatenate([window.before.shaft.value, window.shaft.value]))
    steady = window.before.shaft.value
    if len(steady) < 3 or len(window.shaft) < 3:
        return None
    time_s = np.asarray((time_ns - window.start_ns) * 1e-9, np.float64)
    high = float(np.median(np.abs(steady)))
    low = float(np.median(np.abs(window.shaft.value)))
    if not low < _FALLEN * high:
        return None
    kept = _kept_up(time_s, shaft, high, low)
    noise = float(np.median(np.abs(np.abs(steady) - high))) * 1.4826 / (high - low)
    fall = (shaft - kept) / (high - kept)
    # the last stay at full speed ends where the fall begins
    below = np.flatnonzero((fall < 0.5) & (time_s > -_EARLIEST_S))
    if len(below) == 0 or below[0] == 0:
        return None
    middle = int(below[0])
    inside = (fall > max(_BAND[0], 5.0 * noise)) & (fall < min(_BAND[1], 1.0 - 5.0 * noise))
    first = last = middle
    while first > 0 and inside[first - 1]:
        first -= 1
    while last < len(fall) and inside[last]:
        last += 1
    part = slice(first, last)
    count = last - first
    gap_s = float(time_s[middle] - time_s[middle - 1])
    if count < 3:
        # fallen between two samples
        stop_s = 0.5 * float(time_s[middle] + time_s[middle - 1])
        return RunDown(
            window.start_ns + round(stop_s * 1e9),
            gap_s / np.sqrt(12.0),
            0.0,
            0.0,
            'the shaft shows the time of the stop',
        )
    # a line through ln(fall), whose error is noise / fall
    y, weight = np.log(fall[part]), fall[part] ** 2
    centre = float((weight * time_s[part]).sum() / weight.sum())
    t = time_s[part] - centre
    slope = float((weight * t * y).sum() / (weight * t * t).sum())
    level = float((weight * y).sum() / weight.sum())
    if not slope < 0.0:
        return None
    misfit = y - level - slope * t
    spread = max(noise**2, float((weight * misfit**2).sum()) / max(count - 2, 1))
    slope_sd = np.sqrt(spread / float((weight * t * t).sum()))
    run_down_s = -1.0 / slope
    stop_s = centre + level * run_down_s
    level_sd = np.sqrt(spread / float(weight.sum()))
    return RunDown(
        window.start_ns + round(stop_s * 1e9),
        float(np.hypot(level_sd * run_down_s, slope_sd * run_down_s**2 * abs(level)))
        + _LEAST_SD * run_down_s,
        run_down_s,
        float(slope_sd * run_down_s**2) + _LEAST_SD * run_down_s,
        'the run-down of the thrust is that of the shaft',
    )
