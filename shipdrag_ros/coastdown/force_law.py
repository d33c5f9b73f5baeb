# SPDX-License-Identifier: Apache-2.0
"""
Where the speed alone shows that something but the water acts.

The deceleration a of a body that coasts falls with its speed, by a power from 0
(dry friction of wheels) to 4 or so (waves): v' = -(c0 + c1 v + c2 v^2 + c4 v^4), no c
negative. A change point is where one such law does not hold, and two do: before
it and after it. Nothing here has a unit, so that 7 s of a car at 100 Hz and 40 min
of a tanker at 1 Hz are one case.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.coastdown.events import Dismissal
from shipdrag_ros.coastdown.readings import binned
from shipdrag_ros.inference.rows import MAD_TO_SD
from shipdrag_ros.samples import Float64

_LEAST = 8  # bins in which a law can be separated from another
_EDGE = 3  # bins at least on each side of a change
_POWERS = (0, 1, 2, 4)
_STEEPEST_POWER = 5.0
_NEAR = 6  # bins after a change
SIGNIFICANT = 60.0  # gain of a change: chance reaches it in 1 clean coastdown of 100 or less
STRONG = 20.0  # the same where the deceleration grows to `_STRONGLY` times what it was
_STRONGLY = 4.0
_QUICKER = 1.5  # times the deceleration before: no hump of wave making does that
_GENTLER = 0.4  # of the least that coasting on leaves
_SURE = 5.0  # standard deviations of a bin
_RISE = 0.03  # of the highest speed
_ROUNDS = 8
_AT_REST = 0.05  # of the highest speed
_AT_REST_BINS = 3
# deceleration over what is usual for her
_DRIVEN = 0.5
_IDLE = 0.15
_USUAL = 2.0
_HELD = 3.0
_ALIKE = 0.9  # most that neighbours may be alike before slow noise is taken for a law
FURTHER = 8.0  # the same where a cut has been made beside it, and may have begun sooner
_REACH = 0.2  # of what is left
_EXACT = 1e-4  # of the speed: no record is better than that


@dataclass(frozen=True)
class Change:
    """
    Where the law of force changes.

    Attributes
    ----------
    at_s
        Time of it [s].
    speed
        At that time [m/s].
    before, after_at_once, after
        Deceleration up to it by the law before it, just after it, and of all
        that follows [m/s^2].
    gentlest_at_once, gentlest
        What the two decelerations after it are at least by the law before it [m/s^2].
    gain
        By how much two laws fit better than one, in variances of what they leave.
    """

    at_s: float
    speed: float
    before: float
    after_at_once: float
    after: float
    gentlest_at_once: float
    gentlest: float
    gain: float

    @property
    def quickens(self) -> bool:
        """Whether the ship slows down faster than she did when she was faster."""
        return self.after_at_once > _QUICKER * self.before and self.after > self.before

    @property
    def ceases(self) -> bool:
        """Whether she all but ceases to slow down."""
        return self.before > 0.0 and self.after < _GENTLER * self.gentlest

    @property
    def eases(self) -> bool:
        """Whether she slows down far less at once, as where a brake is let go."""
        return self.before > 0.0 and self.after_at_once < _GENTLER * self.gentlest_at_once


@dataclass(frozen=True)
class Cut:
    """
    A part that is no coasting [s], at the end or the beginning of a stretch.

    `quickened` is the deceleration after the change over that before it.
    """

    start_s: float
    end_s: float
    at_end: bool
    reason: Dismissal
    text: str
    quickened: float = 0.0


class _ForceLaw:
    """One law on a stretch of bins."""

    def __init__(self, time_s: Float64, speed: Float64, scale: float) -> None:
        from scipy.optimize import nnls  # slow to import

        u = speed / scale
        size = np.abs(u)
        columns = [np.ones(len(u)), -np.ones(len(u))]
        self._powers = np.array([size**p * np.sign(u) for p in _POWERS])
        steps = np.diff(time_s)
        for rate in self._powers:
            columns.append(
                -np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * steps)])
            )
        table = np.column_stack(columns)
        span = float(time_s[-1] - time_s[0])
        table[:, 2:] /= span
        found, _ = nnls(table, u)
        residual = u - table @ found
        self.residual: Float64 = scale * residual
        self._rates = scale * found[2:] / span
        self.deceleration: Float64 = self._rates @ self._powers


def change_point(time_s: Float64, speed: Float64) -> Change | None:
    """
    Find where the deceleration leaves what coasting on allows, most clearly.

    Parameters
    ----------
    time_s, speed : (n,)
        Binned.

    Returns
    -------
    Change or None
        None where there is no such place, whatever the noise.
    """
    n = len(time_s)
    scale = float(np.max(np.abs(speed), initial=0.0))
    if n < _LEAST or scale == 0.0:
        return None
    whole = _ForceLaw(time_s, speed, scale)
    alone = float(whole.residual @ whole.residual)
    least, best, found = np.inf, np.inf, None
    left = whole.residual
    for at in range(_EDGE, n - _EDGE + 1):
        first, second = (
            _ForceLaw(time_s[:at], speed[:at], scale),
            _ForceLaw(time_s[at:], speed[at:], scale),
        )
        both = np.concatenate([first.residual, second.residual])
        total = float(both @ both)
        if total < least:
            least, left = total, both
        if total < best:
            change = _change(time_s, speed, at, float(first.deceleration[-1]))
            if change.quickens or change.ceases or change.eases:
                best, found = total, change
    if found is None:
        return None
    # slow noise makes neighbours alike, and what chance gains large
    alike = float(np.clip(left[1:] @ left[:-1] / least, 0.0, _ALIKE)) if least > 0.0 else 0.0
    variance = least / max(n - _LEAST, 1) * (1.0 + alike) / (1.0 - alike)
    return replace(found, gain=(alone - best) / max(variance, (_EXACT * scale) ** 2))


def _change(time_s: Float64, speed: Float64, at: int, before: float) -> Change:
    near = slice(at, min(at + _NEAR, len(speed)))
    slower = np.clip(speed[at:] / max(float(speed[at - 1]), 1e-12), 0.0, 1.0) ** _STEEPEST_POWER
    return Change(
        at_s=float(0.5 * (time_s[at - 1] + time_s[at])),
        speed=float(speed[at]),
        before=before,
        after_at_once=-_slope(time_s[near], speed[near]),
        after=-_slope(time_s[at:], speed[at:]),
        gentlest_at_once=before * float(np.mean(slower[:_NEAR])),
        gentlest=before * float(np.mean(slower)),
        gain=np.nan,
    )


def _slope(time_s: Float64, speed: Float64) -> float:
    away = time_s - np.mean(time_s)
    return float(away @ speed / (away @ away))


def departures(time_s: Float64, speed: Float64, expected: Callable[[float], float]) -> list[Cut]:
    """
    Find what is no coasting in a stretch of speed, and cut it off its ends.

    Parameters
    ----------
    time_s, speed : (n,)
        Readings, from `readings`.
    expected
        Deceleration of this ship at a speed, as far as it is known [m/s^2].

    Returns
    -------
    list of Cut
        In the order found; what is between them is kept.
    """
    cuts: list[Cut] = []
    if len(time_s) < _LEAST:
        return cuts
    first, last = float(time_s[0]), float(time_s[-1])
    for _ in range(_ROUNDS):
        inside = (time_s >= first) & (time_s <= last)
        t, v = binned(time_s[inside], speed[inside])
        if len(t) < _LEAST:
            break
        cut = _rise(t, v) or _departure(t, v, expected, SIGNIFICANT)
        if cut is None and cuts:
            cut = _more_of_it(cuts[-1], t, _departure(t, v, expected, FURTHER))
        if cut is None:
            break
        if cut.at_end:
            cut = replace(cut, end_s=last)
            last = cut.start_s
        else:
            cut = replace(cut, start_s=first)
            first = cut.end_s
            # no law held across what is cut now: what that made of the end is judged anew
            cuts, last = [each for each in cuts if not each.at_end], float(time_s[-1])
        if cuts and (cut.reason, cut.at_end) == (cuts[-1].reason, cuts[-1].at_end):
            before = cuts.pop()
            start_s, end_s = min(cut.start_s, before.start_s), max(cut.end_s, before.end_s)
            cut = replace(before, start_s=start_s, end_s=end_s)
        cuts.append(cut)
    return cuts


def _more_of_it(last: Cut, t: Float64, cut: Cut | None) -> Cut | None:
    """Return a further cut where it shows that the last one should have been longer."""
    if cut is None or (cut.reason, cut.at_end) != (last.reason, last.at_end):
        return None
    reach = float(t[-1]) - cut.start_s if cut.at_end else cut.end_s - float(t[0])
    return cut if reach <= _REACH * float(t[-1] - t[0]) else None


def _rise(t: Float64, v: Float64) -> Cut | None:
    """Cut what is before the highest speed, where the speed rises to it."""
    top = int(np.argmax(v))
    noise = MAD_TO_SD * float(np.median(np.abs(np.diff(v, 2)))) / 6.0**0.5
    rise = float(v[top] - v[0])
    if top == 0 or rise < max(_SURE * noise, _RISE * float(v[top])):
        return None
    return Cut(
        float(t[0]),
        float(t[top] + 0.5 * (t[1] - t[0])),
        False,
        Dismissal.LEAD_IN,
        f'the speed rises from {v[0]:.3g} to {v[top]:.3g} m/s: the coast is after it',
    )


def _departure(
    t: Float64, v: Float64, expected: Callable[[float], float], bar: float
) -> Cut | None:
    # a ship all but at rest drifts with wind and current
    slow = np.flatnonzero(v < _AT_REST * float(v.max()))
    if len(slow):
        t, v = t[: slow[0] + _AT_REST_BINS], v[: slow[0] + _AT_REST_BINS]
    change = change_point(t, v)
    if change is None:
        return None
    usual = max(expected(max(change.speed, 1e-6)), 1e-12)
    here, there = change.before / usual, change.after_at_once / usual
    if here > _IDLE and there > _STRONGLY * here:
        bar = min(bar, STRONG)
    if change.gain < bar:
        return None
    then = (
        f'at {change.speed:.3g} m/s she slows by {_shown(change.before)} m/s² up to there and '
        f'by {_shown(change.after_at_once)} m/s² after it'
    )
    if change.quickens and here < (_DRIVEN if there < _HELD else _IDLE):
        text = f'{then}: she hardly slows at first, as if driven'
        return Cut(float(t[0]), change.at_s, False, Dismissal.LEAD_IN, text)
    if change.quickens:
        text = f'{then}, more than water can do: something stops her'
        quickened = change.after_at_once / max(change.before, 1e-12)
        return Cut(change.at_s, float(t[-1]), True, Dismissal.BRAKE, text, quickened)
    # noise makes what follows at once uncertain where little follows
    if here > _HELD and any(_DRIVEN < each < _USUAL for each in (there, change.after / usual)):
        text = f'{then}: something but the water slows her at first'
        return Cut(float(t[0]), change.at_s, False, Dismissal.BRAKE, text)
    if not change.ceases:
        return None
    text = (
        f'at {change.speed:.3g} m/s she slows by {_shown(change.after)} m/s² on average, where '
        f'coasting on leaves at least {_shown(change.gentlest)} m/s²: she no longer slows down'
    )
    return Cut(change.at_s, float(t[-1]), True, Dismissal.PLATEAU, text)


def _shown(deceleration: float) -> str:
    return f'{deceleration:.2g}'
