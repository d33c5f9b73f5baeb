# SPDX-License-Identifier: Apache-2.0
"""
When a propeller drives the ship, by its shaft and its pitch.

A shaft that stands, or that the water turns in proportion to the ship's speed, is
no thrust, and nor is any shaft at zero pitch.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.coastdown.events import Dismissal, EndedCoastdown, NotCoastdown
from shipdrag_ros.coastdown.instruments import cut_of, length_s, runs, until
from shipdrag_ros.coastdown.readings import LEAST_READINGS, binned, readings, seconds
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.samples import SECOND_NS, Float64
from shipdrag_ros.ship import Ship

_IDLE = 0.1  # of the fastest shaft or the largest pitch: a hundredth of the thrust
_DRIVING = 0.9  # of the turns a metre that drive the ship: the water alone turns it by less
_STEADY = 0.97  # of its speed a ship keeps that is driven evenly
_SHOWN = 1.1  # the speed falls by so much: then a shaft can be seen to follow it
_FOLLOWS = 0.5  # power of the ship's speed by which a shaft falls at least, if not driven
_OFTENER = 1.15  # what turns with the water does not turn more often a metre by this
_PARTS = 24  # of a run
_RUNS_DOWN = 4.0  # by which one falls that an engine lets run down
_RISES = 1.3  # a shaft that the water turns does not go faster again
_JOIN = 0.05  # of the window: pauses of the thrust no longer than this are part of it
_DIAMETER = 0.05  # of a propeller, of the length, where it is not stated
_SLIP = 0.1  # of the ship's speed: a screw that goes forward by less can drive nothing
_RUN_DOWNS, _ONSET_S = 5.0, 30.0
_PUSHES = 0.7  # of those: with fewer a propeller hardly pushes


def thrust(window: Window, ship: Ship) -> list[NotCoastdown]:
    """
    Find when a propeller drives, or is driven astern.

    Parameters
    ----------
    window
        With the record `before` it, if there is any.
    ship
        For the size of the propeller.
    """
    record = [_joined(window, number) for number in range(len(window.shafts))]
    top = max((float(np.abs(n).max(initial=0.0)) for _, n, _ in record), default=0.0)
    speed_s, speed = _speed_of_record(window)
    # a current makes turns a metre over ground grow or fall by themselves
    by_log = len(window.speed_through_water) >= LEAST_READINGS
    several = sum(len(time_s) > 0 for time_s, _, _ in record) > 1
    found: list[NotCoastdown] = []
    for number, (time_s, turning, idle) in enumerate(record):
        if not len(time_s) or time_s[-1] < 0.0:
            continue
        v = np.interp(time_s, speed_s, speed) if len(speed_s) else np.full(len(time_s), np.nan)
        fast = (np.abs(turning) > _IDLE * top) & _can_drive(turning, v, ship) & ~idle
        drives = _driven(time_s, turning, v, fast, by_log=by_log)
        driven = turning[fast]
        ahead = 1.0 if not len(driven) or np.median(driven) >= 0.0 else -1.0
        name = f'shaft {number + 1}' if several else 'the shaft'
        for first, last in runs(drives & (time_s >= 0.0), time_s, _JOIN * length_s(window)):
            start_s, end_s = max(float(time_s[first]), 0.0), until(time_s, last, window)
            run = turning[first : last + 1]
            fastest = float(run[np.argmax(np.abs(run))])
            is_astern = fastest < 0.0 < ahead
            usual = float(np.median(run))
            text = (
                f'{name} turns at {usual:.3g} rad/s, up to {fastest:.3g} '
                f'({fastest * 30.0 / math.pi:.0f} rpm), '
                f'{"astern" if is_astern else "not as the water alone turns it: that is thrust"}'
            )
            reason = Dismissal.ASTERN if is_astern else Dismissal.THRUST
            found.append(cut_of(window, start_s, end_s, reason, text))
    return found


def start_of(coastdown: EndedCoastdown, ship: Ship) -> tuple[int, bool]:
    """
    Return the start of a window that was given, and whether what comes before may be steady.

    The run-down of the thrust is cut, but it follows the stop: with it, the record before is as
    good as before any other. What was cut before that, the engine drove.

    Parameters
    ----------
    coastdown
        As it was judged.
    ship
        For how long the thrust runs down.
    """
    cuts = [cut for cut in coastdown.cuts if cut.start_ns < coastdown.start_ns]
    if not cuts or any(cut.reason is not Dismissal.THRUST for cut in cuts):
        return coastdown.start_ns, not cuts
    constant_s = 0.0 if ship.propulsion is None else ship.propulsion.run_down_s
    gone_ns = round((_ONSET_S + _RUN_DOWNS * constant_s) * SECOND_NS)
    return max(min(cut.start_ns for cut in cuts), coastdown.start_ns - gone_ns), True


def _joined(window: Window, number: int) -> tuple[Float64, Float64, NDArray[np.bool_]]:
    """Return time [s], shaft speed without single spikes, and where the pitch is zero."""
    parts = [window] if window.before is None else [window.before, window]
    time_s = np.concatenate([seconds(p.shafts[number], window) for p in parts])
    turning = np.concatenate([p.shafts[number].value for p in parts])
    if len(turning) > 2:
        three = np.column_stack([turning[:-2], turning[1:-1], turning[2:]])
        turning = np.concatenate([turning[:1], np.median(three, axis=1), turning[-1:]])
    pitch_s = np.concatenate([seconds(p.pitches[number], window) for p in parts])
    pitch = np.abs(np.concatenate([p.pitches[number].value for p in parts]))
    if not len(pitch):
        return time_s, turning, np.zeros(len(time_s), bool)
    held = np.clip(np.searchsorted(pitch_s, time_s, side='right') - 1, 0, None)
    return time_s, turning, np.asarray(pitch[held] <= max(_IDLE * pitch.max(), 0.02))


def _speed_of_record(window: Window) -> tuple[Float64, Float64]:
    """Return the speed before and in the window."""
    found = [readings(window)]
    if window.before is not None:
        t, v = readings(window.before)
        found.insert(0, (t - (window.start_ns - window.before.start_ns) * 1e-9, v))
    parts = [binned(t, v) for t, v in found if len(t)]
    if not parts:
        return np.empty(0), np.empty(0)
    return np.concatenate([t for t, _ in parts]), np.concatenate([v for _, v in parts])


def _can_drive(turning: Float64, speed: Float64, ship: Ship) -> NDArray[np.bool_]:
    """Say where a screw of about its size goes forward at all, beside the ship's speed."""
    diameter = _DIAMETER * ship.length_m if ship.propeller is None else ship.propeller.diameter_m
    advance = np.abs(turning) / (2.0 * math.pi) * 2.0 * diameter  # of the steepest pitch
    return np.asarray(~(advance < _SLIP * np.abs(speed)))


