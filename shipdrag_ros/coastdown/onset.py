# SPDX-License-Identifier: Apache-2.0
"""
Has a coastdown begun, and when?

A fall of the speed that chance does not explain, or of the shaft speed, makes a
candidate. Turns and slow-downs make candidates too: what tells them apart is
the law of the deceleration. A ship that coasts follows v' = -c v^p with p about
2 (friction) to 3 (waves); one that nears a new steady speed stops decelerating
while it is still fast, as if p were large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise

import numpy as np

from shipdrag_ros.coastdown.bins import Bins, line, speeds
from shipdrag_ros.coastdown.expectation import expect
from shipdrag_ros.coastdown.memory import Tuning
from shipdrag_ros.coastdown.tracking import SHAFT_S, shaft_fell_at, shaft_speed, turned_at
from shipdrag_ros.coastdown.validate import NEVER
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

EXCESS_MAX = 1.0  # of the exponent over the one expected: beyond it the speed settles
_LAW_BINS_MIN = 6
_GUARD = 0.1  # of confirm_s: the thrust runs down first
_TRIALS = 3  # after confirm_s, twice and three times as long
_PATIENCE = 4.0  # times confirm_s: a stopped shaft whose ship has not slowed by then


class Verdict(Enum):
    """What has become of a candidate."""

    PENDING = 'pending'
    CONFIRMED = 'confirmed'
    DISMISSED = 'dismissed'


@dataclass(frozen=True)
class Candidate:
    """
    Something that may be a coastdown.

    Attributes
    ----------
    source
        Speed source.
    start
        Its first bin, as far as is known.
    shaft
        Steady shaft speed before it [rad/s]; NaN where the speed alone speaks.
    limits
        Size of a slope that chance did not explain before it, over one, two and
        four times slope_window_s [m/s^2]; NaN while unknown.
    spread
        Standard deviation of the first of these slopes before it [m/s^2].
    judged_from
        First bin in which it is judged.
    trials
        How often its deceleration was judged.
    """

    source: int
    start: int
    shaft: float
    limits: tuple[float, ...] = ()
    spread: float = math.nan
    judged_from: int = NEVER
    trials: int = 0

    @property
    def by_shaft(self) -> bool:
        """Whether the shaft made it a candidate."""
        return not math.isnan(self.shaft)

    def falls(self, bins: Bins, number: int, width: int) -> bool:
        """
        Say whether the speed still falls faster than chance explains.
        """
        return self.falls_over(bins, number, width, 0.5) is not None

    def falls_over(self, bins: Bins, number: int, width: int, part: float) -> int | None:
        """
        Return the shortest span that shows a fall; None if none does.

        Parameters
        ----------
        part
            Of the limits, that the slope must exceed.
        """
        for scale, limit in enumerate(self.limits):
            if line(bins, self.source, number, width << scale)[0] < -part * limit:
                return width << scale
        return None


def propose(bins: Bins, tuning: Tuning, seen: Candidate, number: int) -> Candidate:
    """
    Date back what the walk saw at bin `number`.

    Parameters
    ----------
    seen
        As seen, its start being `number`.
    """
    width = tuning.slopes.width
    if seen.by_shaft:
        start = shaft_fell_at(bins, number, seen.shaft, width)
        return replace(seen, start=start, judged_from=number + SHAFT_S - 1)
    # the window that shows the fall holds its start, and one as long before it the steady speed
    span = seen.falls_over(bins, number, width, 1.0) or width
    start = change_point(bins, seen.source, number - 2 * span, number, tuning.speed_min)
    return replace(seen, start=start)


def judge(
    candidate: Candidate,
    bins: Bins,
    ship: Ship,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
) -> tuple[Verdict, Candidate]:
    """
    Judge a candidate when bin `number` has closed.

    Returns
    -------
    verdict, candidate
        The candidate with its start as it is known now.
    """
    width, confirm = tuning.slopes.width, round(parameters.confirm_s)
    pending, dismissed = (Verdict.PENDING, candidate), (Verdict.DISMISSED, candidate)
    if number < candidate.judged_from:  # the clock of the speed may be slower than the shaft's
        return pending
    level = line(bins, candidate.source, number, width)[1]
    if (
        level < tuning.speed_min
        or turned_at(bins, candidate.start, number, width, parameters.turn_rad) is not None
    ):
        return dismissed
    falls = candidate.falls(bins, number, width)
    age = number - candidate.start
    if candidate.by_shaft:
        turning = shaft_speed(bins, number) / candidate.shaft
        if turning > parameters.shaft_stopped_fraction or age > _PATIENCE * confirm:
            return dismissed
        if not falls:
            return pending
        if turning < 0.5 * parameters.shaft_stopped_fraction:
            return Verdict.CONFIRMED, candidate
    elif not falls:
        return dismissed
    if age < confirm * (candidate.trials + 1):
        return pending

    if candidate.by_shaft:
        start = candidate.start
    else:
        start = change_point(
            bins, candidate.source, candidate.start - 2 * width, number, tuning.speed_min
        )
    tried = replace(candidate, start=start)
    if 2 * (number - start) < confirm * (2 * candidate.trials + 1):
        return Verdict.PENDING, tried  # chance made it a candidate, then it began in earnest
    tried = replace(tried, trials=candidate.trials + 1)
    if _coasts(tried, bins, ship, tuning, parameters, number):
        return Verdict.CONFIRMED, tried
    return Verdict.DISMISSED if tried.trials == _TRIALS else Verdict.PENDING, tried


def _coasts(
    candidate: Candidate,
    bins: Bins,
    ship: Ship,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
) -> bool:
    """Say whether the speed since the start looks like a coastdown."""
    age = number - candidate.start
    # the longer it lasts, the longer the span that its present slope can be taken over
    span = max(tuning.slopes.width, 2 * age // 3)
    slope, level, _ = line(bins, candidate.source, number, span)
    _, before, _ = line(bins, candidate.source, candidate.start - 1, tuning.slopes.width)
    middle = level - 0.5 * slope * span
    if not before > level > 0.0 or not slope < 0.0:
        return False
    expected = expect(ship, before)
    lost = (before - level) / expected.loss(before, age)
    falling = -slope / expect(ship, middle).deceleration_m_s2
    as_expected = min(lost, falling) > expected.fraction_min

    guard = round(_GUARD * parameters.confirm_s)
    time, speed = speeds(bins, candidate.source, candidate.start + guard, number)
    if len(time) < _LAW_BINS_MIN:
        return False
    found = law(time, speed)
    if not (found.slope < 0.0 < found.speed):
        return False
    # a curvature is the difference of the slopes of two halves
    half = 0.5 * float(time[-1] - time[0])
    sd = (
        math.sqrt(2.0)
        * candidate.spread
        * (tuning.slopes.width / half**2)
        * (found.speed / found.slope**2)
    )
    excess = found.exponent - expect(ship, found.speed).exponent
    if as_expected:
        return excess - sd < EXCESS_MAX
    # a ship that is heavier than its file says: the law alone, once there is enough of it
    return candidate.trials > 1 and excess + sd < EXCESS_MAX


def change_point(bins: Bins, source: int, first: int, last: int, speed_min: float) -> int:
    """
    Return the bin at which a constant speed turns into a coastdown.

    Parameters
    ----------
    first, last
        Bins to look at; the second half of the coastdown is not needed.
    speed_min
        A speed below half of it is taken as half of it [m/s].

    Notes
    -----
    Quadratic drag makes 1/v rise linearly.
    """
    return bend(bins, source, first, last, speed_min, degree=0, sign=1)


def bend(
    bins: Bins, source: int, first: int, last: int, speed_min: float, *, degree: int, sign: int
) -> int:
    """
    Return the bin at which 1/v bends most.

    Parameters
    ----------
    degree
        Of the polynomial that 1/v follows before: 0 steady, 1 coasting.
    sign
        1: where it begins to rise faster, -1: slower.

    Notes
    -----
    Least squares of 1/v = polynomial + c max(0, t - s), s searched over all bins, and over
    each second of a gap between them.
    """
    time, speed = speeds(bins, source, first, last)
    inverse = 1.0 / np.maximum(speed, 0.5 * speed_min)
    hinges = np.concatenate([np.arange(one, other - 0.5) for one, other in pairwise(time[2:-1])])
    ramp = np.maximum(0.0, time - hinges[:, np.newaxis])
    # what the polynomial explains is taken out of both
    basis, _ = np.linalg.qr(np.vander(time, degree + 1))
    inverse = inverse - basis @ (basis.T @ inverse)
    ramp -= (ramp @ basis) @ basis.T
    gain = np.maximum(0.0, sign * (ramp @ inverse)) ** 2 / np.einsum('ij,ij->i', ramp, ramp)
    return last + math.floor(float(hinges[np.argmax(gain)]))


@dataclass(frozen=True)
class Law:
    """
    Deceleration of a span of record, from a parabola through the speed.

    Attributes
    ----------
    speed, slope, curvature
        In the middle of the span [m/s, m/s^2, m/s^3].
    """

    speed: float
    slope: float
    curvature: float

    @property
    def exponent(self) -> float:
        """The p of v' = -c v^p: p = v'' v / v'^2."""
        return self.curvature * self.speed / self.slope**2


def law(time: Float64, speed: Float64) -> Law:
    """
    Fit v = a + b t + c t^2 / 2 about the middle of the span.
    """
    middle = 0.5 * (time[0] + time[-1])
    c, b, a = np.polyfit(time - middle, speed, 2)
    return Law(float(a), float(b), 2.0 * float(c))
