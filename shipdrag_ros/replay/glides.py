# SPDX-License-Identifier: Apache-2.0
"""
All of a glide, with the parts in which something but the water slows or drives the ship.

An estimate of r(v) leaves such parts out. A diagnosis asks what that was, and so needs them
where no instrument shows the cause.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.coastdown.driving import gone_s, thrust
from shipdrag_ros.coastdown.events import Dismissal, EndedBy, EndedCoastdown
from shipdrag_ros.coastdown.expectation import expect
from shipdrag_ros.coastdown.instruments import astern, length_s, turns
from shipdrag_ros.coastdown.readings import LEAST_READINGS, binned, readings
from shipdrag_ros.estimation import Window
from shipdrag_ros.replay.coasts import clocks_apart, start_of, window_between
from shipdrag_ros.replay.playback import ReplayResult
from shipdrag_ros.replay.sailing import accepted_samples
from shipdrag_ros.samples import SECOND_NS, Float64
from shipdrag_ros.ship import Ship

_BIN_S = 10.0
_BEFORE_S = 300.0  # that show the speed before a stop
_RISE = 0.05  # of the first speed: a ship that gains so much no longer glides
_LEFT = 0.6  # of the speed, which a glide reaches ...
_EARLIEST, _LATEST = 0.5, 2.5  # ... after so many times the time that the ship file expects
_LONGEST_S = 7200.0  # no glide is longer
# for these a candidate is dismissed by its speed alone; a turn, a gap and bad readings are causes
_BY_SPEED = (
    Dismissal.BRAKE,
    Dismissal.LEAD_IN,
    Dismissal.PLATEAU,
    Dismissal.SETTLED,
    Dismissal.THRUST,
)


def whole_glide(result: ReplayResult, coastdown: EndedCoastdown) -> Window | None:
    """
    Return the window of a coastdown with what was cut as the work of something but the water.

    Parameters
    ----------
    result
        From `replay`.
    coastdown
        Of the same.

    Returns
    -------
    Window or None
        None where nothing was cut for that, or an instrument shows the cause.
    """
    braked = [cut for cut in coastdown.cuts if cut.reason is Dismissal.BRAKE]
    if coastdown.ended_by is not EndedBy.BRAKE and not braked:
        return None
    start_ns, steady = start_of(coastdown, result.ship)
    if any(cut.start_ns < coastdown.start_ns for cut in braked):
        start_ns, steady = min(cut.start_ns for cut in coastdown.cuts), True
    if coastdown.ended_by is EndedBy.GIVEN:
        end_ns = max(coastdown.end_ns, *(cut.end_ns for cut in braked))
        return window_between(result, start_ns, end_ns, steady=steady)
    found = _glide(result, start_ns, steady=steady)
    if found is None or (found.start_ns, found.end_ns) == (start_ns, coastdown.end_ns):
        return None
    return found


def dismissed_glide(result: ReplayResult) -> Window | None:
    """
    Return a glide that was taken for none by its speed alone.

    Parameters
    ----------
    result
        From `replay`.

    Returns
    -------
    Window or None
        None where a coastdown was found, or where the ship lost no such part of her speed in
        about such a time as after an engine stop: then power was reduced.
    """
    dismissed = [one for one in result.not_coastdowns if one.reason in _BY_SPEED]
    if result.coastdowns or not dismissed:
        return None
    block, _ = accepted_samples(result.run)
    if not len(block):
        return None
    try:
        record = Window.from_block(block, int(block.stamp_ns.min()), int(block.stamp_ns.max()))
    except ValueError:  # a clock was set within the record
        return None
    time_s, speed = readings(record)
    time_s, speed = binned(time_s, speed, max(int(length_s(record) / _BIN_S), LEAST_READINGS))
    for one in dismissed:
        since_s = time_s - (one.start_ns - record.start_ns) * 1e-9
        if _as_after_a_stop(since_s, speed, result.ship):
            found = _glide(result, one.start_ns, steady=True)
            if found is not None:
                return found
    return None


def _glide(result: ReplayResult, start_ns: int, *, steady: bool) -> Window | None:
    """Read on from a start to where she is slow, gains speed, or an instrument ends it."""
    if result.run.span_ns is None:
        return None
    last_ns = min(result.run.span_ns[1], start_ns + round(_LONGEST_S * SECOND_NS))
    if last_ns <= start_ns:
        return None
    apart = bool(clocks_apart(result))
    try:
        window = window_between(result, start_ns, last_ns, steady=steady, apart=apart)
    except ValueError:  # a clock was set after the coastdown
        return None
    time_s, speed = readings(window)
    if len(speed) < LEAST_READINGS:
        return None
    time_s, speed = binned(time_s, speed, max(int(length_s(window) / _BIN_S), LEAST_READINGS))
    slow_m_s = float(result.ship.speed(result.parameters.froude_min))
    rises = speed > np.minimum.accumulate(speed) + _RISE * float(speed[0])
    over = np.flatnonzero((speed < slow_m_s) | rises)
    end_s = length_s(window)
    if len(over):  # what she does afterwards, going astern for instance, ends nothing before it
        end_s = float(time_s[int(np.argmin(speed[: over[0] + 1]))])
        if end_s < gone_s(result.ship):
            return None
        window = window.part(start_ns, start_ns + round(end_s * SECOND_NS))
    cuts = (
        *thrust(window, result.ship, steady=steady),
        *astern(window, result.parameters),
        *turns(window, result.parameters),
    )
    if not cuts:
        return window
    end_s = min(end_s, *((cut.start_ns - start_ns) * 1e-9 for cut in cuts))
    if end_s < gone_s(result.ship):
        return None
    return window.part(start_ns, start_ns + round(end_s * SECOND_NS))


def _as_after_a_stop(since_s: Float64, speed: Float64, ship: Ship) -> bool:
    """Say whether a speed falls about as fast as the ship file has it after a stop at 0 s."""
    before = speed[(since_s > -_BEFORE_S) & (since_s < 0.0)]
    if not len(before) or not np.median(before) > 0.0:
        return False
    first = float(np.median(before))
    low = np.flatnonzero((since_s >= 0.0) & (speed < _LEFT * first))
    if not len(low):
        return False
    usual_s = expect(ship, first).time_s(first, left=_LEFT)
    return _EARLIEST * usual_s <= float(since_s[low[0]]) <= _LATEST * usual_s
