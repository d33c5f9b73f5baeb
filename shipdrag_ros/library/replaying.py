# SPDX-License-Identifier: Apache-2.0
"""Runs, or windows of them, replayed: which may go together, and who is told on the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Protocol

import numpy as np

from shipdrag_ros.bags import Run, WindowedRun, WindowSpan
from shipdrag_ros.errors import BagError, EstimationError
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.progress import PartDone
from shipdrag_ros.replay import accepted_samples, replay
from shipdrag_ros.replay.playback import (
    StopTime,
    refuse_without_input,
    ship_of,
    told_beside,
)
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Fact, RunSheet, Ship

_LATE_S = 10.0
_MOVING_M_S = 0.5


class Listener(Protocol):
    """Receives lines, and how far the work is."""

    def log(self, *texts: str) -> None:
        """
        Take lines that are not part of the result.
        """

    def progress(self, text: str) -> AbstractContextManager[PartDone]:
        """
        Receive how far the work is that `text` names.
        """


class Notes:
    """
    A listener that shows nothing and keeps the lines.

    Attributes
    ----------
    lines
        In the order they came.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []

    def log(self, *texts: str) -> None:
        """
        Keep lines.
        """
        self.lines += texts

    def progress(self, text: str) -> AbstractContextManager[PartDone]:
        """
        Show nothing.
        """
        return nullcontext(lambda done, total: None)


def refuse_mixed(runs: Sequence[WindowedRun], given: Ship | None) -> None:
    """
    Refuse runs that cannot go together: of two ships, or of windows that overlap.

    Parameters
    ----------
    runs
        What two windows of one bag share would count twice.
    given
        The ship of all; None: the one attached to each.

    Raises
    ------
    BagError
        If two runs hold the same part of a recording, or no ship is given and they are of two.
    """
    for number, one in enumerate(runs):
        for other in runs[:number]:
            if set(one.run.paths).isdisjoint(other.run.paths):
                continue
            first, second = (each.window or (0.0, math.inf) for each in (other, one))
            if first[0] < second[1] and second[0] < first[1]:
                raise BagError(
                    f'{one.run.name!r} is given twice, {_text(first)} and {_text(second)}: they '
                    'share a part, which is one run and not two; give windows that do not overlap'
                )
    if given is None:
        refuse_two_ships((run, None) for run, _ in runs)


def refuse_two_ships(runs: Iterable[tuple[Run, Ship | None]]) -> None:
    """
    Refuse runs that name different ships; one without a name may be any.

    Parameters
    ----------
    runs
        Each with the ship that was given for it; None: the one attached.

    Raises
    ------
    BagError
        If two names are found.
    """
    named: dict[str, str] = {}
    for run, given in runs:
        ship = given or run.ship
        if ship is not None and ship.name:
            named.setdefault(ship.name, run.name)
    if len(named) > 1:
        (one, first), (other, second), *_ = named.items()
        raise BagError(
            f'{first!r} is of {one!r} and {second!r} of {other!r}; take the runs of each ship by '
            'themselves, or say which ship it is with --ship FILE'
        )


def _text(window: WindowSpan) -> str:
    return 'whole' if math.isinf(window[1]) else f'{window[0]:g} to {window[1]:g} s'


def ship_in(
    run: Run,
    given: Ship | None,
    facts: Sequence[Fact] = (),
    say: Callable[[str], None] | None = None,
) -> tuple[Ship, RunSheet]:
    """
    Return the ship as she was in a run, with what is known of it, and the sheet of the run.

    Parameters
    ----------
    run
    given
        The ship; None: the one attached.
    facts
        Of all runs, which override those of the ship and of the run.
    say
        Called where a `run.yaml` holds for the run; None: it is noted with the run.

    Raises
    ------
    BagError
        If the run has no input, or no ship file where none is given.
    ShipFileError
        If `run.yaml` cannot be used, or what it says does not fit the ship.
    """
    from shipdrag_ros.sources.beside import sheet_of  # of a room that no bag needs

    refuse_without_input(run)
    ship = ship_of(run, given)
    sheet, where = sheet_of(run, say or (lambda text: run.note([text])))
    return sheet.of(ship, subject=where, facts=facts), sheet


def replay_run(
    each: Run,
    listener: Listener,
    *,
    ship: Ship | None = None,
    parameters: Parameters | None = None,
    window: WindowSpan | None = None,
    stop: StopTime | None = None,
) -> RunResult:
    """
    Replay one run; its progress is shown.

    Raises
    ------
    EstimationError
        If a window was given and nothing can be estimated from it.
    """
    with listener.progress(f'replaying {each.name}') as progress:
        result = RunResult.of(
            replay(
                each,
                ship=ship_in(each, ship)[0],
                parameters=parameters,
                window=window,
                stop=stop,
                progress=progress,
            )
        )
    warnings = list(result.warnings)
    if stop is not None:
        warnings.append(told_beside(each, stop, result.coastdowns))
        listener.log(f'{each.name}: {warnings[-1]}')
    if not result.coastdowns:
        warnings.append(_astern(each, result.ship))
    if window is not None:
        for coastdown in result.coastdowns:
            if coastdown.estimate is None:
                raise EstimationError(
                    f'{each.name!r}: no estimate from {window[0]:g} to {window[1]:g} s: '
                    f'{coastdown.failure}'
                )
        warnings.append(_beyond(each, window[1]))
    return replace(result, warnings=tuple(filter(None, warnings)))


def _astern(run: Run, ship: Ship) -> str:
    """Say that a log reads astern most of the time, which a wrong sign makes too."""
    block, _ = accepted_samples(run, ship)
    speeds = block.value[block.channel == Channel.SPEED_THROUGH_WATER, 0]
    moving = speeds[np.abs(speeds) > _MOVING_M_S]
    share = float(np.mean(moving < 0.0)) if len(moving) else 0.0
    if share <= 0.5:
        return ''
    return (
        f'speed_through_water is negative in {share:.0%} of the samples under way (median '
        f'{np.median(moving):.2f} m/s), as if the ship went astern; if she sailed ahead, the sign '
        'of the log is wrong: give the speed forward as positive'
    )


def _beyond(run: Run, end_s: float) -> str:
    """Say that a window reaches beyond the bag, by more than a sample may come late."""
    assert run.span_ns is not None  # an estimate was made
    length_s = (run.span_ns[1] - run.span_ns[0]) * 1e-9
    if end_s <= length_s + _LATE_S:
        return ''
    return (
        f'the window ends at {end_s:g} s; the bag ends at {length_s:.1f} s, and the window there'
    )
