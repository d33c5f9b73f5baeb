# SPDX-License-Identifier: Apache-2.0
"""
A run through the same monitor, estimator and encoder as on board.

Also one window of it, given by hand, through the same estimator.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from numbers import Real
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.bags.run import RECORDED, Mark, ResetMark, Run, RunSamples, StopMark
from shipdrag_ros.coastdown import Monitor, validate
from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedBy,
    EndedCoastdown,
    Event,
    InputCounts,
    NoEstimate,
    NotCoastdown,
    Update,
    WholeGlide,
)
from shipdrag_ros.coastdown.given import GivenPart, estimate_given
from shipdrag_ros.coastdown.heading import HEADING_BEFORE_S, rep103_yaw
from shipdrag_ros.coastdown.memory import InputTally
from shipdrag_ros.display import utc
from shipdrag_ros.errors import BagError
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.estimation.run_down import chance_told
from shipdrag_ros.messages import DEFAULT_NODE, TOPICS
from shipdrag_ros.messages.publishing import outputs
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.progress import PartDone
from shipdrag_ros.replay.comparison import Comparison, Recorded
from shipdrag_ros.samples import SECOND_NS, Block, Channel, Float64, Reason, UInt8
from shipdrag_ros.ship import SHIP_FILE, Ship
from shipdrag_ros.simulation.effects import checked

PARAMETERS_FILE = 'parameters.yaml'
WRONG_TYPE = 'type'
StopTime = float | datetime
"""In s from the start of the bag, or as a time of day with its zone."""
_SET_CLOCK_S = 10.0


class HeardSpan(NamedTuple):
    """
    A piece of a run: its first and last arrival, its lowest and highest stamp [ns].

    A clock may be another than that of the recorder, and may be set within a run.
    """

    first_ns: int
    last_ns: int
    low_ns: int
    high_ns: int

    @classmethod
    def of(cls, block: Block) -> HeardSpan:
        """
        Return that of some samples.
        """
        spans = (block.receive_ns, block.stamp_ns)
        return cls(*(int(end) for each in spans for end in (each.min(), each.max())))


@dataclass(frozen=True)
class ReplayResult:
    """
    What a run gave.

    Attributes
    ----------
    run
        What was replayed.
    ship, parameters
        What was used.
    coastdowns
        In their order, without those that were withdrawn.
    events
        All but those of the estimates while a coastdown ran, which recorded outputs stand for.
    inputs
        Messages and readings counted, of inputs that have any.
    recorded
        Comparison with the outputs in the bag.
    steady_lead_s
        The longest that the ship was steady; None where no coastdown was looked for.
    contradictions
        What was said of inputs that contradict another, by input.
    left_out
        The same of those that were not used for it.
    heard
        The pieces that were read.
    """

    run: Run
    ship: Ship
    parameters: Parameters
    coastdowns: tuple[EndedCoastdown, ...]
    events: tuple[Event, ...]
    inputs: Mapping[str, InputCounts]
    recorded: Recorded
    steady_lead_s: float | None = None
    contradictions: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    heard: tuple[HeardSpan, ...] = ()

    def samples(self, start_ns: int, end_ns: int, margin_ns: int) -> Block:
        """
        Read the samples stamped between two times again, by whatever clock.

        Parameters
        ----------
        start_ns, end_ns
            Stamps [ns].
        margin_ns
            What arrived so long before and after them is read too [ns].
        """
        holding = [
            each for each in self.heard if each.low_ns <= end_ns and each.high_ns >= start_ns
        ]
        if not holding:
            return Block.empty()
        first_ns = max(min(each.first_ns for each in holding) - margin_ns, 0)
        last_ns = max(each.last_ns for each in holding) + margin_ns
        block = self.run.inputs(start_ns=first_ns, end_ns=last_ns).block()
        arrived = block.receive_ns[(block.stamp_ns >= start_ns) & (block.stamp_ns <= end_ns)]
        if not len(arrived):
            return block[:0]
        near = block.receive_ns >= arrived.min() - margin_ns
        return block[np.flatnonzero(near & (block.receive_ns <= arrived.max() + margin_ns))]

    @property
    def whole_glides(self) -> tuple[WholeGlide, ...]:
        """
        What she did without thrust where that is probably not one glide.
        """
        return tuple(event for event in self.events if isinstance(event, WholeGlide))

    @property
    def not_coastdowns(self) -> tuple[NotCoastdown, ...]:
        """
        What was nearly a coastdown, and what was cut, in the order of their start.
        """
        found = [event for event in self.events if isinstance(event, NotCoastdown)]
        needed_s = self.parameters.slope_window_s
        if (
            self.steady_lead_s is not None
            and self.steady_lead_s < needed_s
            and not self.coastdowns
            and self.run.span_ns is not None
        ):
            slowest = float(self.ship.speed(self.parameters.froude_min))
            text = (
                f'the ship was never seen to sail ahead steadily, faster than {slowest:.2g} m/s, '
                f'for longer than {self.steady_lead_s:.0f} s; an onset can be found after '
                f'{needed_s:.0f} s of it; if she glides in it, say where with --window START END'
            )
            found.append(NotCoastdown(*self.run.span_ns, Dismissal.LEAD_IN, text))
        return tuple(sorted(found, key=lambda one: one.start_ns))


def replay(
    run: Run,
    *,
    ship: Ship | None = None,
    parameters: Parameters | None = None,
    window: tuple[float, float] | None = None,
    stop: StopTime | None = None,
    compare: bool = True,
    progress: PartDone | None = None,
) -> ReplayResult:
    """
    Estimate from a run as the node would have.

    Parameters
    ----------
    run
        From `open_runs`.
    ship, parameters
        Instead of those attached to the bag; recorded outputs are compared
        only if they are the same.
    window
        Begin and end [s from the start of the bag], instead of finding
        coastdowns; outputs are then not compared.
    stop
        When the engine was stopped, as a person tells it within some seconds: evidence that
        the regimes weigh with the rest; outputs are then not compared.
    compare
        Whether outputs in the bag are compared; the estimates while a coastdown runs are
        made for that alone.
    progress
        Called now and then with how many messages are done, and of how many.

    Raises
    ------
    BagError
        If the bag has no input, no ship file where none is given, the window or
        the stop lies outside of it, or both are given.
    ShipFileError, ParameterError
        If those attached to the bag cannot be used.
    """
    used_ship, used_parameters = settings_of(run, ship, parameters)
    if window is not None and stop is not None:
        raise BagError(f'{run.name!r}: a window and a stop are given; give one of them')
    if window is not None:
        return _in_window(run, used_ship, used_parameters, window)
    told = None if stop is None else told_ns(run, stop)
    own = compare and told is None and _is_own(run, used_ship, used_parameters)
    return _as_on_board(run, used_ship, used_parameters, own, progress, told)


def settings_of(
    run: Run, ship: Ship | None = None, parameters: Parameters | None = None
) -> tuple[Ship, Parameters]:
    """
    Return what a run is replayed with: what is given, else what is attached to it.

    Raises
    ------
    BagError
        If the run has no input, or no ship file where none is given.
    ShipFileError, ParameterError
        If those attached cannot be used.
    SimulationError
        Naming an effect of the ship file that is not known.
    """
    refuse_without_input(run)
    used = checked(ship_of(run, ship))
    return used, recorded_parameters(run) if parameters is None else parameters


def refuse_without_input(run: Run) -> None:
    """
    Raise a `BagError` that says what a run holds, if that is no input.
    """
    if not any(topic.input for topic in run.topics):
        raise BagError(_no_input(run))


def _no_input(run: Run) -> str:
    if not run.topics:
        why = '; '.join(run.warnings) or 'nothing was recorded'
        return f'{run.name!r} holds no message: {why}; give another bag'
    refused = [topic for topic in run.topics if topic.refused]
    if refused:
        found = ', '.join(f'{topic.topic} is {topic.type}' for topic in refused)
        accepted = '; '.join(
            f'{name}: {", ".join(types)}'
            for name, types in TOPICS.items()
            if any(topic.topic.rpartition('/')[2] == name for topic in refused)
        )
        return f'{run.name!r} holds no input in a type that is read: {found}; read are {accepted}'
    found = ', '.join(f'{topic.topic} ({topic.type})' for topic in run.topics)
    return (
        f'{run.name!r} holds none of the inputs {", ".join(TOPICS)}; it has {found}: '
        'name one with --remap FROM:=TO'
    )


def _as_on_board(
    run: Run,
    ship: Ship,
    parameters: Parameters,
    own: bool,
    progress: PartDone | None,
    told: int | None = None,
) -> ReplayResult:
    # what nothing is compared with is left out: an estimate depends on its window alone
    monitor = Monitor(ship, parameters, estimate=estimate if own else None)
    comparison = Comparison(run.outputs() if own else iter(()), by=_by(run))
    coastdowns: list[EndedCoastdown] = []
    kept: list[Event] = []
    heard: list[HeardSpan] = []

    def take(events: list[Event]) -> None:
        for event in events:
            if not isinstance(event, Update | NoEstimate):
                kept.append(event)
            if isinstance(event, EndedCoastdown) and not event.withdrawn:
                coastdowns.append(event)
            if own:
                for message in outputs(event, node=run.node or DEFAULT_NODE):
                    comparison.add(message)

    inputs = run.inputs()
    total = sum(topic.messages for topic in run.topics if topic.input)
    for item in with_stop(inputs, told):
        if isinstance(item, StopMark) and item.receive_ns == told:
            if monitor.engine_stopped(told):
                raise BagError(
                    f'{run.name!r}: no speed was read before the stop that is given; give a later '
                    'one, or a recording that begins before it'
                )
            continue
        if isinstance(item, Block) and len(item):
            heard.append(HeardSpan.of(item))
        take(feed(monitor, item))
        if progress is not None:
            progress(inputs.messages.total(), total)
    take(monitor.finish())
    return ReplayResult(
        run,
        ship,
        parameters,
        tuple(coastdowns),
        tuple(kept),
        _counts(run, inputs, monitor.counts()),
        comparison.finish(),
        monitor.steady_lead_s,
        monitor.contradictions(),
        monitor.left_out(),
        tuple(heard),
    )


def feed(monitor: Monitor, item: Block | Mark) -> list[Event]:
    """
    Give a monitor what the node's had: samples, or what it learnt by other means.
    """
    if isinstance(item, Block):
        return monitor.update(item)
    if isinstance(item, ResetMark):
        return monitor.reset(item.receive_ns, item.reason)
    if isinstance(item, StopMark):
        monitor.engine_stopped(item.receive_ns)
        return []
    return monitor.fall_silent()


def _in_window(
    run: Run, ship: Ship, parameters: Parameters, window: tuple[float, float]
) -> ReplayResult:
    samples = read_window(run, ship, parameters, window)
    coastdown = estimate_window(samples, ship, parameters)
    tally, inside = InputTally.fresh(), samples.inside
    np.add.at(tally.reasons, (samples.block.channel[inside], samples.reasons[inside]), 1)
    return ReplayResult(
        run,
        ship,
        parameters,
        (coastdown,),
        (coastdown, *coastdown.cuts),
        _counts(run, samples.inputs, tally.counts()),
        Recorded(by=_by(run)),
        heard=(HeardSpan.of(samples.block),) if len(samples.block) else (),
    )


def _counts(
    run: Run, inputs: RunSamples, judged: Mapping[str, InputCounts]
) -> dict[str, InputCounts]:
    """Join what the decoder, the matching of types and the validation have counted."""
    counts: dict[str, InputCounts] = {}
    for name in TOPICS:
        refused = run.refused[name]
        of_input = judged.get(name, InputCounts())
        reasons = dict(inputs.unreadable.get(name, {})) | dict(of_input.rejected)
        if refused:
            reasons[WRONG_TYPE] = refused
        messages = inputs.messages[name] + refused
        if messages:
            counts[name] = InputCounts(messages, of_input.used, reasons)
    return counts


def ship_of(run: Run, given: Ship | None) -> Ship:
    """
    Return the ship that is given, else the one attached to a bag.
    """
    ship = given or run.ship
    if ship is None:
        raise BagError(
            f'{run.name!r} has no {SHIP_FILE} attached or beside it; give one with --ship FILE'
        )
    return ship


def recorded_parameters(run: Run) -> Parameters:
    """
    Return the parameters attached to a bag; what this version does not have is noted.
    """
    text = run.attachments.get(PARAMETERS_FILE, '')
    parameters, dropped = Parameters.of_bag(text, subject=PARAMETERS_FILE)
    run.note(dropped)
    return parameters


def _by(run: Run) -> str | None:
    """Return the version whose node recorded the bag; None of a bag that no node recorded."""
    return run.software if run.node is not None else None


def _is_own(run: Run, ship: Ship, parameters: Parameters) -> bool:
    """Say whether these are what the bag was recorded with, as far as it says so."""
    if run.node is None:
        return False
    text = run.attachments.get(RECORDED + SHIP_FILE, run.attachments.get(SHIP_FILE))
    own_ship = text is None or Ship.from_yaml(text, subject=run.name).to_yaml() == ship.to_yaml()
    return own_ship and (
        PARAMETERS_FILE not in run.attachments or recorded_parameters(run) == parameters
    )


def told_ns(run: Run, stop: StopTime) -> int:
    """
    Return when a stop was told [ns, time of arrival].

    Raises
    ------
    BagError
        If it lies outside of the bag, is a date without a zone, or neither date nor number.
    """
    if not isinstance(stop, datetime | Real):
        raise BagError(f'stop is {stop!r}: expected seconds as a number, or a datetime')
    if isinstance(stop, datetime) and stop.tzinfo is None:  # would be of this computer
        raise BagError(f'stop at {stop.isoformat()}: expected a date with its zone')
    start_ns, end_ns = run.span_ns or (0, -1)
    said, at_s = (
        (f'{stop} s', stop)
        if not isinstance(stop, datetime)
        else (stop.isoformat(), stop.timestamp() - start_ns / SECOND_NS)
    )
    length_s = (end_ns - start_ns) / SECOND_NS
    if not 0.0 <= at_s <= length_s:
        raise BagError(
            f'stop at {said}: expected inside of {run.name!r}, which begins at {utc(start_ns)} '
            f'and is {max(length_s, 0.0):.3f} s long'
        )
    return start_ns + round(at_s * SECOND_NS)


def told_beside(run: Run, stop: StopTime, found: Sequence[EndedCoastdown]) -> str:
    """
    Say where coastdowns begin, beside a stop that was told, and what to do if it is of none.

    Parameters
    ----------
    run, stop
        As of `told_ns`.
    found
        The coastdowns.
    """
    told = told_ns(run, stop)
    # by the clock of the stamps, where a coastdown has been told of it
    at_ns = next((each.told_ns for each in found if each.told_ns is not None), told)
    starts = [(each.start_ns - at_ns, utc(each.start_ns)) for each in found]
    begins = ', '.join(f'{said} ({off_ns / SECOND_NS:+.0f} s)' for off_ns, said in starts)
    off_s = [(at_ns - (each.stop_ns or each.start_ns)) / SECOND_NS for each in found]
    said = (
        f'the stop that is given, {utc(told)}, is weighed by the regime filter; coastdowns begin '
        f'at: {begins or "there is none"}'
    )
    if any(chance_told(each) > 0.5 for each in off_s):
        return said
    return (
        f'{said}; none of them is of that stop: check its time and zone, or give the window in '
        'which she glided'
    )


def with_stop(items: Iterable[Block | Mark], at_ns: int | None) -> Iterator[Block | Mark]:
    """
    Put a stop between the samples of a run.

    Parameters
    ----------
    items
        In the order of arrival.
    at_ns
        Its time of arrival [ns].
    """
    for item in items:
        if (
            at_ns is None
            or not isinstance(item, Block)
            or not len(item)
            or item.receive_ns[-1] < at_ns
        ):
            yield item
            continue
        first = int(np.argmax(item.receive_ns >= at_ns))
        yield item[:first]
        yield StopMark(at_ns)
        yield item[first:]
        at_ns = None
    if at_ns is not None:  # after the last sample
        yield StopMark(at_ns)


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
