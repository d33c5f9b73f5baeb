# SPDX-License-Identifier: Apache-2.0
"""
A window that a person claims is cut to what is a coastdown before anything is fitted.

Instruments speak first (`instruments`), then the speed itself (`force_law`). The
longest clean part is kept, or the stretch is refused with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.driving import thrust
from shipdrag_ros.coastdown.events import Dismissal, NotCoastdown
from shipdrag_ros.coastdown.expectation import expect
from shipdrag_ros.coastdown.force_law import departures
from shipdrag_ros.coastdown.instruments import astern, gaps, rudder, swing, turns
from shipdrag_ros.coastdown.readings import binned, readings
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.ship import Ship

LEAST_READINGS = 8  # of the speed, or positions, in what is kept
LEAST_FALL = 0.05  # of the speed, from the first to the last tenth of what is kept
_ENOUGH = 0.5  # of a stretch must be left where turns and rudder are cut; else they are noted
_AT_REST = 0.1  # of the highest speed of the stretch: what is slower from its start is no coast
_TURNS = 0.25  # of turn_rad, by which the heading swings where it is a turn that stops her
_TURN_MOST = 4.0  # times the deceleration before: no turn slows her by more
_MANY = 20  # readings that must be left by them, since fewer show less than the turn spoils
_SHOWN = 300  # means of the speed
_WORDLESS = 1e-3  # of a stretch
_SLIVER = 0.01  # of a stretch
_SPAN = tuple[int, int]


@dataclass(frozen=True)
class Examination:
    """
    What of a stretch is a coastdown.

    Attributes
    ----------
    start_ns, end_ns
        The part that is kept; the whole stretch where it is refused [ns].
    cuts
        What was cut and why, in order of time.
    failure
        Why it is refused; None where it is not.
    notes
        What speaks against all of it, and was not cut, a sentence each.
    """

    start_ns: int
    end_ns: int
    cuts: tuple[NotCoastdown, ...]
    failure: str | None
    notes: tuple[str, ...]


class Examined(NamedTuple):
    """
    An examination, and the estimate from what was kept.

    `failure` says why there is none; `refused` that nothing of it is a coastdown.
    """

    start_ns: int
    end_ns: int
    cuts: tuple[NotCoastdown, ...]
    estimate: Estimate | None
    failure: str | None
    refused: bool
    stretch: tuple[tuple[int, float], ...]


def estimate_examined(
    window: Window,
    ship: Ship,
    parameters: Parameters,
    estimator: Callable[[Window, Ship, Parameters], Estimate],
) -> Examined:
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
    examined = examine(window, ship, parameters)
    estimate, failure = None, examined.failure
    if failure is None:
        part = window.part(examined.start_ns, examined.end_ns)
        part = replace(part, before=None, notes=(*examined.notes, *part.notes))
        try:
            estimate = estimator(part, ship, parameters)
        except EstimationError as error:
            failure = str(error)
    return Examined(
        examined.start_ns,
        examined.end_ns,
        examined.cuts,
        estimate,
        failure,
        examined.failure is not None,
        _shown(window) if examined.cuts else (),
    )


def _shown(window: Window) -> tuple[tuple[int, float], ...]:
    """Return the speed of a whole window, for a picture."""
    time_s, speed = binned(*readings(window), _SHOWN)
    return tuple(
        (window.start_ns + round(t * SECOND_NS), v)
        for t, v in zip(time_s.tolist(), speed.tolist(), strict=True)
    )


def examine(window: Window, ship: Ship, parameters: Parameters) -> Examination:
    """
    Find the longest part of a window that is a coastdown.

    Parameters
    ----------
    window
        With the record `before` it, if there is any.
    ship
        For what slows her down as a rule, and for her propeller.
    parameters
        `turn_rad`, `data_stop_s` and `heading_convention` are used.

    Notes
    -----
    What is left is long enough if it holds `LEAST_READINGS` and the speed falls
    by `LEAST_FALL` in it. Where nothing is cut nothing is refused: what a short
    or even record gives is for the estimator to say.
    """
    whole = (window.start_ns, window.end_ns)
    cuts = [
        *gaps(window, parameters),
        *thrust(window, ship),
        *astern(window, parameters),
    ]
    top = float(np.max(np.abs(readings(window)[1]), initial=0.0))
    parts = [_examine_part(window, span, ship, parameters, top) for span in _left(whole, cuts)]
    best = max(parts, key=lambda part: (part.worth, part.kept[1] - part.kept[0]), default=None)
    for part in parts:
        cuts += part.cuts if part is best else [part.set_aside]
    cuts.sort(key=lambda cut: cut.start_ns)
    kept = None if best is None else best.kept
    failure = _refusal(window, kept, cuts) if cuts else None
    start_ns, end_ns = whole if failure or kept is None else kept
    if failure is None:  # what lies between two samples is worth no word
        cuts = [cut for cut in cuts if cut.end_ns - cut.start_ns > _WORDLESS * _length(whole)]
    notes = () if best is None else tuple(best.notes)
    return Examination(start_ns, end_ns, tuple(cuts), failure, notes)


class _KeptPart(NamedTuple):
    """
    A part that no instrument speaks against, and what of it is kept.

    `worth` is the time kept [s], times the fraction of the speed that is lost in it;
    `set_aside` is what is said of it where another part is kept.
    """

    kept: _SPAN
    worth: float
    cuts: list[NotCoastdown]
    notes: list[str]
    set_aside: NotCoastdown


def _examine_part(
    window: Window,
    span: _SPAN,
    ship: Ship,
    parameters: Parameters,
    top: float,
) -> _KeptPart:
    kept, cuts, notes = _steered(window.part(*span), ship, parameters)
    by_speed = _by_speed(window, kept, ship, parameters)
    kept = max(_left(kept, by_speed), key=_length, default=(kept[0], kept[0]))
    first, last, _ = _ends(window.part(*kept))
    fall = 1.0 - last / first if first > 0.0 else 0.0
    worth = 0.0
    if first < _AT_REST * top:
        reason, text = Dismissal.SLOW, f'she is all but at rest, at {first:.2g} m/s'
    elif fall < LEAST_FALL:
        reason, text = (
            Dismissal.PLATEAU,
            f'she hardly slows down: from {first:.3g} m/s by {fall:.0%}',
        )
    else:
        worth = fall * _length(kept) * 1e-9
        reason = Dismissal.OTHER
        length_s = _length(kept) * 1e-9
        text = f'she loses {fall:.0%} of her speed in {length_s:.3g} s; a better part is kept'
    return _KeptPart(kept, worth, [*cuts, *by_speed], notes, NotCoastdown(*span, reason, text))


def _ends(window: Window) -> tuple[float, float, int]:
    """Return the speed in the first and last tenth, and of how many readings."""
    count = max(map(len, window.each('speed_through_water', 'speed_over_ground')))
    _, speed = readings(window)
    if not len(speed):
        return 0.0, 0.0, max(count, len(window.position))
    tenth = max(1, len(speed) // 10)
    first, last = float(np.mean(speed[:tenth])), float(np.mean(speed[-tenth:]))
    return first, last, max(count, len(window.position))


def _steered(
    window: Window, ship: Ship, parameters: Parameters
) -> tuple[_SPAN, list[NotCoastdown], list[str]]:
    """Cut turns and rudder where that leaves enough; else note them."""
    span = (window.start_ns, window.end_ns)
    cuts: list[NotCoastdown] = []
    notes = []
    first, last, _ = _ends(window)
    for found in (turns(window, parameters), rudder(window, ship)):
        if not found:
            continue
        left = max(_left(span, [*cuts, *found]), key=_length, default=None)
        if left is not None and _length(left) >= _ENOUGH * _length(span):
            start, end, count = _ends(window.part(*left))
            if count >= _MANY and start - end >= _ENOUGH * (first - last):
                cuts += found
                continue
        notes.append(f'{found[0].text}: the drag of drifting and turning is part of r')
    return max(_left(span, cuts), key=_length, default=span), cuts, notes


def _by_speed(
    window: Window, kept: _SPAN, ship: Ship, parameters: Parameters
) -> list[NotCoastdown]:
    """Let the speed show where it is not that of a ship that coasts."""
    part = window.part(*kept)
    time_s, speed = readings(part)

    def usual(speed_m_s: float) -> float:
        return expect(ship, speed_m_s)

    cuts = []
    for cut in departures(time_s, speed, usual):
        start_ns = kept[0] + round(cut.start_s * SECOND_NS)
        end_ns = kept[0] + round(cut.end_s * SECOND_NS)
        at_start = cut.start_s <= float(time_s[0])
        at_end = cut.end_s >= float(time_s[-1])
        reason, text = cut.reason, cut.text
        if at_end and reason is Dismissal.BRAKE and cut.quickened < _TURN_MOST:
            turned = swing(part, cut.start_s)
            if turned > _TURNS * parameters.turn_rad:
                reason = Dismissal.TURN
                text = f'{text}, and the heading swings by {math.degrees(turned):.0f} degrees'
        cuts.append(
            NotCoastdown(
                kept[0] if at_start else start_ns,
                kept[1] if at_end else end_ns,
                reason,
                text,
            )
        )
    return cuts


def _left(span: _SPAN, cuts: Sequence[NotCoastdown]) -> list[_SPAN]:
    """Return what is left of a span, in order of time."""
    left, at = [], span[0]
    end = NotCoastdown(span[1], span[1], Dismissal.OTHER, '')
    for cut in (*sorted(cuts, key=lambda each: each.start_ns), end):
        # nothing is to be had of what lies between two samples
        if min(cut.start_ns, span[1]) - at > _SLIVER * _length(span):
            left.append((at, min(cut.start_ns, span[1])))
        at = max(at, cut.end_ns)
    return left


def _length(span: _SPAN) -> int:
    return span[1] - span[0]


def _refusal(window: Window, kept: _SPAN | None, cuts: Sequence[NotCoastdown]) -> str | None:
    """Say why what is left is no coastdown; None where it may be one."""
    why = '; '.join(dict.fromkeys(f'{cut.reason.value}: {cut.text}' for cut in cuts))
    if kept is None or not _length(kept):
        return f'nothing of it is a coastdown: {why}'
    first, last, count = _ends(window.part(*kept))
    fall = 1.0 - last / first if first > 0.0 else 0.0
    if count >= LEAST_READINGS and fall >= LEAST_FALL:
        return None
    return (
        f'what is left is no coastdown: {_length(kept) * 1e-9:.1f} s with {count} readings, '
        f'in which the speed falls by {fall:.0%}; it takes {LEAST_READINGS} readings and '
        f'a fall of {LEAST_FALL:.0%}; cut was {why}'
    )
