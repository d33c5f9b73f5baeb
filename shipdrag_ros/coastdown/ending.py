# SPDX-License-Identifier: Apache-2.0
"""
When a coastdown is over, and where its record ends.

Judged each second on the bins, in this order: the shaft turns again, the ship
turns, the minimum speed is reached, the speed settles or rises; or falls faster
than before, which is how a turn shows where nothing gives the heading. The
record ends where the cause began, not where it was noticed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipdrag_ros.coastdown.bins import Bins, line
from shipdrag_ros.coastdown.deceleration import bend
from shipdrag_ros.coastdown.events import Dismissal, EndedBy
from shipdrag_ros.coastdown.expectation import expect
from shipdrag_ros.coastdown.memory import Tuning
from shipdrag_ros.coastdown.onset import Doubt, OnsetCandidate
from shipdrag_ros.coastdown.settling import ConstantForce, constant_force
from shipdrag_ros.coastdown.shafts import SpeedEvidence, Thrust, all_stand, engaged_at, propulsion
from shipdrag_ros.coastdown.tracking import heading_is_known, turned_at
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

# A ship that coasts decelerates no less than by the fourth power of its falling speed: more
# than friction (2) and waves (3) make it.
_EXPONENT = 4.0
_EXPONENT_MIN = 1.0  # and no more than in proportion to it
# What passed for a coastdown is withdrawn if it has cost less than this of the speed, ...
_LOST_MIN = 0.05
_LENGTH_MIN = 0.5  # ... or was shorter than this, of confirm_s, ...
# ... or if a constant force of this fraction of the first resistance drove, or braked, the ship;
# wind and an exponent that is not as expected make up to 0.1 and -0.35, a gale -1
_THRUST_MIN = 0.2
_BRAKE_MIN = 1.2
_THROUGHOUT_MIN = 0.07  # likewise, where it ended in a steady speed, ...
_CORNER = 9.0  # ... and chi^2 would gain no more than this from a later begin of that force
_TURN_MOST = 3.0  # times the deceleration before: more than drifting in a turn makes it
_EARLIER_WINDOWS = 3  # slope windows before the newest one that say how it decelerated


_CUT_SHORT = {
    EndedBy.DATA_STOP: 'the speed fell silent',
    EndedBy.SILENCE: 'all sources of speed fell silent',
    EndedBy.RESET: 'the memory was reset',
    EndedBy.RECORD_END: 'the record ended',
}


@dataclass(frozen=True)
class End:
    """
    The end of a coastdown: its cause and the last bin that belongs to it.
    """

    ended_by: EndedBy
    last: int


def cut_short(ended_by: EndedBy, age_s: int) -> Doubt:
    """
    Say that a candidate ended before it was confirmed.
    """
    text = f'{_CUT_SHORT[ended_by]} {age_s} s after it began, before it was confirmed'
    return Doubt(Dismissal.GAP, text)


def end_of(
    coasting: OnsetCandidate, bins: Bins, tuning: Tuning, parameters: Parameters, number: int
) -> End | None:
    """
    Say whether the coastdown is over now that bin `number` has closed.

    Parameters
    ----------
    coasting
        The candidate as it was confirmed.
    """
    start, width = coasting.start, tuning.slopes.width
    engaged = engaged_at(bins, coasting.drive, start, number)
    if engaged is not None:
        thrust, last = engaged
        return End(EndedBy.ASTERN if thrust is Thrust.ASTERN else EndedBy.ENGINE, last)
    turned = turned_at(bins, start, number, width, parameters.turn_rad)
    if turned is not None:
        return End(EndedBy.TURN, turned)
    slope, level, _ = line(bins, coasting.source, number, width)
    if level < tuning.speed_min:
        return End(EndedBy.SPEED, number)
    return _departed(coasting, bins, tuning, parameters, number, slope, level)


def _departed(
    coasting: OnsetCandidate,
    bins: Bins,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
    slope: float,
    level: float,
) -> End | None:
    """Say whether the speed has ceased to fall as it did; None where it falls on."""
    width, start, source = tuning.slopes.width, coasting.start, coasting.source
    known = heading_is_known(bins, start)
    excess, first, before = math.nan, start, math.nan
    earlier = number - width
    span = min(_EARLIER_WINDOWS * width, earlier - start)
    if span >= width:
        excess = _excess(bins, source, earlier, span, slope, level - 0.5 * slope * width)
        # while the thrust runs down the fall steepens
        if span < _EARLIER_WINDOWS * width:
            excess = max(excess, 0.0)
        first, before = earlier - width, line(bins, source, earlier, span)[0]
    long = 2 * round(parameters.confirm_s)
    if not abs(excess) > coasting.limits[0] and number - long >= start + long:
        overall, newest, _ = line(bins, source, number, long)
        # slopes over a longer span wander less, at least in proportion
        excess = (long / width) * _excess(
            bins, source, start + long, long // 2, overall, newest - 0.5 * overall * long
        )
        first, before = start, line(bins, source, start + long, long // 2)[0]
        slope = overall
    if excess > coasting.limits[0]:
        # where the shaft is seen to stand, it was not the engine
        if all_stand(bins, coasting.drive, number, 0.5 * parameters.shaft_stopped_fraction):
            return None
        return End(EndedBy.ENGINE, _bend(bins, coasting, tuning, first, number, sign=-1))
    if -excess > coasting.limits[0]:
        # where nothing gives the heading, this is how a turn shows, unless it is too much for one
        braked = known or slope < _TURN_MOST * min(before, 0.0)
        cause = EndedBy.BRAKE if braked else EndedBy.TURN
        return End(cause, _bend(bins, coasting, tuning, first, number, sign=1))
    return None


def _bend(
    bins: Bins, coasting: OnsetCandidate, tuning: Tuning, first: int, number: int, *, sign: int
) -> int:
    """Return the last bin before the speed began to settle or rise (-1), or to fall faster (1)."""
    first = max(first, coasting.start)
    at = bend(bins, coasting.source, first, number, tuning.speed_min, degree=1, sign=sign)
    # the force builds up before the speed shows it
    return max(first, at - tuning.slopes.width // 6)


def _excess(bins: Bins, source: int, last: int, span: int, slope: float, speed: float) -> float:
    """
    Return by how much a slope at `speed` is gentler than coasting on explains [m/s^2].

    Negative where it is steeper, 0 where it is explained.
    """
    before, level, _ = line(bins, source, last, span)
    middle = level - 0.5 * before * span
    if not middle > 0.0:
        return max(slope, 0.0)
    slower = min(1.0, max(0.0, speed / middle))
    steepest, gentlest = (min(before, 0.0) * slower**p for p in (_EXPONENT_MIN, _EXPONENT))
    return float(slope - min(max(slope, steepest), gentlest))


_WITHDRAWN_FOR = {
    EndedBy.ENGINE: Dismissal.THRUST,
    EndedBy.ASTERN: Dismissal.ASTERN,
    EndedBy.BRAKE: Dismissal.BRAKE,
    EndedBy.TURN: Dismissal.TURN,
}


def withdrawn(
    coasted: OnsetCandidate,
    end: End,
    bins: Bins,
    ship: Ship,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
) -> Doubt | None:
    """
    Say why what has ended was no coastdown; None if it may be one.

    Parameters
    ----------
    number
        The newest bin, at which the end was seen.
    """
    width, length = tuning.slopes.width, end.last - coasted.start + 1
    before = line(bins, coasted.source, coasted.start - 1, width)[1]
    after = line(bins, coasted.source, end.last, max(min(width, length), 6))[1]
    lost = 1.0 - after / before
    if end.ended_by is EndedBy.ENGINE and lost < _LOST_MIN:
        return Doubt(
            Dismissal.SETTLED,
            f'the speed settled after {lost:.1%} of it was lost, less than {_LOST_MIN:.0%}: the '
            'power was reduced, not cut',
        )
    reason = _WITHDRAWN_FOR.get(end.ended_by)
    shortest = _LENGTH_MIN * parameters.confirm_s
    if reason is not None and length < shortest:
        return Doubt(
            reason,
            f'it lasted {length} s, less than {shortest:.0f} s, before it ended '
            f'({end.ended_by.value})',
        )
    return _forced(coasted, end, bins, ship, tuning, parameters, number)


def _forced(
    coasted: OnsetCandidate,
    end: End,
    bins: Bins,
    ship: Ship,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
) -> Doubt | None:
    """Say that a constant force acted beside the water all the time."""
    width = tuning.slopes.width
    first = coasted.start + round(0.1 * parameters.confirm_s)
    faster = line(bins, coasted.source, coasted.start - 1, width)[1]
    if math.isnan(faster):
        faster = tuning.speed_min
    exponent = expect(ship, 0.85 * faster).exponent

    def force(last: int) -> ConstantForce | None:
        return constant_force(
            bins,
            coasted.source,
            first,
            last,
            exponent=exponent,
            slope_sd=coasted.slope_sd,
            width=width,
        )

    within = force(end.last)
    if within is not None and within.high < -_BRAKE_MIN:
        return Doubt(
            Dismissal.BRAKE,
            f'a force of {-within.fraction:.2f} times the first resistance held the ship back '
            'however slow she was: a brake, or a propeller astern',
        )
    # where the shafts are seen to do nothing, what drives her is the wind
    seen = SpeedEvidence(coasted.source, coasted.start, coasted.slope_sd)
    stands = 0.5 * parameters.shaft_stopped_fraction
    thrust = propulsion(bins, coasted.drive, seen, end.last, width=width, stands=stands).thrust
    if thrust in (Thrust.STANDS, Thrust.WINDMILLS):
        return None
    if within is not None and within.low > _THRUST_MIN:
        return _driven(within)
    if end.ended_by is not EndedBy.ENGINE:
        return None
    # with what came after: an engine that is engaged again leaves a corner, one that was never
    # cut does not
    throughout = force(number)
    if throughout is not None and throughout.low > _THROUGHOUT_MIN and throughout.later < _CORNER:
        return _driven(throughout)
    return None


def _driven(force: ConstantForce) -> Doubt:
    share = (
        'as if the resistance did not grow with the speed'
        if math.isinf(force.fraction)
        else f'as with {force.fraction:.2f} ± {force.sd:.2f} of the steady thrust left'
    )
    return Doubt(
        Dismissal.THRUST, f'the speed settled from the start on, {share}: power was reduced'
    )
