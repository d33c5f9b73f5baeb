# SPDX-License-Identifier: Apache-2.0
"""
A run through the same monitor, estimator and encoder as on board.

Also one window of it, given by hand, through the same estimator.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from numbers import Real
from typing import NamedTuple

import numpy as np

from shipdrag_ros.bags.run import RECORDED, Mark, ResetMark, Run, RunSamples, StopMark
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedCoastdown,
    Event,
    InputCounts,
    NoEstimate,
    NotCoastdown,
    Update,
    WholeGlide,
)
from shipdrag_ros.coastdown.memory import InputTally
from shipdrag_ros.display import utc
from shipdrag_ros.errors import BagError
from shipdrag_ros.estimation import estimate
from shipdrag_ros.estimation.run_down import chance_told
from shipdrag_ros.messages import DEFAULT_NODE, TOPICS
from shipdrag_ros.messages.publishing import outputs
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.progress import PartDone
from shipdrag_ros.replay.comparison import Comparison, Recorded
from shipdrag_ros.replay.given_window import estimate_window, read_window
from shipdrag_ros.samples import SECOND_NS, Block
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import checked

SHIP_FILE = 'ship.yaml'
PARAMETERS_FILE = 'parameters.yaml'
WRONG_TYPE = 'type'
StopTime = float | datetime
"""In s from the start of the bag, or as a time of day with its zone."""


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
    ship = given or attached_ship(run)
    if ship is None:
        raise BagError(
            f'{run.name!r} has no {SHIP_FILE} attached or beside it; give one with --ship FILE'
        )
    return ship


def attached_ship(run: Run) -> Ship | None:
    """
    Return the ship whose file is attached to a bag, or else lies beside it, which is noted.
    """
    text = run.attachments.get(SHIP_FILE)
    if text is not None:
        return Ship.from_yaml(text, subject=f'{run.name}: {SHIP_FILE}')
    near = (each / SHIP_FILE for each in run.folders)
    path = next((each for each in near if each.is_file()), None)
    if path is None:
        return None
    run.note([f'{path} holds for this run'])
    return Ship.load(path)


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
