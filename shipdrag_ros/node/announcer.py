# SPDX-License-Identifier: Apache-2.0
"""
What the log and the console show: each event of the monitor, each change of the health, once.

/diagnostics is sent every second and kept by nobody; the log is what is read
the day after.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

from shipdrag_ros.coastdown import events
from shipdrag_ros.display import duration, utc
from shipdrag_ros.estimation.words import specific
from shipdrag_ros.messages.topics import ERROR, OK, WARN, Status
from shipdrag_ros.node.background import Compiling
from shipdrag_ros.node.health import InputFacts
from shipdrag_ros.samples import ALL_MOTION, MOTION_INPUTS

SILENCE_SAID_AFTER_S = 10.0
COMPILING_SAID_AFTER_S = 3.0  # to load what was kept is faster
_LATE_S = 900.0  # a coastdown that is found so late is over
AGAIN_S = 10.0  # a finding that comes and goes is said this often at most
_NS = 1e-9
_LOOK = (
    '; if the engine was stopped there, `shipdrag diagnose BAG` of the recording holds all of it '
    'against the model'
)
_ENDED_BY = {**events.ENDED_BY, events.EndedBy.RECORD_END: 'the node stops'}


class LogLine(NamedTuple):
    """A line of the log, and whether somebody should look at it."""

    text: str
    warning: bool = False


def line_of(event: events.Event) -> LogLine | None:
    """
    Return the line of an event; None where it is one of many.
    """
    match event:
        case events.Onset(start_ns, detected_ns):
            seen_s = (detected_ns - start_ns) * _NS
            hold = ': hold rudder and engine' if seen_s < _LATE_S else ''
            text = f'a coastdown began at {utc(start_ns)}, confirmed {seen_s:.0f} s later'
            return LogLine(f'{text}{hold}')
        case events.EndedCoastdown():
            return _ended(event)
        case events.NotCoastdown():
            hint = _LOOK if event.reason in events.BY_SPEED else ''
            return LogLine(f'nearly a coastdown: {event.text}{hint}')
        case events.Reset(_, reason):
            return LogLine(f'all memory is dropped: {reason}', warning=True)
        case events.NoEstimate() | _:
            return None


def _ended(event: events.EndedCoastdown) -> LogLine:
    seconds = (event.end_ns - event.start_ns) * _NS
    why = f'{event.ended_by.value}: {_ENDED_BY[event.ended_by]}'
    if event.withdrawn:
        return LogLine(f'a coastdown is refused after {duration(seconds)}: {event.failure}', True)
    text = f'a coastdown has ended after {duration(seconds)} ({why})'
    if event.estimate is None:
        return LogLine(f'{text}; no estimate: {event.failure}', True)
    if not len(event.estimate.valid_curve):
        return LogLine(f'{text}; no speed at which the resistance may be used')
    return LogLine(f'{text}. {specific(event.estimate)}')


class Announcer:
    """
    Writes changes into the log of a node.

    Parameters
    ----------
    logger
        Of rclpy.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._levels: dict[str, int] = {}
        self._inputs: dict[str, tuple[int, float]] = {}
        self._silent_since_s: float | None = None
        self._silence_said = False
        self._compiling_said = False
        self._compiled: Compiling | None = None
        self._cuts: tuple[events.NotCoastdown, ...] = ()  # of the last coastdown
        self._withdrawn = False

    def compiling(self, work: Compiling | None, waiting: int) -> None:
        """
        Say that it takes a while until the first estimate can be made, and its end.

        Parameters
        ----------
        waiting
            Messages that wait for it.
        """
        if work is None or work is self._compiled:
            return
        if work.done():
            self._compiled = work
            if work.failure:
                self._logger.error(f'compiling failed:\n{work.failure}')
            after = f'ready to estimate, {work.seconds:.0f} s after the start'
            self._logger.info(f'{after}; {waiting} messages waited')
        elif work.seconds > COMPILING_SAID_AFTER_S and not self._compiling_said:
            self._compiling_said = True
            self._logger.info(
                'compiling, as on the first start of each version: one to three minutes without '
                'an estimate. What is heard is recorded, waits and is then used; `make warm` '
                'compiles beforehand'
            )

    def event(self, event: events.Event) -> None:
        """
        Say what the monitor reports.
        """
        line = line_of(event)
        if isinstance(event, events.EndedCoastdown):  # why it was withdrawn is said
            self._cuts, self._withdrawn = event.cuts, event.withdrawn
        elif isinstance(event, events.NotCoastdown) and event in self._cuts:
            line = None if self._withdrawn else LogLine(f'cut from the coastdown: {event.text}')
        if line is not None:
            self._say(line.text, warning=line.warning)

    def status(self, status: Status) -> None:
        """
        Say that a part of the node is worse or better than before.
        """
        before = self._levels.get(status.part, OK)
        self._levels[status.part] = status.level
        if status.level == before:
            return
        if status.level == ERROR:
            self._logger.error(status.message)
        else:
            self._say(status.message, warning=status.level == WARN)

    def inputs(self, states: Sequence[InputFacts]) -> None:
        """
        Report an input that was heard and is worse or better than before.
        """
        now_s = time.monotonic()
        for state in states:
            name, finding = state.name, state.finding
            before, said_s = self._inputs.get(name, (OK, -AGAIN_S))
            if state.age_s is None or finding.level == before or now_s < said_s + AGAIN_S:
                continue
            self._inputs[name] = (finding.level, now_s)
            self._say(f'{name}: {finding.text}', warning=finding.level != OK)

    def silence(self, states: Sequence[InputFacts], candidates: str) -> None:
        """
        Say, once, that no input of the motion is heard, and that one is again.

        Parameters
        ----------
        candidates
            Topics that may be meant.
        """
        now_s = time.monotonic()
        if any(state.fresh for state in states if state.name in ALL_MOTION):
            if self._silence_said:
                self._logger.info('an input of the motion is heard')
            self._silent_since_s, self._silence_said = None, False
            return
        if self._silent_since_s is None:
            self._silent_since_s = now_s
        if self._silence_said or now_s < self._silent_since_s + SILENCE_SAID_AFTER_S:
            return
        self._silence_said = True
        names = ', '.join(MOTION_INPUTS)
        hint = candidates or (
            'no topic has a type that fits; is the driver running, in this ROS domain and '
            'discovery range?'
        )
        self._logger.warning(f'no input heard on any of {names}: {hint}')

    def _say(self, text: str, *, warning: bool) -> None:
        # rclpy raises where one line of source logs with two severities
        if warning:
            self._logger.warning(text)
        else:
            self._logger.info(text)
