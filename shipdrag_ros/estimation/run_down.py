# SPDX-License-Identifier: Apache-2.0
"""The engine stop: when it was, and what is known of the thrust after it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.inference.decision import mixture
from shipdrag_ros.inference.rows import MAD_TO_SD, block_medians
from shipdrag_ros.posterior.priors import RUN_DOWN, STOP, TOLD, TOLD_CHANCE
from shipdrag_ros.samples import SECOND_NS, SHAFTS, Float64
from shipdrag_ros.ship import Ship

_SUDDEN_S = 30.0  # slower than this, a shaft that follows the ship seems to run down
TURNS = 0.05  # of the shaft speed under power: a shaft that is slower stands
_AT_START = 1.0  # run-downs after the start of a window: a stop by then is at the start
_GONE = 5.0  # run-downs after which the shaft turns on by the water, or is driven


_BAND = (0.08, 0.92)  # of the fall of the shaft speed from which its decay is found
_FALLEN = 0.9  # of the steady turns a metre: at more the engine was not stopped
_EARLIEST_S = 300.0  # before the onset as found
_SOON = (8.0, 16.0)  # after the fall, in half-lives
_ROUNDS = 3
_LEAST_SD = 0.01  # of the run-down, relative: no shaft falls exactly so
_FEW = 3  # samples that show a level
_BLOCKS = 40  # of a window, whose median speeds are taken
_SLOWEST = 0.05  # of her first speed: below it the readings are noise
_LONGEST = 0.15  # of the window: what falls more slowly falls with the ship
STANDS_RAD_S = 0.5  # no propeller of a ship drives at less
_SLOWED, _ALIKE = 0.85, 0.2  # a ship has slowed down; a shaft has, as much


@dataclass(frozen=True)
class Fall:
    """
    An exponential fall of a shaft speed or pitch.

    Attributes
    ----------
    stop_s, stop_sd_s
        When it began, from the start of the window, and its standard deviation.
    run_down_s, run_down_sd_s
        Its time constant; 0: fallen between two samples.
    kept
        What is left after the fall, over the steady value.
    """

    stop_s: float
    stop_sd_s: float
    run_down_s: float
    run_down_sd_s: float
    kept: float


@dataclass(frozen=True)
class Slowing:
    """
    The speed of a ship over that at the start of a window.

    Attributes
    ----------
    time_s, ratio : (n,)
        From the start of the window [s]; 1 before it.
    """

    time_s: Float64
    ratio: Float64

    @classmethod
    def of(cls, window: Window) -> Slowing | None:
        """
        Take it from a speed that was read, in medians; None where there is none.
        """
        for series in window.each('speed_through_water', 'speed_over_ground'):
            if len(series) >= _BLOCKS:
                time_s = np.asarray((series.time_ns - window.start_ns) * 1e-9, np.float64)
                many, more = divmod(len(series), _BLOCKS)
                edges = many * np.arange(1 + _BLOCKS) + np.minimum(np.arange(1 + _BLOCKS), more)
                speed = block_medians(np.abs(series.value), edges)
                middle = block_medians(time_s, edges)
                first = speed[0] + 0.5 * max(speed[0] - speed[1], 0.0)
                if not first > 0.0:
                    return None
                ratio = np.clip(speed / first, _SLOWEST, 1.0)
                return cls(np.concatenate([[0.0], middle]), np.concatenate([[1.0], ratio]))
        return None

    def at(self, time_s: Float64) -> Float64:
        """
        Return the ratio at (m,) times.
        """
        return np.interp(time_s, self.time_s, self.ratio)


def find_fall(
    before: Series | None, series: Series, start_ns: int, speed: Slowing | None = None
) -> Fall | None:
    """
    Fit an exponential fall to a shaft speed or pitch; None if it shows none.

    Parameters
    ----------
    before, series
        In the record before the window, and in the window. Without the first
        the window itself must show the steady value.
    start_ns
        Of the window.
    speed
        How the ship slows down, for a shaft: what the water turns falls with her, and is
        not the run-down of an engine.
    """
    if len(series) < _FEW:
        return None
    has_before = before is not None and len(before) >= _FEW
    parts = [before, series] if before is not None and has_before else [series]
    time_s = np.concatenate([(part.time_ns - start_ns) * 1e-9 for part in parts])
    shaft: Float64 = np.abs(np.concatenate([part.value for part in parts]))
    if speed is not None:
        shaft = shaft / speed.at(time_s)
    steady = shaft[: len(parts[0])] if has_before else shaft[:_FEW]
    high = float(np.median(steady) if has_before else steady.max())
    low = float(np.median(shaft[-len(series) :]))
    if not low < _FALLEN * high:
        return None
    scatter = np.abs(steady - high) if has_before else np.abs(np.diff(shaft)) / np.sqrt(2.0)
    noise = float(np.median(scatter)) * MAD_TO_SD / (high - low)
    kept = _kept_up(time_s, shaft, high, low)
    fall = (shaft - kept) / (high - kept)
    # the last stay at full speed ends where the fall begins
    below = np.flatnonzero((fall < 0.5) & (time_s > -_EARLIEST_S))
    if len(below) == 0 or below[0] == 0:
        return None
    found = _fit_fall(time_s, fall, int(below[0]), noise, float(kept[below[0]]) / high)
    if found is not None and found.run_down_s > _LONGEST * float(time_s[-1]):
        return None
    return found


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
        if soon.sum() < _FEW:
            break
        slope, level = np.polyfit(after[soon], shaft[soon], 1)
        top = _FALLEN * high
        kept = np.clip(level + min(slope, 0.0) * np.clip(after, 0.0, _SOON[1]), 0.0, top)
    return kept


def _fit_fall(
    time_s: Float64, fall: Float64, middle: int, noise: float, kept: float
) -> Fall | None:
    """Fit a line through ln(fall) about the sample at which half of it is gone."""
    inside = (fall > max(_BAND[0], 5.0 * noise)) & (fall < min(_BAND[1], 1.0 - 5.0 * noise))
    first = last = middle
    while first > 0 and inside[first - 1]:
        first -= 1
    while last < len(fall) and inside[last]:
        last += 1
    part = slice(first, last)
    count = last - first
    gap_s = float(time_s[middle] - time_s[middle - 1])
    if count < _FEW:
        # fallen between two samples
        stop_s = 0.5 * float(time_s[middle] + time_s[middle - 1])
        return Fall(stop_s, gap_s / np.sqrt(12.0), 0.0, 0.0, kept)
    # the error of the line is noise / fall
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
    level_sd = np.sqrt(spread / float(weight.sum()))
    stop_sd_s = float(np.hypot(level_sd * run_down_s, slope_sd * run_down_s**2 * abs(level)))
    return Fall(
        centre + level * run_down_s,
        stop_sd_s + _LEAST_SD * run_down_s,
        run_down_s,
        float(slope_sd * run_down_s**2) + _LEAST_SD * run_down_s,
        kept,
    )


def say(
    name: str, shaft: Series, window: Window, since_ns: int, earlier: Series | None = None
) -> str:
    """
    Say what a shaft shows that turns on, or does not turn.

    Parameters
    ----------
    name
        Of the shaft, for the sentence.
    shaft
        In the window.
    since_ns
        From when on it is looked at.
    earlier
        The shaft in the record before the window.
    """
    rate = np.abs(shaft.value[shaft.time_ns >= since_ns])
    low, high = (float(value) for value in np.quantile(rate, (0.05, 0.95)))
    if high < STANDS_RAD_S:
        if _stood(earlier):
            return f'{name} stood before the stop too: it shows nothing, or its sensor is dead'
        return f'{name} stands whenever it is received in the window: no thrust is left then'
    turns = f'{name} turns at {low:.3g} to {high:.3g} rad/s'
    for speed in window.each('speed_through_water', 'speed_over_ground'):
        later = speed.value[speed.time_ns >= since_ns]
        if len(later) >= _FEW:
            slowed, of_shaft = _ratio(later), _ratio(rate)
            if slowed < _SLOWED and abs(of_shaft - slowed) < _ALIKE * slowed:
                return f'{turns}, as the water turns it: the drag of its propeller is part of r'
            break
    stops = len(rate) > _FEW and float(rate[-_FEW:].max()) < STANDS_RAD_S
    remedy = '; give a window that begins after the shaft has stopped' if stops else ''
    return (
        f'{turns} and not as the water turns it: if it drives the ship, r may be off by its '
        f'thrust{remedy}'
    )


def _stood(earlier: Series | None) -> bool:
    """Say whether a shaft is seen to stand in the record before the window."""
    past = np.empty(0) if earlier is None else np.abs(earlier.value)
    return len(past) >= _FEW and bool(np.median(past) < STANDS_RAD_S)


def _ratio(value: Float64) -> float:
    """Return the value in the last fifth over that in the first."""
    part = max(len(value) // 5, 1)
    first, last = (float(np.median(np.abs(of))) for of in (value[:part], value[-part:]))
    return last / first if first > 0.0 else np.inf


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
    shaft_s, shaft_sd_s
        Time constant of the shaft and its standard deviation; how the thrust follows it is
        fitted. 0: not known.
    notes
        A sentence each.
    by_shaft
        Whether a shaft or pitch dates the stop.
    stands
        Whether all propellers that are read are seen to stand after that, and drive no more.
    """

    stop_ns: int
    stop_sd_s: float
    shaft_s: float
    shaft_sd_s: float
    notes: tuple[str, ...]
    by_shaft: bool = False
    stands: bool = False

    @classmethod
    def of(cls, window: Window, ship: Ship) -> RunDown:
        """
        Learn of the stop from shafts and pitches, or else take what the ship file states.

        Of several propellers the stop is that of the last; of shaft speed and
        pitch of one, whichever falls first.
        """
        falls = list(_falls(window))
        others = tuple(_others(window, {number for number, _, _ in falls}))
        stands = _stand(window, falls)
        if falls:
            _, seen, fall = max(falls, key=lambda one: one[2].stop_s)
            others += tuple(_kept(window, falls))
            if window.before is not None or fall.stop_s <= _AT_START * fall.run_down_s:
                return cls._of_fall(window, seen, fall, others, stands)
            # nothing is known of the speed before it
            note = (
                f'{seen} shows an engine stop {fall.stop_s:.3g} s after the start of the window: '
                'r is off by the thrust before it; give a window that begins after it'
            )
            return cls(window.start_ns, 0.0, 0.0, 0.0, (note, *others))
        if window.before is None:
            note = 'the thrust is taken to have ended before the window'
            return cls(window.start_ns, 0.0, 0.0, 0.0, others or (note,))
        if ship.propulsion is None:
            note = (
                f'neither shaft nor ship file says how the thrust ends: fitted, about '
                f'{RUN_DOWN.mean:g} s beforehand (propulsion: in the ship file would say it)'
            )
            return cls(*_dated(window), 0.0, 0.0, (note, *others), stands=stands)
        run_down_s = ship.propulsion.run_down_s
        note = (
            f'the thrust is taken to end within about {run_down_s:.3g} s, by the ship file: how '
            'it does is fitted'
        )
        sd_s = ship.propulsion.sd
        return cls(*_dated(window), run_down_s, sd_s, (note, *others), stands=stands)

    @classmethod
    def _of_fall(
        cls, window: Window, seen: str, fall: Fall, others: tuple[str, ...], stands: bool
    ) -> RunDown:
        notes = [f'{seen} shows the time of the stop']
        if fall.run_down_s > 0.0:
            notes = [
                f'{seen} shows the stop and runs down in {fall.run_down_s:.2g} s; the thrust may '
                'be gone at once or follow it: that is fitted, and in the band'
            ]
        return cls(
            window.start_ns + round(fall.stop_s * 1e9),
            fall.stop_sd_s,
            fall.run_down_s,
            fall.run_down_sd_s,
            (*notes, *others),
            by_shaft=True,
            stands=stands,
        )