def _driven(
    time_s: Float64,
    turning: Float64,
    speed: Float64,
    fast: NDArray[np.bool_],
    *,
    by_log: bool,
) -> NDArray[np.bool_]:
    """Say where an engine turns a shaft, and not the water."""
    size = np.abs(turning)
    if not np.isfinite(speed).all():
        return fast
    turns = size / np.maximum(np.abs(speed), max(0.02 * float(np.abs(speed).max()), 1e-9))
    drives = np.zeros(len(size), bool)
    usual = _usual_turns(time_s, turning, turns, speed, fast)
    if usual is not None:
        ratio, sign = usual
        drives |= fast & ((turns >= _DRIVING * ratio) | (turning * sign < 0.0))
    inside = time_s >= 0.0
    for first, last in runs(fast & ~drives & inside, time_s, 0.0):
        run = slice(first, last + 1)
        drives[run] |= _is_driven(
            size[run],
            turning[run],
            np.abs(speed[run]),
            usual=None if usual is None else usual[0],
            by_log=by_log,
        )
    return drives


def _usual_turns(
    time_s: Float64,
    turning: Float64,
    turns: Float64,
    speed: Float64,
    fast: NDArray[np.bool_],
) -> tuple[float, float] | None:
    """Return turns a metre and sense of the shaft as it drives the ship; None if not known."""
    past = np.flatnonzero(time_s < 0.0)
    if len(past) < 6:
        return None
    third = len(past) // 3
    early, late = np.median(speed[past[:third]]), np.median(speed[past[-third:]])
    driven = past[fast[past]]
    even = _STEADY * early <= late <= early / _STEADY
    if not even or len(driven) < 0.5 * len(past):
        return None
    return float(np.median(turns[driven])), float(np.sign(np.median(turning[driven])))


def _is_driven(
    size: Float64,
    turning: Float64,
    speed: Float64,
    *,
    usual: float | None,
    by_log: bool,
) -> NDArray[np.bool_]:
    """Judge one run of a turning shaft by whether it follows the ship's speed."""
    # one that is let go may go faster, up to what the water makes it
    least = 0.0 if usual is None else _PUSHES * usual
    rises = (size > _RISES * np.minimum.accumulate(size)) & (size > least * speed)
    turned = turning * np.sign(turning[0]) < 0.0
    some = max(1, len(size) // 5)
    fell = _fall(speed, some)
    slowed = _fall(size, some)
    if fell > _SHOWN:
        power = math.log(max(slowed, 1e-9)) / math.log(fell)
        follows = _FOLLOWS <= power < _RUNS_DOWN
        follows = follows and not (by_log and least and _pushes_again(size, speed, least))
    else:
        # what turns with the water does not make the ship faster
        follows = usual is not None and slowed < _RISES and fell > _STEADY
    return rises | turned if follows else np.ones(len(size), bool)


def _pushes_again(size: Float64, speed: Float64, least: float) -> bool:
    """
    Say whether the turns a metre rise, to more than `least`.

    One that runs down, or is taken back in steps, falls with the ship over all, and yet
    keeps its speed in between.
    """
    count = min(len(size), _PARTS)
    n, v = (
        np.array([part.mean() for part in np.array_split(value, count)]) for value in (size, speed)
    )
    turns = n / np.maximum(v, 1e-9)
    rises = turns > _OFTENER * np.minimum.accumulate(turns)
    return bool(np.any(rises & (turns > least)))


def _fall(value: Float64, some: int) -> float:
    """Return the mean of the first few over that of the last few."""
    first, last = float(np.mean(value[:some])), float(np.mean(value[-some:]))
    return first / max(last, 1e-9)
