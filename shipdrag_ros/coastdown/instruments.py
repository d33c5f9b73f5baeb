# SPDX-License-Identifier: Apache-2.0
"""What heading, rudder, log and track say against a coastdown: turns, going astern, gaps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.coastdown.events import Dismissal, NotCoastdown
from shipdrag_ros.coastdown.readings import binned, clean_readings, readings, seconds
from shipdrag_ros.coastdown.tracking import rep103_yaw
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.rows import MAD_TO_SD
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import MOTION_INPUTS, SECOND_NS, Float64
from shipdrag_ros.ship import Ship

_RUDDER_RAD = 0.17
_ASTERN = 0.1  # of the highest speed: less is drift
_OPPOSED = -0.7  # cosine of heading and course
_MOVING = 0.3  # of the highest speed: slower, current and noise make the course
_HEADINGS = 60  # means of it in a window


def rudder(window: Window, ship: Ship) -> list[NotCoastdown]:
    """
    Find when the rudder is over for longer than it takes to sail her length.
    """
    if not len(window.rudder):
        return []
    time_s = seconds(window.rudder, window)
    _, speed = readings(window)
    way_s = ship.length_m / max(float(np.median(speed)), 1e-9) if len(speed) else 0.0
    found = []
    for first, last in runs(np.abs(window.rudder.value) > _RUDDER_RAD, time_s, 0.0):
        start_s, end_s = float(time_s[first]), until(time_s, last, window)
        if end_s - start_s < way_s:
            continue
        angle = math.degrees(float(np.mean(window.rudder.value[first : last + 1])))
        text = f'the rudder is over by {angle:.0f} degrees'
        found.append(cut_of(window, start_s, end_s, Dismissal.RUDDER, text))
    return found


def turns(window: Window, parameters: Parameters) -> list[NotCoastdown]:
    """
    Find what is beside the longest stretch on one heading, or one course.

    The heading decides where there is one: the course of a ship that slows down in
    a cross current changes without a turn.
    """
    time_s, angle, doubt = _direction(window, parameters)
    if len(time_s) < 2:
        return []
    limit = parameters.turn_rad + doubt
    first, best = 0, (0, 0)
    for last in range(len(angle)):
        while float(np.ptp(angle[first : last + 1])) > limit:
            first += 1
        # the earliest of those that are about as long
        lasts_s, longest_s = time_s[last] - time_s[first], time_s[best[1]] - time_s[best[0]]
        if lasts_s > (1.0 if first == best[0] else 1.02) * longest_s:
            best = (first, last)
    swing = math.degrees(float(np.ptp(angle)))
    what = 'heading' if len(window.heading) else 'course over ground'
    text = (
        f'the {what} swings over {swing:.0f} degrees in the window, more than turn_rad, '
        f'{math.degrees(parameters.turn_rad):.0f} degrees'
    )
    found = []
    if best[0] > 0:
        found.append(cut_of(window, 0.0, float(time_s[best[0]]), Dismissal.TURN, text))
    if best[1] < len(angle) - 1:
        end_s = length_s(window)
        found.append(cut_of(window, float(time_s[best[1]]), end_s, Dismissal.TURN, text))
    return found


def swing(window: Window, start_s: float) -> float:
    """
    Return how far beyond the headings before a time it swings after it [rad].

    0 where nothing shows the heading.
    """
    if not len(window.heading):
        return 0.0
    time_s, angle = binned(
        seconds(window.heading, window), np.unwrap(window.heading.value), _HEADINGS
    )
    before, after = angle[time_s < start_s], angle[time_s >= start_s]
    if not len(before) or not len(after):
        return 0.0
    return float(max(after.max() - before.max(), before.min() - after.min(), 0.0))


def _direction(window: Window, parameters: Parameters) -> tuple[Float64, Float64, float]:
    """Return time [s], heading or course without jumps [rad], and how far noise swings it."""
    if len(window.heading):
        time_s = seconds(window.heading, window)
        return *binned(time_s, np.unwrap(window.heading.value), _HEADINGS), 0.0
    course = _course(window, _HEADINGS // 6)
    if course is None:
        return np.empty(0), np.empty(0), 0.0
    t, speed, angle, noise_m = course
    moves = speed > _MOVING * float(speed.max())
    if not moves.any():  # at rest
        return np.empty(0), np.empty(0), 0.0
    # a fix that errs turns the course by more where the way is short
    step_s = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    doubt = 6.0 * noise_m / max(step_s * float(speed[moves].min()), 1e-9)
    return t[moves], np.unwrap(angle[moves]), doubt


def _course(window: Window, count: int) -> tuple[Float64, Float64, Float64, float] | None:
    """Return time, speed, course over steps of the track, and the noise of its ends [m]."""
    track = window.position
    if len(track) < 2 * count:
        return None
    time_s = seconds(track, window)
    t, east = binned(*clean_readings(time_s, track.value[:, 0]), count)
    _, north = binned(*clean_readings(time_s, track.value[:, 1]), count)
    if len(east) != len(north) or len(t) < 3:
        return None
    way = np.column_stack([np.diff(east), np.diff(north)])
    bend = np.diff(track.value, 2, axis=0)
    noise_m = MAD_TO_SD * float(np.median(np.abs(bend))) / math.sqrt(6.0 * len(track) / count)
    speed = np.hypot(way[:, 0], way[:, 1]) / np.diff(t)
    return 0.5 * (t[1:] + t[:-1]), speed, np.arctan2(way[:, 1], way[:, 0]), noise_m


def astern(window: Window, parameters: Parameters) -> list[NotCoastdown]:
    """
    Find when the ship goes astern: a negative log, or a course against her heading.
    """
    log = window.speed_through_water
    if len(log):
        time_s = seconds(log, window)
        t, v = binned(*clean_readings(time_s, log.value), _HEADINGS)
        text = f'the ship goes astern, at up to {-float(v.min()):.3g} m/s by the log'
        found = _where(window, t, v < 0.0, v < -_ASTERN * float(np.abs(v).max()), text)
        if found:
            return found
    course = _course(window, _HEADINGS // 3)
    if course is None or not len(window.heading):
        return []
    t, speed, angle, _ = course
    heading_s = seconds(window.heading, window)
    yaw = np.interp(t, heading_s, np.unwrap(window.heading.value))
    there = [rep103_yaw(float(each), parameters.heading_convention) for each in yaw]
    against = np.cos(angle - np.array(there)) < _OPPOSED
    text = 'the ship goes astern: her course is against her heading'
    return _where(window, t, against, speed > _MOVING * float(speed.max()), text)


def _where(
    window: Window, t: Float64, there: NDArray[np.bool_], clearly: NDArray[np.bool_], text: str
) -> list[NotCoastdown]:
    """Return the runs of bins in which she goes astern, of those in which she clearly does."""
    half = 0.5 * float(t[1] - t[0]) if len(t) > 1 else 0.0
    found = []
    for first, last in runs(there, t, 0.0):
        if np.any(there[first : last + 1] & clearly[first : last + 1]):
            start_s = 0.0 if first == 0 else float(t[first]) - half
            end_s = length_s(window) if last == len(t) - 1 else float(t[last]) + half
            found.append(cut_of(window, start_s, end_s, Dismissal.ASTERN, text))
    return found


def gaps(window: Window, parameters: Parameters) -> list[NotCoastdown]:
    """
    Find when nothing shows the motion for longer than `data_stop_s`, or a third of the window.
    """
    heard = [series.time_ns for series in window.each(*MOTION_INPUTS)]
    stamps = np.unique(np.concatenate(heard))
    if len(stamps) < 2:
        return []
    time_s = np.asarray((stamps - window.start_ns) * 1e-9, np.float64)
    apart = np.diff(time_s)
    longest = max(
        min(parameters.data_stop_s, length_s(window) / 3.0), 10.0 * float(np.median(apart))
    )
    return [
        cut_of(
            window,
            float(time_s[i]),
            float(time_s[i + 1]),
            Dismissal.GAP,
            f'no speed and no position for {apart[i]:.0f} s',
        )
        for i in np.flatnonzero(apart > longest)
    ]


def runs(there: NDArray[np.bool_], time_s: Float64, join_s: float) -> list[tuple[int, int]]:
    """Return first and last of each run, those with a short pause between them as one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]])))
    found: list[tuple[int, int]] = []
    for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if found and time_s[first] - time_s[found[-1][1]] <= join_s:
            found[-1] = (found[-1][0], after - 1)
        else:
            found.append((first, after - 1))
    return found


def length_s(window: Window) -> float:
    return (window.end_ns - window.start_ns) * 1e-9


def until(time_s: Float64, last: int, window: Window) -> float:
    """Return when a reading is followed by another one, at most the end of the window."""
    return float(time_s[last + 1]) if last + 1 < len(time_s) else length_s(window)


def cut_of(
    window: Window, start_s: float, end_s: float, reason: Dismissal, text: str
) -> NotCoastdown:
    start_ns = window.start_ns + round(start_s * SECOND_NS)
    end_ns = min(window.start_ns + round(end_s * SECOND_NS), window.end_ns)
    return NotCoastdown(start_ns, end_ns, reason, text)