def chance_told(off_s: float) -> float:
    """
    Return the probability that a stop told so long after an onset [s] is that of the onset.

    Else it is told at any time within the hour.
    """
    of_both = STOP.sd**2 + TOLD.sd**2
    density = math.exp(-0.5 * off_s**2 / of_both) / math.sqrt(2.0 * math.pi * of_both)
    right = TOLD_CHANCE.mean * 3600.0 * density
    return right / (right + 1.0 - TOLD_CHANCE.mean)


def _dated(window: Window) -> tuple[int, float]:
    """Return the stop [ns] and its sd [s], by the onset and by what a person told."""
    if window.told_ns is None:
        return window.start_ns, STOP.sd
    off = (window.told_ns - window.start_ns) / SECOND_NS
    p, of_both = chance_told(off), STOP.sd**2 + TOLD.sd**2
    mean, variance = off * STOP.sd**2 / of_both, STOP.sd**2 * TOLD.sd**2 / of_both
    later_s, sd_s = mixture(((p, mean, math.sqrt(variance)), (1.0 - p, 0.0, STOP.sd)))
    return window.start_ns + round(later_s * SECOND_NS), sd_s


def _falls(window: Window) -> Iterator[tuple[int, str, Fall]]:
    """Yield number, name and fall of each propeller that shows one."""
    before = window.before
    slowing = Slowing.of(window) if any(map(len, window.shafts)) else None
    for number in range(len(SHAFTS)):
        of_propeller = []
        for what, all_of in (('shaft', 'shafts'), ('pitch', 'pitches')):
            earlier = None if before is None else getattr(before, all_of)[number]
            series = getattr(window, all_of)[number]
            by = slowing if what == 'shaft' else None
            fall = find_fall(earlier, series, window.start_ns, by)
            if fall is None and by is not None:  # an engine may hold it while the ship slows down
                fall = find_fall(earlier, series, window.start_ns)
                if fall is not None and fall.run_down_s > _SUDDEN_S:
                    fall = None
            if fall is not None:
                of_propeller.append((number, _name(window, what, number), fall))
        if of_propeller:
            yield min(of_propeller, key=lambda one: one[2].stop_s)


