# SPDX-License-Identifier: Apache-2.0
"""
The samples of coastdowns that a replay has found, with the steady record before each.

Also the sound samples of a whole run, whatever was done in it.
"""

from __future__ import annotations

from dataclasses import replace

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
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.given_window import margin_around_ns, parts_of_one_clock
from shipdrag_ros.replay.playback import ReplayResult, feed, recorded_parameters
from shipdrag_ros.samples import (
    ALL_MOTION,
    KIND,
    SECOND_NS,
    Block,
    Channel,
    Reason,
    concatenate,
)
from shipdrag_ros.ship import Ship

DISMISSED = (
    'she lost speed without thrust, but not as water alone slows a ship; no coastdown is taken '
    'from it'
)
_CLOCKS_APART_S = 600.0  # what comes late, since the clocks differ, is to be diagnosed
_SHORTEST_M = 1.0  # a craft, where no ship is known
_MOST = 0.5  # of the messages of an input


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
            found.append((coastdown, replace(window, told_ns=coastdown.told_ns)))
    return found


def begins(coastdown: EndedCoastdown) -> tuple[int, bool]:
    """
    Return when the thrust began to fall, and whether what comes before may be steady sailing.
    """
    if coastdown.stop_ns is None:  # given, and what she did before was cut: driven, she is steady
        cut = any(
            each.start_ns < coastdown.start_ns and each.reason is not Dismissal.THRUST
            for each in coastdown.cuts
        )
        return coastdown.start_ns, not cut
    return coastdown.stop_ns, True


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
    window = window_between(result, first_ns, last_ns, steady=steady)
    return replace(window, told_ns=coastdown.told_ns)


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
    ParameterError
        If those attached cannot be used.
    """
    parameters = recorded_parameters(run)
    block = concatenate([item for item in run.inputs() if isinstance(item, Block)])
    reason = validate(block, parameters, _SHORTEST_M if ship is None else ship.length_m)
    accepted = reason == Reason.ACCEPTED
    if zeros:
        of_log = KIND[block.channel] == Channel.SPEED_THROUGH_WATER
        accepted |= (reason == Reason.FROZEN) & of_log & (block.value[:, 0] == 0.0)
    return block[np.flatnonzero(accepted)], parameters
