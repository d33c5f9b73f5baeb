# SPDX-License-Identifier: Apache-2.0
"""
All of a glide, with the parts in which something but the water slows or drives the ship.

An estimate of r(v) leaves such parts out. A diagnosis asks what that was, and so needs them
to say what acted and how much.
"""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.driving import gone_s, start_of, thrust
from shipdrag_ros.coastdown.events import BY_SPEED, Dismissal, EndedBy, EndedCoastdown
from shipdrag_ros.coastdown.expectation import expect
from shipdrag_ros.coastdown.instruments import astern, length_s
from shipdrag_ros.coastdown.readings import LEAST_READINGS, binned, readings
from shipdrag_ros.estimation import Window
from shipdrag_ros.replay.coasts import clocks_apart, window_between
from shipdrag_ros.replay.playback import ReplayResult
from shipdrag_ros.replay.sailing import accepted_samples
from shipdrag_ros.samples import SECOND_NS, Float64
from shipdrag_ros.ship import Ship

DISMISSED = (
    'she lost her speed about as fast as after an engine stop, though not as water slows a ship; '
    'no coastdown is taken from it'
)
_NOT_FOLLOWED = (
    '{disturbed}; all of the glide is not held against the model, as {why}, and what is said '
    'rests on the coastdown alone'
)
_ACTED = (Dismissal.BRAKE, Dismissal.TURN, Dismissal.RUDDER)
_BIN_S = 10.0
_BEFORE_S = 300.0  # that show the speed before a stop
_RISE = 0.05  # of the first speed: a ship that gains so much no longer glides
_LEFT = 0.6  # of the speed, which a glide reaches ...
_EARLIEST, _LATEST = 0.5, 2.5  # ... after so many times the time that the ship file expects
_LONGEST_S = 7200.0  # no glide is longer


class Glide(NamedTuple):
    """
    A glide that is more than its coastdown.

    Attributes
    ----------
    window
        All of it; None where it cannot be followed.
    note
        What is no coastdown of it, and why it cannot be followed, a sentence.
    """

    window: Window | None
    note: str


class _Unfollowed(Exception):
    """Why a glide cannot be followed; '' where an instrument shows why it ends."""


def whole_glide(result: ReplayResult, coastdown: EndedCoastdown) -> Glide | None:
    """
    Return a coastdown with what was cut as the work of something but the water.

    Parameters
    ----------
    result
        From `replay`.
    coastdown
        Of the same.

    Returns
    -------
    Glide or None
        None where nothing was cut for that, or the propeller shows the cause.
    """
    said = coastdown.disturbed
    if not said:
        return None
    acted = [cut for cut in coastdown.cuts if cut.reason in _ACTED]
    start_ns, steady = start_of(coastdown, result.ship)
    if any(cut.start_ns < coastdown.start_ns for cut in acted):
        start_ns, steady = min(cut.start_ns for cut in coastdown.cuts), True
    if coastdown.ended_by is EndedBy.GIVEN:
        end_ns = max(coastdown.end_ns, *(cut.end_ns for cut in acted))
        return Glide(window_between(result, start_ns, end_ns, steady=steady), said)
    try:
        found = _glide(result, start_ns, steady=steady)
    except _Unfollowed as why:
        unfollowed = _NOT_FOLLOWED.format(disturbed=said, why=why)
        return Glide(None, unfollowed) if str(why) else None
    if (found.start_ns, found.end_ns) == (start_ns, coastdown.end_ns):
        return None
    return Glide(found, said)


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
    dismissed = [one for one in result.not_coastdowns if one.reason in BY_SPEED]
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
            with suppress(_Unfollowed):
                return _glide(result, one.start_ns, steady=True)
    return None


def _glide(result: ReplayResult, start_ns: int, *, steady: bool) -> Window:
    """Read on from a start to where she is slow, gains speed, or an instrument ends it."""
    if result.run.span_ns is None or result.run.span_ns[1] <= start_ns:
        raise _Unfollowed('the clocks of record and instruments differ')
    last_ns = min(result.run.span_ns[1], start_ns + round(_LONGEST_S * SECOND_NS))
    apart = bool(clocks_apart(result))
    try:
        window = window_between(result, start_ns, last_ns, steady=steady, apart=apart)
    except ValueError as error:
        raise _Unfollowed('a clock was set after it') from error
    time_s, speed = readings(window)
    if len(speed) < LEAST_READINGS:
        raise _Unfollowed(f'it has {len(speed)} readings of the speed')
    time_s, speed = binned(time_s, speed, max(int(length_s(window) / _BIN_S), LEAST_READINGS))
    slow_m_s = float(result.ship.speed(result.parameters.froude_min))
    rises = speed > np.minimum.accumulate(speed) + _RISE * float(speed[0])
    over = np.flatnonzero((speed < slow_m_s) | rises)
    end_s = length_s(window)
    if len(over):  # what she does afterwards, going astern for instance, ends nothing before it
        end_s = float(time_s[int(np.argmin(speed[: over[0] + 1]))])
        if end_s < gone_s(result.ship):
            raise _Unfollowed(
                f'she is slow or gains speed within {end_s:.0f} s of the stop, while the thrust '
                'may still run down'
            )
        window = window.part(start_ns, start_ns + round(end_s * SECOND_NS))
    cuts = (
        *thrust(window, result.ship, steady=steady),
        *astern(window, result.parameters),
    )
    if not cuts:
        return window
    end_s = min(end_s, *((cut.start_ns - start_ns) * 1e-9 for cut in cuts))
    if end_s < gone_s(result.ship):
        raise _Unfollowed
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
