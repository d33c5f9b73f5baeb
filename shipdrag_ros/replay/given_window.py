# SPDX-License-Identifier: Apache-2.0
"""One window of a run, given by hand: what is read for it and what it gives."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.bags.run import Run, RunSamples
from shipdrag_ros.coastdown import validate
from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown
from shipdrag_ros.coastdown.given import GivenPart, estimate_given
from shipdrag_ros.coastdown.heading import HEADING_BEFORE_S, rep103_yaw
from shipdrag_ros.errors import BagError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Block, Channel, Float64, Reason, UInt8
from shipdrag_ros.ship import Ship

_SET_CLOCK_S = 10.0


class WindowSamples(NamedTuple):
    """
    What is read for a window.

    Attributes
    ----------
    inputs
        Of the messages that came in the window; spent, with its counts.
    block, reasons
        Samples and the `Reason` of each, of a while around the window too.
    inside : (n,) bool
        Which of these came in the window.
    start_ns, end_ns
        The window in stamps [ns].
    begin_ns
        Arrival at which the bag begins [ns].
    """

    inputs: RunSamples
    block: Block
    reasons: UInt8
    inside: NDArray[np.bool_]
    start_ns: int
    end_ns: int
    begin_ns: int


def read_window(
    run: Run, ship: Ship, parameters: Parameters, window: tuple[float, float]
) -> WindowSamples:
    """
    Read and validate the samples of a window, and of a while around it.

    Parameters
    ----------
    run
        From `open_runs`.
    ship, parameters
        For the validation, which needs some record before the window.
    window
        Begin and end [s from the start of the bag]; it ends with the bag at
        the latest.

    Raises
    ------
    BagError
        If the window lies outside of the bag.

    Notes
    -----
    The bag starts at its first time of arrival; stamps decide what is inside.
    Where the clock of the sensors is another than that of the recorder, the
    window is shifted by what they differ at the first sample used.
    """
    span = run.span_ns
    try:
        start_s, end_s = map(float, window)
    except (TypeError, ValueError) as error:
        raise BagError(f'window {window!r}: expected its start and end [s]') from error
    length_s = 0.0 if span is None else (span[1] - span[0]) / SECOND_NS
    if span is None or not (0.0 <= start_s < end_s < math.inf and start_s < length_s):
        raise BagError(
            f'window {start_s:g} to {end_s:g} s: expected 0 <= start < end inside of '
            f'{run.name!r}, which is {length_s:.3f} s long'
        )
    start_ns = span[0] + round(start_s * SECOND_NS)
    # of what is not there, nothing
    end_ns = span[1] if end_s >= length_s else span[0] + round(end_s * SECOND_NS)
    margin_ns = margin_around_ns(parameters)
    first_ns = max(start_ns - margin_ns, 0)
    block = run.inputs(start_ns=first_ns, end_ns=end_ns + margin_ns).block()
    inside = (block.receive_ns >= start_ns) & (block.receive_ns <= end_ns)
    inputs = run.inputs(start_ns=start_ns, end_ns=end_ns)
    deque(inputs, maxlen=0)  # counted, and the samples are there already
    reasons = validate(block, parameters, ship.length_m)
    accepted = np.flatnonzero(reasons == Reason.ACCEPTED)
    if len(accepted):
        within = accepted[inside[accepted]]
        first = int((within if len(within) else accepted)[0])  # the clock of before may be another
        clock_ns = int(block.stamp_ns[first] - block.receive_ns[first])
        start_ns, end_ns = start_ns + clock_ns, end_ns + clock_ns
    return WindowSamples(inputs, block, reasons, inside, start_ns, end_ns, span[0])


def margin_around_ns(parameters: Parameters) -> int:
    """
    Return how far around a window to read: the validation looks back, and clocks may differ.
    """
    return round((parameters.frozen_s + parameters.late_s + _SET_CLOCK_S) * SECOND_NS)


def estimate_window(samples: WindowSamples, ship: Ship, parameters: Parameters) -> EndedCoastdown:
    """
    Estimate r(v) from a window, as of a coastdown that has ended.

    A person's claim is examined like any other: what is no coastdown is cut. What came
    before is not known to be steady sailing; it helps to examine, and teaches the
    estimate nothing.
    """
    used = samples.reasons == Reason.ACCEPTED
    accepted, inside = samples.block[used], samples.inside[used]
    start_ns, end_ns = samples.start_ns, samples.end_ns
    parts = [part for part in parts_of_one_clock(accepted) if inside[part].any()]
    if len(parts) > 1:
        failure = _clock_set(accepted, parts, samples.begin_ns)
        found = GivenPart(start_ns, end_ns, failure=failure, refused=True)
    else:
        accepted = accepted[parts[0]] if parts else accepted[:0]
        before_ns = int(accepted.stamp_ns.min()) if len(accepted) else None
        window = Window.from_block(accepted, start_ns, end_ns, before_ns=before_ns)
        found = estimate_given(window, ship, parameters, estimate_final)
    heading = _heading(accepted, found.start_ns)
    return EndedCoastdown(
        found.start_ns,
        found.end_ns,
        None,
        EndedBy.GIVEN,
        found.estimate,
        found.failure,
        None if heading is None else rep103_yaw(heading, parameters.heading_convention),
        withdrawn=found.refused,
        cuts=found.cuts,
        stretch=found.stretch,
    )


def _clock_set(accepted: Block, parts: list[slice], begin_ns: int) -> str:
    """Say where a clock was set in a window, and which window to choose instead."""
    set_ns = int(accepted.receive_ns[parts[-1].start])
    failure = f'a clock was set in the window, at {(set_ns - begin_ns) / SECOND_NS:.0f} s'
    if int(accepted.receive_ns[parts[-1].stop - 1]) > set_ns:
        return f'{failure}; choose one that ends before or begins after it'
    return (
        f'{failure}; choose one that ends before it. What follows has no time of its own in this '
        'bag: import the table again, or what follows alone'
    )


def parts_of_one_clock(accepted: Block) -> list[slice]:
    """
    Return the parts of a record between which a clock was set.

    Parameters
    ----------
    accepted
        What was accepted, in the order of its arrival.
    """
    parts, first, count = [], 0, len(accepted)
    while first < count:
        last = count
        for channel in np.unique(accepted.channel[first:]):
            rows = first + np.flatnonzero(accepted.channel[first:] == channel)
            back = np.flatnonzero(np.diff(accepted.stamp_ns[rows]) <= 0)
            if len(back):
                last = min(last, int(rows[back[0] + 1]))
        parts.append(slice(first, last))
        first = last
    return parts


def _heading(accepted: Block, start_ns: int) -> float | None:
    """Return the mean heading before a time, or else just after it, as sent [rad]."""
    is_heading = accepted.channel == Channel.HEADING
    yaw: Float64 = accepted.value[is_heading, 0]
    after_s = (accepted.stamp_ns[is_heading] - start_ns) / SECOND_NS
    for near in (
        (after_s <= 0.0) & (after_s >= -HEADING_BEFORE_S),
        (after_s >= 0.0) & (after_s <= HEADING_BEFORE_S),
    ):
        if near.any():
            return math.atan2(float(np.sin(yaw[near]).mean()), float(np.cos(yaw[near]).mean()))
    return None
