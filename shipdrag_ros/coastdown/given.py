# SPDX-License-Identifier: Apache-2.0
"""
A window that a person claims is cut to what is a coastdown before anything is fitted.

The bank of regimes reads it, with the prior that she glides in it; what she does
instead is the reason of a cut.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.coastdown.events import Dismissal, NotCoastdown
from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.coastdown.regimes.given import (
    BRAKES,
    ENGINES,
    GLIDES,
    TURNS,
    WindowRegimes,
    most_revs,
    read,
    shaft_revs,
)
from shipdrag_ros.coastdown.regimes.read_out import stretches
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Float64
from shipdrag_ros.ship import Ship

_NEAR = 2.0  # bins in which the shafts date an edge
_MOST = 0.75  # of the speed lost without thrust
_SHORTEST = round(float(n.SHORTEST_S) / float(n.BIN_S))  # bins
_SPAN = tuple[int, int]


@dataclass(frozen=True)
class GivenPart:
    """
    What of a window is a coastdown.

    Attributes
    ----------
    start_ns, end_ns
        The part that is kept; the whole window where it is refused [ns].
    cuts
        What was cut and why, in order of time.
    failure
        Why it is refused, or gives no estimate; None where neither is so.
    notes
        What acts in the part that is kept, a sentence each.
    stretch
        Times [ns] and mean speeds [m/s] of the whole of it, where something was cut.
    estimate
        From what is kept; None where there is none, or none was made.
    refused
        Whether nothing of it is a coastdown.
    """

    start_ns: int
    end_ns: int
    cuts: tuple[NotCoastdown, ...] = ()
    failure: str | None = None
    notes: tuple[str, ...] = ()
    stretch: tuple[tuple[int, float], ...] = ()
    estimate: Estimate | None = None
    refused: bool = False


def estimate_given(
    window: Window,
    ship: Ship,
    parameters: Parameters,
    estimator: Callable[[Window, Ship, Parameters], Estimate],
) -> GivenPart:
    """
    Cut a window to what is a coastdown and estimate r(v) from that.

    The record before it is not known to be steady sailing; it helps to judge, and teaches the
    estimate nothing.

    Parameters
    ----------
    window
        With the record `before` it, if there is any.
    ship, parameters
    estimator
        Raises `EstimationError` where no estimate is possible.
    """
    judged = judge(window, ship, parameters)
    if judged.refused:
        return judged
    part = window.part(judged.start_ns, judged.end_ns)
    part = replace(part, before=None, notes=(*judged.notes, *part.notes))
    try:
        return replace(judged, estimate=estimator(part, ship, parameters))
    except EstimationError as error:
        return replace(judged, failure=str(error))


def judge(window: Window, ship: Ship, parameters: Parameters) -> GivenPart:
    """
    Find the part of a window that is a coastdown.

    Parameters
    ----------
    window
        With the record `before` it, if there is any.
    ship
        Its length and volume.
    parameters
        `heading_convention` and `data_stop_s` are used.

    Notes
    -----
    Of several the one in which she loses most speed is kept. Where something turns her for the
    greater part of it, that part is kept too, with a note. What is too short for the bank is
    for the estimator to judge.
    """
    whole = GivenPart(window.start_ns, window.end_ns)
    reading = read(window, ship, parameters)
    if reading is None or len(reading.binned.said) - reading.binned.before < _SHORTEST:
        return whole
    slow = float(ship.speed(parameters.froude_min))
    return _Judge(window, reading, slow, parameters.turn_rad).judgement(parameters.data_stop_s)


class _Judge:
    """One window and what the bank makes of it."""

    def __init__(
        self, window: Window, reading: WindowRegimes, slow: float, turn_rad: float
    ) -> None:
        self._slow, self._turn_rad = slow, turn_rad
        self._window = window
        self._reading = reading
        self._binned = reading.binned
        self._revs = most_revs(reading.binned)

    def judgement(self, data_stop_s: float) -> GivenPart:
        """
        Return what is kept, and why the rest is not.
        """
        window, reading = self._window, self._reading
        gaps = self._gaps(data_stop_s)
        kept, which = self._best(gaps)
        if kept is None:
            cuts = self._cuts(self._binned.before, len(self._binned.said), gaps, None)
            why = '; '.join(dict.fromkeys(f'{cut.reason.value}: {cut.text}' for cut in cuts))
            failure = f'nothing of it is a coastdown: {why}; give another window'
            return GivenPart(
                window.start_ns,
                window.end_ns,
                tuple(cuts),
                failure,
                stretch=self._shown(),
                refused=True,
            )
        first, last = reading.dates(kept, *which)
        first, last = self._stood(first, -1), self._stood(last, 1)
        for gap in gaps:
            first = max(first, gap[1]) if gap[1] == kept[0] else first
            last = min(last, gap[0]) if gap[0] == kept[1] else last
        glide, kept = kept, (kept[0], self._to_rest(kept[1]))
        start_ns = window.start_ns if kept[0] <= self._binned.before else self._ns(first)
        end_ns = window.end_ns if kept[1] >= len(self._binned.said) else self._ns(last)
        down = []
        if kept[0] <= self._binned.before and first > self._binned.before + 1:
            start_ns = self._ns(first)
            down = [
                NotCoastdown(window.start_ns, start_ns, Dismissal.THRUST, 'the thrust runs down')
            ]
        cuts = [
            *down,
            *self._cuts(self._binned.before, kept[0], gaps, kept),
            *self._cuts(kept[1], len(self._binned.said), gaps, kept),
        ]
        cuts = _fitted(cuts, start_ns, end_ns)
        notes: tuple[str, ...] = ()
        seen = any(reading.stretches(TURNS)) if TURNS in which else bool(len(window.heading))
        swing = self._swing(kept)
        if seen and swing > self._turn_rad and (TURNS in which or swing < np.inf):
            by = f'by {math.degrees(swing):.0f} degrees' if swing < np.inf else 'by her rudder'
            notes = (f'she turns {by}: the drag of drifting and turning is part of r',)
        shown = self._shown() if cuts else ()
        notes += self._turns_on(glide)
        return GivenPart(start_ns, end_ns, tuple(cuts), notes=notes, stretch=shown)

    def _stood(self, place: float, drives: int) -> float:
        """
        Return where the shafts begin or cease to stand, if they do so near a place in bins.

        `drives` is -1 where they drive before it, and 1 where they do so after it.
        """
        before = self._window.before
        parts = (self._window,) if before is None else (before, self._window)
        found = []
        for k in range(len(self._window.shafts)):
            time_ns, revs = shaft_revs(parts, k)
            at = (time_ns - self._binned.zero_ns) / (SECOND_NS * self._binned.step_s)
            near = np.abs(at - place) < _NEAR
            driving = np.abs(revs[near]) >= n.CREEPS * abs(self._revs[k])
            at, driving = at[near][::-drives], driving[::-drives]
            if len(at) and driving[0] and not driving[-1]:
                found.append(at[np.flatnonzero(driving)[-1] + (drives < 0)])
        return float(max(found) if drives < 0 else min(found)) if found else place

    def _turns_on(self, kept: _SPAN) -> tuple[str, ...]:
        """Say that a shaft turns faster than water turns it, and is taken not to drive her."""
        late = slice(kept[0] + 2 * (kept[1] - kept[0]) // 3, kept[1])  # free revs have fallen
        revs = np.abs(self._binned.said[late, s.SHAFTS : s.SHAFTS + 4])
        part = np.abs(self._binned.speed[late, np.newaxis]) / self._binned.top
        with np.errstate(invalid='ignore', divide='ignore'):
            over = revs / np.abs(self._revs) > n.WINDMILL[2] * part + n.CREEPS
        if not _mostly(over, revs):
            return ()
        return (
            'the shaft turns faster than the water turns it, though she slows as without thrust: '
            'zero pitch, a shaft that is declutched, or a sensor that is stuck',
        )

    def _best(self, gaps: list[_SPAN]) -> tuple[_SPAN | None, tuple[int, ...]]:
        """Return the bins of the coastdown, and the regimes that make it."""
        reading = self._reading

        def most(*which: int) -> tuple[_SPAN | None, float]:
            parts = [
                part
                for span in reading.stretches(*which)
                for part in _without(span, gaps)
                if part[1] - part[0] >= _SHORTEST and self._worth(part) > 0.0
            ]
            best = max(parts, key=self._worth, default=None)
            return best, 0.0 if best is None else reading.lost(best)

        both, lost = most(GLIDES, TURNS)
        if both is None:
            return None, ()
        alone, lost_alone = most(GLIDES)
        if self._swing(both) > self._turn_rad and lost_alone >= _MOST * lost:
            return alone, (GLIDES,)
        return both, (GLIDES, TURNS)

    def _to_rest(self, end: int) -> int:
        """Return the last bin, where she is all but at rest from there on: that tells nothing."""
        # as the bank has it, readings of a ship at rest have the sd `rest`
        rests = np.abs(self._binned.speed[end - 1 :]) < 2.0 * self._reading.rest
        return len(self._binned.said) if np.all(rests) else end

    def _swing(self, span: _SPAN) -> float:
        """Return the angle over which the heading swings in some bins [rad]."""
        bins = self._binned.said[span[0] : span[1]]
        # where nothing shows what the rudder turns her by
        if not np.isfinite(bins[:, s.RATE]).mean() > 0.5:
            return np.inf if np.isfinite(bins[:, s.RUDDER]).any() else 0.0
        return float(np.ptp(np.cumsum(np.nan_to_num(bins[:, s.RATE]))) * self._binned.step_s)

    def _worth(self, span: _SPAN) -> float:
        """Return the time that is kept, times the part of the speed that is lost in it."""
        speed = self._binned.speed[span[0] : span[1]]
        speed = speed[np.isfinite(speed)]
        first = float(speed[:3].mean()) if len(speed) else 0.0
        if not first > self._slow:
            return -1.0
        return (span[1] - span[0]) * self._reading.lost(span) / first

    def _gaps(self, data_stop_s: float) -> list[_SPAN]:
        """Return the bins of stretches in which nothing shows the motion for long."""
        silent = ~np.isfinite(self._binned.speed)
        return [
            (a, b) for a, b in stretches(silent) if (b - a) * self._binned.step_s > data_stop_s
        ]

    def _cuts(
        self, first: int, last: int, gaps: list[_SPAN], kept: _SPAN | None
    ) -> list[NotCoastdown]:
        """Say what she does in some bins, a stretch of one regime each."""
        regime = self._reading.probability.argmax(axis=0)
        for a, b in gaps:
            regime[a:b] = len(self._reading.probability)
        changes = first + 1 + np.flatnonzero(np.diff(regime[first:last]))
        edges = pairwise([first, *changes.tolist(), last])
        return [self._cut(a, b, int(regime[a]), kept) for a, b in edges if b > a]

    def _cut(self, first: int, last: int, regime: int, kept: _SPAN | None) -> NotCoastdown:
        binned = self._binned
        reason, text = self._why(first, last, regime, kept)
        if regime < len(self._reading.probability):
            text += f' (P {self._reading.probability[regime, first:last].mean():.2f})'
        else:
            text += f' for {(last - first) * binned.step_s:.0f} s'
        end_ns = self._window.end_ns if last == len(binned.said) else self._ns(last)
        return NotCoastdown(self._ns(first), end_ns, reason, text)

    def _why(
        self, first: int, last: int, regime: int, kept: _SPAN | None
    ) -> tuple[Dismissal, str]:
        """Name the reason of a cut."""
        speed = self._binned.speed[first:last]
        before = kept is None or last <= kept[0]
        braked = regime == BRAKES
        if kept is not None and regime == ENGINES:  # beside the glide next to it
            near = kept[0] if before else max(kept[1] - _SHORTEST, kept[0])
            braked = self._slows(first, last) > self._slows(near, near + _SHORTEST)
        if not braked and 0.0 <= np.nanmax(speed, initial=-1.0) < self._slow:
            fastest = float(np.nanmax(speed))
            text = f'she is slower than {self._slow:.2g} m/s, too slow for a coastdown'
            return Dismissal.SLOW, f'{text}: {fastest:.2g} m/s at most'
        if np.nansum(speed) < 0.0:
            fastest = -float(np.nanmin(speed))
            return Dismissal.ASTERN, f'the ship goes astern, at up to {fastest:.2g} m/s'
        if regime == GLIDES and kept is None:
            return Dismissal.PLATEAU, 'nothing of it slows her for long enough'
        if regime == ENGINES:
            turning = self._binned.said[first:last, s.SHAFTS : s.SHAFTS + 4]
            revs = np.nan_to_num(turning / np.maximum(np.abs(self._revs), 1e-9))
            if self._reversed(turning):
                return Dismissal.ASTERN, 'the propeller is reversed'
            if np.abs(revs).max(initial=0.0) > n.CREEPS:
                return Dismissal.THRUST, 'the shaft turns as if it drove her'
            if braked:
                return Dismissal.BRAKE, 'something but the water slows her'
            if before:
                return Dismissal.LEAD_IN, 'she does not slow as a ship that glides, as if driven'
            return Dismissal.PLATEAU, 'she slows no longer as a ship that glides'
        return {
            GLIDES: (Dismissal.OTHER, 'she glides, but a better part is kept'),
            BRAKES: (Dismissal.BRAKE, 'something but the water slows her'),
            TURNS: (Dismissal.TURN, 'she turns'),
        }.get(regime, (Dismissal.GAP, 'no speed and no position'))

    def _slows(self, first: int, last: int) -> float:
        """Return the speed that she loses in a bin [m/s]."""
        speed = self._binned.speed[max(first - 1, 0) : last]
        there = np.flatnonzero(np.isfinite(speed))
        if len(there) < 2:
            return 0.0
        return float((speed[there[0]] - speed[there[-1]]) / (there[-1] - there[0]))

    def _reversed(self, turning: Float64) -> bool:
        """Say whether a shaft turns the other way than it mostly does."""
        with np.errstate(invalid='ignore'):
            against = turning * np.sign(self._revs) < -n.CREEPS * np.abs(self._revs)
        return _mostly(against, turning)

    def _shown(self) -> tuple[tuple[int, float], ...]:
        """Return the speed of the window, for a picture."""
        binned = self._binned
        return tuple(
            (self._ns(k + 0.5), float(binned.speed[k]))
            for k in range(binned.before, len(binned.speed))
            if np.isfinite(binned.speed[k])
        )

    def _ns(self, place: float) -> int:
        """Return the time of a place in bins."""
        time_ns = self._binned.zero_ns + round(place * self._binned.step_s * SECOND_NS)
        return min(max(time_ns, self._window.start_ns), self._window.end_ns)


def _mostly(so: NDArray[np.bool_], revs: Float64) -> bool:
    """Say whether something holds of a shaft in most bins that one is read in."""
    read_in = np.isfinite(revs).any(axis=1)
    return bool(read_in.any() and so[read_in].any(axis=1).mean() > 0.5)


def _without(span: _SPAN, gaps: list[_SPAN]) -> list[_SPAN]:
    left, at = [], span[0]
    for first, last in (*gaps, (span[1], span[1])):
        if min(first, span[1]) > at:
            left.append((at, min(first, span[1])))
        at = max(at, last)
    return left


def _fitted(cuts: list[NotCoastdown], start_ns: int, end_ns: int) -> list[NotCoastdown]:
    """Let cuts end where the part that is kept begins, and begin where it ends."""
    before = [cut for cut in cuts if cut.start_ns < start_ns]
    after = [cut for cut in cuts if cut.start_ns >= start_ns and cut.end_ns > end_ns]
    # a shaft dates an edge better than the bins
    before[-1:] = [replace(cut, end_ns=start_ns) for cut in before[-1:]]
    after[:1] = [replace(cut, start_ns=end_ns) for cut in after[:1]]
    return [*before, *after]
