# SPDX-License-Identifier: Apache-2.0
"""
The samples of coastdowns that a replay has found, with the steady record before each.

Also the sound samples of a whole run, whatever was done in it, and why none was found, as far as
a replay and the speed itself show.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from shipdrag_ros.bags.run import Run
from shipdrag_ros.coastdown import Monitor, validate
from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedBy,
    EndedCoastdown,
    Event,
    NotCoastdown,
    WholeGlide,
)
from shipdrag_ros.display import duration
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.playback import (
    ReplayResult,
    feed,
    margin_around_ns,
    parts_of_one_clock,
    recorded_parameters,
    refuse_without_input,
)
from shipdrag_ros.samples import (
    ALL_MOTION,
    KIND,
    MOTION_INPUTS,
    SECOND_NS,
    Block,
    Channel,
    Float64,
    Reason,
)
from shipdrag_ros.ship import Ship

DISMISSED = (
    'she lost speed without thrust, but not as water alone slows a ship; no coastdown is taken '
    'from it'
)
_CLOCKS_APART_S = 600.0  # what comes late, since the clocks differ, is to be diagnosed
_SHORTEST_M = 1.0  # a craft, where no ship is known
_MOST = 0.5  # of the messages of an input
_BINS = 6  # of a slope window, which is shorter for small craft
_GLIDE_WINDOWS = 10.0  # of them; within it a ship that glides has slowed
_SLOWED = 0.1  # of the speed; what falls less is the sea
_STILL_S = 300.0  # a reading that does not change for so long, to the last bit, ...
_STILL_READINGS = 60  # ... so often, is none
_SHOWN = 3  # of the stretches that were dismissed


def clocks_apart(result: ReplayResult) -> tuple[str, ...]:
    """
    Return the inputs of motion whose clock is too slow or too fast.

    Most of their messages are rejected as late, or as from the future.
    """
    off = {
        name: counts.rejected.get('late', 0) + counts.rejected.get('future', 0)
        for name, counts in result.inputs.items()
    }
    return tuple(
        name
        for name in ALL_MOTION
        if name in off and off[name] > _MOST * result.inputs[name].messages
    )


def coast_windows(result: ReplayResult) -> list[tuple[EndedCoastdown, Window]]:
    """
    Read the samples of each coastdown again.

    Parameters
    ----------
    result
        From `replay`.

    Returns
    -------
    list of (coastdown, window)
        In their order, without those withdrawn; the window holds what was
        accepted, and the record before it.

    Notes
    -----
    A sensor whose clock is slow is heard too. Where there are `clocks_apart`,
    fast ones as well, coastdowns are looked for anew; those have no estimate.
    """
    coastdowns = result.coastdowns
    given = any(each.ended_by is EndedBy.GIVEN for each in coastdowns)
    if clocks_apart(result) and not given:
        coastdowns = _look_anew(result) or coastdowns
    found = []
    for coastdown in coastdowns:
        if not coastdown.withdrawn:
            start_ns, steady = begins(coastdown)
            window = window_between(result, start_ns, coastdown.end_ns, steady=steady)
            found.append((coastdown, _as_told(window, coastdown)))
    return found


def _as_told(window: Window, coastdown: EndedCoastdown) -> Window:
    """Say in a window what a person said of its coastdown."""
    found = coastdown.ended_by is not EndedBy.GIVEN
    return replace(window, told_ns=coastdown.told_ns, found=found)


def begins(coastdown: EndedCoastdown) -> tuple[int, bool]:
    """
    Return when the thrust began to fall, and whether what comes before may be steady sailing.
    """
    driven = all(  # up to it, where nothing but thrust was cut before it
        each.start_ns >= coastdown.start_ns or each.reason is Dismissal.THRUST
        for each in coastdown.cuts
    )
    stop_ns = coastdown.start_ns if coastdown.stop_ns is None else coastdown.stop_ns
    return (stop_ns if driven else coastdown.start_ns), driven


def whole_window(result: ReplayResult, coastdown: EndedCoastdown) -> Window | None:
    """
    Read a coastdown with the parts about it in which something but the water may have acted.

    Returns
    -------
    Window or None
        None where there is none.
    """
    start_ns, steady = begins(coastdown)
    # what acted from the stop on leaves all that was before it
    steady = steady or any(cut.start_ns < coastdown.start_ns for cut in coastdown.cuts)
    acted: list[WholeGlide | NotCoastdown] = [
        cut for cut in coastdown.cuts if cut.reason in (Dismissal.BRAKE, Dismissal.TURN)
    ]
    parts = [
        (each.start_ns, each.end_ns)
        for each in (*result.whole_glides, *acted)
        if each.start_ns <= coastdown.end_ns and coastdown.start_ns <= each.end_ns
    ]
    if not parts:
        return None
    first_ns = min(start_ns, *(first for first, _ in parts))
    last_ns = max(coastdown.end_ns, *(last for _, last in parts))
    return _as_told(window_between(result, first_ns, last_ns, steady=steady), coastdown)


def dismissed_glides(result: ReplayResult) -> list[Window]:
    """
    Read what she did without thrust where no coastdown was found in it.
    """
    return [
        window_between(result, glide.start_ns, glide.end_ns, steady=True)
        for glide in result.whole_glides
        if all(each.withdrawn for each in result.coastdowns)
    ]


def _look_anew(result: ReplayResult) -> tuple[EndedCoastdown, ...]:
    """Look for coastdowns in what all inputs say, whatever their clocks."""
    parameters = replace(
        result.parameters,
        late_s=_CLOCKS_APART_S,
        # by the clocks of the others, an input that is behind is silent
        data_stop_s=max(result.parameters.data_stop_s, _CLOCKS_APART_S),
    )
    monitor = Monitor(result.ship, parameters, estimate=_refuse, final=_refuse)
    events: list[Event] = []
    for item in result.run.inputs():
        events += feed(monitor, _arrived_later(item) if isinstance(item, Block) else item)
    events += monitor.finish()
    return tuple(
        event for event in events if isinstance(event, EndedCoastdown) and not event.withdrawn
    )


def _refuse(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    raise EstimationError('the clocks of the inputs are apart')


def _arrived_later(block: Block) -> Block:
    """Return samples for which a stamp of a fast clock is not from the future."""
    return replace(block, receive_ns=block.receive_ns + round(_CLOCKS_APART_S * SECOND_NS))


def window_between(result: ReplayResult, start_ns: int, end_ns: int, *, steady: bool) -> Window:
    """
    Read the samples of a part of a replay again.

    Parameters
    ----------
    result
        From `replay`.
    start_ns, end_ns
        Stamps [ns].
    steady
        The record before may be steady sailing, and is read too.

    Returns
    -------
    Window
        What was accepted.
    """
    parameters = replace(result.parameters, late_s=_CLOCKS_APART_S)
    before_ns = round(parameters.steady_s * SECOND_NS)
    margin_ns = margin_around_ns(parameters)
    block = result.samples(start_ns - before_ns, end_ns, margin_ns)
    length_m = result.ship.length_m
    heard = _arrived_later(block) if clocks_apart(result) else block
    reasons = validate(heard, parameters, length_m)
    accepted = block[np.flatnonzero(reasons == Reason.ACCEPTED)]
    # a clock that was set tells some times twice
    shown = [
        (int(np.count_nonzero((start_ns <= stamps) & (stamps <= end_ns))), part)
        for part in parts_of_one_clock(accepted)
        if len(stamps := accepted.stamp_ns[part])
    ]
    if shown:
        accepted = accepted[max(shown, key=lambda each: each[0])[1]]
    before = start_ns - before_ns if steady else None
    return Window.from_block(accepted, start_ns, end_ns, before_ns=before)


def accepted_samples(
    run: Run, ship: Ship | None, *, zeros: bool = False
) -> tuple[Block, Parameters]:
    """
    Read a run as it would be on board, without looking for a coastdown.

    Parameters
    ----------
    run
        From `open_runs`.
    ship
        None: a craft of any size may have sailed it.
    zeros
        A log that reads exactly 0 for long is no frozen one: below some speed a
        wheel stands still.

    Returns
    -------
    block, parameters
        Accepted samples in arrival order; the parameters attached to the bag,
        by which they are accepted.

    Raises
    ------
    BagError
        If it holds no input.
    ParameterError
        If those attached cannot be used.
    """
    refuse_without_input(run)
    parameters = recorded_parameters(run)
    block = run.inputs().block()
    reason = validate(block, parameters, _SHORTEST_M if ship is None else ship.length_m)
    accepted = reason == Reason.ACCEPTED
    if zeros:
        of_log = KIND[block.channel] == Channel.SPEED_THROUGH_WATER
        accepted |= (reason == Reason.FROZEN) & of_log & (block.value[:, 0] == 0.0)
    return block[np.flatnonzero(accepted)], parameters


class _SpeedLoss(NamedTuple):
    """The largest loss of speed within `_GLIDE_WINDOWS`."""

    start_s: float
    end_s: float
    from_m_s: float
    to_m_s: float

    @property
    def lost(self) -> float:
        return 1.0 - self.to_m_s / self.from_m_s


def why_no_coastdown(result: ReplayResult) -> str:
    """
    Say why a replay has found no coastdown, and what to do.

    Parameters
    ----------
    result
        From `replay`, without a coastdown.

    Returns
    -------
    str
        Part of a sentence.
    """
    still, why = _stood_still(result), _why(result)
    left_out = [
        f'the {name.replace("_", " ")} is left out: {text}'
        for name, text in result.left_out.items()
        if text not in why
    ]
    return '; '.join([*left_out, still, why] if still else [*left_out, why])


def _why(result: ReplayResult) -> str:
    """Say why by what was given or dismissed, or else by what the speed did."""
    for one in result.coastdowns:
        if one.failure and not one.cuts:
            return one.failure
    if result.not_coastdowns:
        return _dismissed(result)
    block, _ = accepted_samples(result.run, result.ship)
    if not len(block):
        return f'no message of {", ".join(MOTION_INPUTS)} could be used'
    names = [each for each in ALL_MOTION if each not in result.left_out]
    window_s = result.parameters.slope_window_s
    name, fall = _largest_fall(block, names, window_s)
    if not name:
        return f'no message of {", ".join(MOTION_INPUTS)} could be used'
    if fall is None:
        return f'there is too little of {name} to know what steady sailing is'
    if fall.lost < _SLOWED:
        return (
            f'by {name} nothing slowed: the speed never fell by more than {fall.lost:.0%} within '
            f'{duration(_GLIDE_WINDOWS * window_s)}'
        )
    fell = (
        f'the speed by {name} fell most from {fall.from_m_s:.2f} to {fall.to_m_s:.2f} m/s, at '
        f'{fall.start_s:.0f} to {fall.end_s:.0f} s of the record'
    )
    if fall.start_s < window_s:
        return (
            f'{fell}, with only {fall.start_s:.0f} s before it where at least {window_s:.0f} s of '
            'steady sailing are needed; if the engine was stopped there, say so with --window '
            'START END'
        )
    return (
        f'{fell}, but not as after an engine stop from steady sailing (less power, a turn, '
        'unsteady speed before); if it was one, say so with --window START END'
    )


def _stood_still(result: ReplayResult) -> str:
    """Say that a speed sent one value for long, as no ship at sea does; '' where none did."""
    said = []
    blocks = [item for item in result.run.inputs() if isinstance(item, Block)]
    speeds = (Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND)
    for channel in (each for each in Channel if each.kind in speeds):
        read = [block[block.channel == channel] for block in blocks]
        stamp_ns = np.concatenate([block.stamp_ns for block in read]) if read else np.empty(0)
        if not len(stamp_ns):
            continue
        value = np.concatenate([block.value[:, 0] for block in read])
        edges = np.concatenate([[0], np.flatnonzero(value[1:] != value[:-1]) + 1, [len(value)]])
        for first, after in pairwise(edges.tolist()):
            lasts_s = float(stamp_ns[after - 1] - stamp_ns[first]) * 1e-9
            # a ship may well lie still
            if value[first] and after - first >= _STILL_READINGS and lasts_s >= _STILL_S:
                since_s = float(stamp_ns[first] - stamp_ns[0]) * 1e-9
                said.append(
                    f'{channel.input} stood still at {value[first]:.3g} m/s for '
                    f'{lasts_s / 60.0:.0f} min, from {since_s:.0f} s of it on'
                )
    return '; '.join(said[:_SHOWN])


def _dismissed(result: ReplayResult) -> str:
    """Say what was nearly a coastdown, and why it is none."""
    first_ns = result.run.span_ns[0] if result.run.span_ns else 0
    parts = [
        f'from {(one.start_ns - first_ns) * 1e-9:.0f} to {(one.end_ns - first_ns) * 1e-9:.0f} s '
        f'it was none ({one.reason.value}): {one.text}'
        for one in result.not_coastdowns[:_SHOWN]
    ]
    more = len(result.not_coastdowns) - _SHOWN
    if more > 0:
        parts.append(f'and {more} more, which `shipdrag replay` lists')
    return '; '.join(parts)


def slows_at_first(block: Block, window_s: float) -> float | None:
    """
    Return until when she slows from the first of some speeds on, as a ship that glides [s].

    Parameters
    ----------
    block
        Speeds, or places.
    window_s
        In which sailing is seen to be steady.

    Returns
    -------
    float or None
        From the first on; inf where she slows to the last; None where she sails steadily first,
        or too little shows it.
    """
    since_s = (block.stamp_ns - block.stamp_ns.min()) * 1e-9
    until_s = 0.0
    while since_s.max() - until_s >= window_s:
        rest = block[np.flatnonzero(since_s >= until_s)]
        _, fall = _largest_fall(rest, ALL_MOTION, window_s)
        if fall is None or fall.lost < _SLOWED or fall.start_s >= window_s:
            return until_s or None
        until_s += fall.end_s
    return math.inf


def _largest_fall(
    block: Block, names: Iterable[str], window_s: float
) -> tuple[str, _SpeedLoss | None]:
    """Return by which input, and the largest fall of its speed; '' where there is no input."""
    try:
        window = Window.from_block(block, int(block.stamp_ns.min()), int(block.stamp_ns.max()))
    except ValueError:  # a clock was set within the record
        return 'a clock that was set', None
    for name in names:
        series = window.series(name)
        if not len(series):
            continue
        time_s = (series.time_ns - window.start_ns) * 1e-9
        bins = _binned(np.asarray(time_s, np.float64), series.value, window_s / _BINS)
        return name, _fall(*bins, _GLIDE_WINDOWS * window_s)
    return '', None


def _binned(time_s: Float64, value: Float64, bin_s: float) -> tuple[Float64, Float64]:
    """Return times and speeds in bins, of speeds or of places; medians bear bad readings."""
    number = (time_s // bin_s).astype(np.int64)
    edges = np.flatnonzero(np.diff(number)) + 1
    times = np.array([part.mean() for part in np.split(time_s, edges)])
    medians = np.array([np.median(part, axis=0) for part in np.split(value, edges)])
    if value.ndim == 1:
        return times, np.abs(medians)
    gone = np.hypot(*np.diff(medians, axis=0).T)
    return 0.5 * (times[1:] + times[:-1]), gone / np.diff(times)


def _fall(time_s: Float64, speed_m_s: Float64, within_s: float) -> _SpeedLoss | None:
    """Return the largest fall, of medians over three bins; None where the bins are few."""
    if len(speed_m_s) < 4:
        return None
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(speed_m_s, 3), axis=1)
    time_s = time_s[1:-1]
    best: _SpeedLoss | None = None
    for first, fast in enumerate(smooth):
        last = first + int(np.searchsorted(time_s[first:], time_s[first] + within_s, side='right'))
        slow = first + int(np.argmin(smooth[first:last]))
        if fast <= 0.0:
            continue
        found = _SpeedLoss(
            float(time_s[first]), float(time_s[slow]), float(fast), float(smooth[slow])
        )
        if best is None or found.lost > best.lost:
            best = found
    return best