def _stand(window: Window, falls: list[tuple[int, str, Fall]]) -> bool:
    """Say whether propellers are read, and none of them turns after the stop."""
    stand = {number: fall.kept < TURNS for number, _, fall in falls}
    for number, shaft in enumerate(window.shafts):
        earlier = None if window.before is None else window.before.shafts[number]
        if len(shaft) and number not in stand and not _stood(earlier):
            stand[number] = bool(np.quantile(np.abs(shaft.value), 0.95) < STANDS_RAD_S)
    return bool(stand) and all(stand.values())


def _kept(window: Window, falls: list[tuple[int, str, Fall]]) -> Iterator[str]:
    """Yield what the shafts show that fell, but go on turning."""
    for number, name, fall in falls:
        after_s = fall.stop_s + _GONE * fall.run_down_s
        since_ns = window.start_ns + round(after_s * 1e9)
        shaft = window.shafts[number]
        if fall.kept > TURNS and 'shaft' in name and np.any(shaft.time_ns >= since_ns):
            yield say(name, shaft, window, since_ns)


def _others(window: Window, fallen: set[int]) -> Iterator[str]:
    """Yield what the shafts show that do not fall."""
    for number, shaft in enumerate(window.shafts):
        if len(shaft) and number not in fallen:
            earlier = None if window.before is None else window.before.shafts[number]
            yield say(_name(window, 'shaft', number), shaft, window, window.start_ns, earlier)


def _name(window: Window, what: str, number: int) -> str:
    """Return how to speak of a shaft or pitch."""
    several = sum(len(shaft) > 0 for shaft in window.shafts) > 1
    return f'the {what} of propeller {number + 1}' if several else f'the {what}'
