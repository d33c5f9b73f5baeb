# SPDX-License-Identifier: Apache-2.0
"""
Has a coastdown begun, and when?

A fall of the speed that chance does not explain, or of a shaft or its pitch,
makes a candidate. Turns and slow-downs make candidates too: what sets them
apart is the law of the deceleration. A ship that coasts follows v' = -c v^p
with p about 2 (friction) to 3 (waves); one that nears a new steady speed stops
decelerating while it is still fast, as if p were large.

Shafts are evidence and have no veto: they date the stop, a propeller that
stands or follows the ship confirms it sooner, one that seems to drive asks
for more of the law of the speed. Only a reversed one speaks for itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

from shipdrag_ros.coastdown.bins import Bins, line, speeds
from shipdrag_ros.coastdown.deceleration import begin_of_fall, fit_deceleration
from shipdrag_ros.coastdown.events import Dismissal
from shipdrag_ros.coastdown.expectation import expect
from shipdrag_ros.coastdown.memory import Tuning
from shipdrag_ros.coastdown.shafts import (
    SHAFT_S,
    UNKNOWN_THRUST,
    Drive,
    ShaftEvidence,
    SpeedEvidence,
    Thrust,
    propulsion,
    steady_drive,
)
from shipdrag_ros.coastdown.steadiness import Steadiness
from shipdrag_ros.coastdown.tracking import turned_at
from shipdrag_ros.coastdown.validate import NEVER
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

EXCESS_MAX = 1.0  # of the exponent over the one expected: beyond it the speed settles
# A ship that is stopped by more than the water decelerates this much more than expected, ...
_BRAKED = 1.5
_BRAKE_EXPONENT = 1.0  # ... and by a force that falls less than in proportion to the speed
_LAW_BINS_MIN = 6
_GUARD = 0.1  # of confirm_s: the thrust runs down first
_TRIALS = 3  # after confirm_s, twice and three times as long
_PATIENCE = 4.0  # times confirm_s: a stopped shaft whose ship has not slowed by then
_APART = 3  # slope windows that the dates of shaft and speed may be apart


class OnsetDecision(Enum):
    """What has become of a candidate."""

    PENDING = 'pending'
    CONFIRMED = 'confirmed'
    DISMISSED = 'dismissed'


@dataclass(frozen=True)
class Doubt:
    """What speaks against a coastdown; `text` is one sentence with figures."""

    reason: Dismissal
    text: str


@dataclass(frozen=True)
class OnsetJudgement:
    """
    What has become of a candidate, with its start as it is known now.

    `doubt` is there where it was dismissed, unless it is not worth a word.
    """

    decision: OnsetDecision
    candidate: OnsetCandidate
    doubt: Doubt | None = None


@dataclass(frozen=True)
class OnsetCandidate:
    """
    Something that may be a coastdown.

    Attributes
    ----------
    source
        Speed source.
    start
        Its first bin, as far as is known.
    drive
        Steady drive of the propellers before it.
    noticed
        Whether the speed made it a candidate; if not, a shaft alone did.
    limits
        Size of a slope that chance did not explain before it, over one, two and
        four times slope_window_s [m/s^2]; NaN while unknown.
    slope_sd
        Standard deviation of the first of these slopes before it [m/s^2].
    judged_from
        First bin in which it is judged.
    trials
        How often its deceleration was judged.
    doubt
        Why the last of these did not show a coastdown.
    """

    source: int
    start: int
    drive: Drive
    noticed: bool
    limits: tuple[float, ...] = ()
    slope_sd: float = math.nan
    judged_from: int = NEVER
    trials: int = 0
    doubt: Doubt | None = None

    def knowing(self, steadiness: Steadiness) -> OnsetCandidate:
        """
        Return it with what chance could do before it, once that is known.
        """
        if not math.isnan(self.slope_sd):
            return self
        return replace(
            self,
            limits=tuple(float(limit) for limit in steadiness.limit[self.source]),
            slope_sd=float(steadiness.slope_sd[self.source, 0]),
        )

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


def propose(bins: Bins, tuning: Tuning, seen: OnsetCandidate, number: int) -> OnsetCandidate:
    """
    Date back what the walk saw at bin `number`.

    Parameters
    ----------
    seen
        As seen, its start being `number`.
    """
    width = tuning.slopes.width
    if not seen.noticed:
        drive = steady_drive(bins, number - (width + 1) // 2, width)
        return replace(seen, drive=drive, judged_from=number + SHAFT_S - 1)
    # the window that shows the fall holds its start, and one as long before it the steady speed
    span = seen.falls_over(bins, number, width, 1.0) or width
    start = begin_of_fall(bins, seen.source, number - 2 * span, number, tuning.speed_min)
    if not seen.drive.known:
        seen = replace(seen, drive=steady_drive(bins, start - (width + 1) // 2, width))
    return replace(seen, start=start)


def judge(
    candidate: OnsetCandidate,
    bins: Bins,
    ship: Ship,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
) -> OnsetJudgement:
    """
    Judge a candidate when bin `number` has closed.
    """
    width, confirm = tuning.slopes.width, round(parameters.confirm_s)
    pending = OnsetJudgement(OnsetDecision.PENDING, candidate)
    if number < candidate.judged_from:  # the clock of the speed may be slower than the shaft's
        return pending
    evidence = _propulsion(candidate, bins, tuning, parameters, number)
    doubt = _spoiled(candidate, evidence, bins, tuning, parameters, number)
    if doubt is not None:
        return OnsetJudgement(OnsetDecision.DISMISSED, candidate, doubt)
    if evidence.stop is not None:
        candidate = replace(candidate, start=evidence.stop)
    falls = candidate.falls(bins, number, width)
    age = number - candidate.start
    off = evidence.thrust in (Thrust.STANDS, Thrust.WINDMILLS)
    if off and falls:
        return OnsetJudgement(OnsetDecision.CONFIRMED, candidate)
    if not candidate.noticed:
        if evidence is UNKNOWN_THRUST:  # it turns on as before
            return OnsetJudgement(OnsetDecision.DISMISSED, candidate)
        if age > _PATIENCE * confirm:
            return OnsetJudgement(OnsetDecision.DISMISSED, candidate, _no_fall(evidence, age))
    if not falls:
        if off or not candidate.noticed:
            return OnsetJudgement(OnsetDecision.PENDING, candidate)
        return OnsetJudgement(
            OnsetDecision.DISMISSED, candidate, _settled(candidate, bins, width, number)
        )
    if age < confirm * (candidate.trials + 1):
        return OnsetJudgement(OnsetDecision.PENDING, candidate)
    return _tried(candidate, evidence, bins, ship, tuning, parameters, number)


def _tried(
    candidate: OnsetCandidate,
    evidence: ShaftEvidence,
    bins: Bins,
    ship: Ship,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
) -> OnsetJudgement:
    """Judge the deceleration once more."""
    width, confirm = tuning.slopes.width, round(parameters.confirm_s)
    if evidence.stop is None:
        start = begin_of_fall(
            bins, candidate.source, candidate.start - 2 * width, number, tuning.speed_min
        )
        candidate = replace(candidate, start=start)
    if 2 * (number - candidate.start) < confirm * (2 * candidate.trials + 1):
        # chance made it a candidate, then it began in earnest
        return OnsetJudgement(OnsetDecision.PENDING, candidate)
    candidate = replace(candidate, trials=candidate.trials + 1)
    # a governor, or a controllable propeller at zero pitch that holds its speed: ask for more
    strict = evidence.thrust is Thrust.REDUCED and candidate.trials < _TRIALS
    doubt = _unlike_a_coastdown(candidate, bins, ship, tuning, parameters, number, strict=strict)
    if evidence.thrust is Thrust.ON:
        doubt = Doubt(Dismissal.THRUST, f'a propeller drove on, {evidence.text}')
    elif evidence.thrust is Thrust.REDUCED and doubt is not None:
        doubt = Doubt(Dismissal.THRUST, f'{doubt.text}; the shaft held its speed, {evidence.text}')
    candidate = replace(candidate, doubt=doubt)
    if doubt is None:
        return OnsetJudgement(OnsetDecision.CONFIRMED, candidate)
    if candidate.trials == _TRIALS:
        return OnsetJudgement(OnsetDecision.DISMISSED, candidate, doubt)
    return OnsetJudgement(OnsetDecision.PENDING, candidate)


def _propulsion(
    candidate: OnsetCandidate, bins: Bins, tuning: Tuning, parameters: Parameters, number: int
) -> ShaftEvidence:
    """Say what the propellers do, where that goes with what the speed does."""
    width = tuning.slopes.width
    evidence = propulsion(
        bins,
        candidate.drive,
        SpeedEvidence(candidate.source, candidate.start, candidate.slope_sd),
        number,
        width=width,
        stands=0.5 * parameters.shaft_stopped_fraction,
    )
    if evidence.stop is None or not candidate.noticed:
        return evidence
    # a shaft that stopped long before the ship slowed down, or after, is a sign of something else;
    # of several, others have stopped before
    late = evidence.stop - candidate.start
    if late < -_APART * width or (late > _APART * width and candidate.drive.known == 1):
        return UNKNOWN_THRUST
    return evidence


def _spoiled(
    candidate: OnsetCandidate,
    evidence: ShaftEvidence,
    bins: Bins,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
) -> Doubt | None:
    """Say what makes a candidate no coastdown whatever its speed does."""
    width = tuning.slopes.width
    if evidence.thrust is Thrust.ASTERN:
        return Doubt(
            Dismissal.ASTERN,
            f'a propeller was reversed, {evidence.text}',
        )
    level = line(bins, candidate.source, number, width)[1]
    if level < tuning.speed_min:
        return Doubt(
            Dismissal.SLOW,
            f'the speed was {level:.2f} m/s, below the minimum of {tuning.speed_min:.2f} m/s',
        )
    if turned_at(bins, candidate.start, number, width, parameters.turn_rad) is not None:
        return Doubt(
            Dismissal.TURN,
            f'the ship turned by more than {math.degrees(parameters.turn_rad):.0f} deg',
        )
    return None


def _no_fall(evidence: ShaftEvidence, age: int) -> Doubt:
    """Say that the propeller slowed down, the ship did not."""
    if evidence.thrust is Thrust.ON:
        return Doubt(Dismissal.THRUST, f'a propeller drove on for {age} s, {evidence.text}')
    return Doubt(
        Dismissal.OTHER,
        f'the shaft slowed down, {evidence.text}, yet for {age} s the speed did not fall by more '
        'than chance explains',
    )


def _settled(candidate: OnsetCandidate, bins: Bins, width: int, number: int) -> Doubt:
    """Say that the speed falls no longer, after how much of it was lost."""
    if candidate.doubt is not None:
        return candidate.doubt
    before = line(bins, candidate.source, candidate.start - 1, width)[1]
    level = line(bins, candidate.source, number, width)[1]
    known = '' if math.isnan(before) else f' from {before:.2f}'
    return Doubt(
        Dismissal.SETTLED,
        f'the speed fell{known} to {level:.2f} m/s in {number - candidate.start} s and then no '
        'longer',
    )


def _unlike_a_coastdown(
    candidate: OnsetCandidate,
    bins: Bins,
    ship: Ship,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
    *,
    strict: bool,
) -> Doubt | None:
    """Say where the speed since the start does not look like a coastdown."""
    age = number - candidate.start
    # the longer it lasts, the longer the span that its present slope can be taken over
    span = max(tuning.slopes.width, 2 * age // 3)
    slope, level, _ = line(bins, candidate.source, number, span)
    _, before, _ = line(bins, candidate.source, candidate.start - 1, tuning.slopes.width)
    middle = level - 0.5 * slope * span
    if math.isnan(before):
        return Doubt(
            Dismissal.LEAD_IN,
            f'no {tuning.slopes.width} s of steady speed before it to compare with',
        )
    guard = round(_GUARD * parameters.confirm_s)
    time, speed = speeds(bins, candidate.source, candidate.start + guard, number)
    found = fit_deceleration(time, speed) if len(time) >= _LAW_BINS_MIN else None
    if found is None or not (before > level > 0.0 and slope < 0.0 and found.slope < 0.0):
        return Doubt(
            Dismissal.SETTLED,
            f'the speed did not fall steadily, {before:.2f} to {level:.2f} m/s in {age} s',
        )
    expected = expect(ship, before)
    lost = (before - level) / expected.loss(before, age)
    falling = -slope / expect(ship, middle).deceleration_m_s2
    # a curvature is the difference of the slopes of two halves
    half = 0.5 * float(time[-1] - time[0])
    sd = (
        math.sqrt(2.0)
        * candidate.slope_sd
        * (tuning.slopes.width / half**2)
        * (found.speed / found.slope**2)
    )
    if min(lost, falling) > _BRAKED and found.exponent + 2.0 * sd < _BRAKE_EXPONENT:
        return Doubt(
            Dismissal.BRAKE,
            f'it slowed {min(lost, falling):.1f} times faster than the water makes it, by a force '
            f'that hardly fell with the speed (exponent {found.exponent:.1f} ± {sd:.1f})',
        )
    excess = found.exponent - expect(ship, found.speed).exponent
    if min(lost, falling) > expected.fraction_min:
        passes = excess + (sd if strict else -sd) < EXCESS_MAX
    else:
        # a ship that is heavier than its file says: the law alone, once there is enough of it
        passes = candidate.trials > 1 and not strict and excess + sd < EXCESS_MAX
    if passes:
        return None
    return Doubt(
        Dismissal.SETTLED,
        f'it slowed {min(lost, falling):.2f} times as fast as a coastdown of this ship, from '
        f'{before:.2f} to {level:.2f} m/s in {age} s, by a force with exponent '
        f'{found.exponent:.1f} ± {sd:.1f} of the speed where the water has '
        f'{found.exponent - excess:.1f}: power was reduced, or the ship turned',
    )
