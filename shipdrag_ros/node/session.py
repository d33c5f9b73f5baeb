# SPDX-License-Identifier: Apache-2.0
"""
One activation of the node: from bytes received to bytes published and recorded.

Free of ROS, so that what a replay must reproduce can be tested without it.

Beside it what no message shows: silence, clocks that are set, messages that were lost. It is
looked at every tick; what comes of it goes through the session, so that it is published,
recorded, and obeyed by a replay.

A clock that is set amid a coastdown puts readings where the ship never was. Its
own clock the node knows by one that nobody sets; that of a sensor by the lag of
its stamps, whose smallest over some seconds changes only if a clock does:
a network that stalls makes lags longer for a while, and none shorter.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import (
    EndedCoastdown,
    Event,
    InputCounts,
    NoEstimate,
    OnCoastdown,
    State,
    Update,
)
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.messages import (
    Decoded,
    EncodedMessage,
    EventKind,
    EventNote,
    OutputMessage,
    Source,
    decode,
    event_message,
    types,
)
from shipdrag_ros.messages.publishing import outputs
from shipdrag_ros.node.health import convention_doubt
from shipdrag_ros.node.recorder import Recorder
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import ALL_MOTION, BACKWARD_JUMP_NS, MOTION_INPUTS

if TYPE_CHECKING:  # ROS is behind it
    from shipdrag_ros.node.inputs import InputTopic

Count = Callable[[Decoded], None]

WAITING_MOST = 200_000  # messages that wait for compiled code
WAITING_BYTES = 128 * 1024 * 1024  # of them
FINISH_S = 0.5  # for what waits at the end
AT_ONCE = 2000  # of what waited, between two turns of everything else


class Session:
    """
    A monitor between what is received and what is published.

    Parameters
    ----------
    recorder
        Called with every message in and out.
    publish
        Called with every message out.
    node
        Full name of the node.
    ended
        Called after each coastdown with all of its samples; not after one that
        was withdrawn, or that a reset ended, which has dropped them.
    on_event
        Called with every event of the monitor.
    ready
        Says whether compiled code is there. What comes before that is recorded as it comes, and
        waits in its order for the monitor.

    Attributes
    ----------
    latest
        The last estimate, None before the first and after a reset.
    why_none
        Why the coastdown that runs has no estimate, '' where it has one.
    """

    def __init__(
        self,
        monitor: Monitor,
        recorder: Recorder,
        *,
        publish: Callable[[OutputMessage], None],
        node: str,
        ended: OnCoastdown = lambda coastdown, window: None,
        on_event: Callable[[Event], None] = lambda event: None,
        ready: Callable[[], bool] = lambda: True,
    ) -> None:
        self.monitor = monitor
        self.recorder = recorder
        self._waiting_bytes = 0
        self.latest: Estimate | None = None
        self._publish = publish
        self._node = node
        self._ended = ended
        self._on_event = on_event
        self.why_none = ''
        self._ready = ready
        self._waiting: deque[tuple[int, int, Callable[[], object]]] = deque()
        self._arrival_ns = 0
        self._cause_ns = 0  # arrival of what the messages out come of, if not the last

    @property
    def waiting(self) -> int:
        """What was heard and recorded, and waits for the monitor."""
        return len(self._waiting)

    @property
    def full(self) -> bool:
        """Whether so much waits that no more is to be given."""
        return len(self._waiting) > WAITING_MOST or self._waiting_bytes > WAITING_BYTES

    def receive(
        self, source: Source, payload: bytes, now_ns: int, count: Count = lambda decoded: None
    ) -> None:
        """
        Take one message.

        Parameters
        ----------
        now_ns
            Clock of the node [ns].
        count
            Called with what became of it.
        """
        arrival_ns = self.watch_clock(now_ns)
        stamp_ns = types.stated_stamp_ns(source.type, payload, arrival_ns)
        # also what will be rejected: the bag holds what came, not what was liked
        self._record(source, payload, arrival_ns, stamp_ns)

        def use() -> None:
            decoded = decode(source, [payload], [arrival_ns])
            self._report(self.monitor.update(decoded.block))
            count(decoded)

        self._in_turn(use, len(payload))

    def go_on(self) -> None:
        """
        Use what waits, some of it, once compiled code is there.
        """
        try:
            for _ in range(min(len(self._waiting), AT_ONCE)):
                if not self._ready():
                    return
                self._cause_ns, size, use = self._waiting.popleft()
                self._waiting_bytes -= size
                use()
        finally:
            self._cause_ns = 0

    def _in_turn(self, use: Callable[[], object], size: int = 0) -> None:
        """Do it behind what waits."""
        self._waiting.append((self._arrival_ns, size, use))
        self._waiting_bytes += size
        self.go_on()

    def keep(self, source: Source, payload: bytes, now_ns: int) -> None:
        """
        Record one message that feeds no input by itself.
        """
        arrival_ns = self.watch_clock(now_ns)
        self._record(source, payload, arrival_ns, arrival_ns)

    def _record(self, source: Source, payload: bytes, arrival_ns: int, stamp_ns: int) -> None:
        message = EncodedMessage(source.input, source.type, payload, arrival_ns, stamp_ns)
        self.recorder.input(message)

    def watch_clock(self, now_ns: int) -> int:
        """
        Return the time of arrival [ns], which never falls within a recording.

        A small step back is held; a large one is a clock that was set.
        """
        if now_ns < self._arrival_ns - BACKWARD_JUMP_NS:
            reason = f'the clock went back by {(self._arrival_ns - now_ns) * 1e-9:.3f} s'
            self._reset(reason)
            self.recorder.new_part()
            self._arrival_ns = now_ns
            self._note(EventKind.CLOCK_JUMP, reason)
        self._arrival_ns = max(self._arrival_ns, now_ns)
        return self._arrival_ns

    def fall_silent(self, reason: str, now_ns: int) -> None:
        """
        End a coastdown that runs, as no source of the motion has been heard for too long.
        """
        arrival_ns = self.watch_clock(now_ns)
        if self.monitor.state not in (State.CANDIDATE, State.COASTDOWN):
            return
        self._obey_in_replay(self._event(EventKind.SILENCE, reason), arrival_ns)
        self._in_turn(lambda: self._report(self.monitor.fall_silent()))

    def engine_stopped(self, now_ns: int) -> tuple[bool, str]:
        """
        Take it from a person that the engine was stopped just now, within some seconds.

        Returns
        -------
        done, text
            Whether it is weighed, and what comes of it.
        """
        arrival_ns = self.watch_clock(now_ns)
        stopped = self._event(EventKind.ENGINE_STOPPED, 'the engine was stopped')
        self._obey_in_replay(stopped, arrival_ns)
        if self._waiting or not self._ready():
            self._in_turn(partial(self.monitor.engine_stopped, arrival_ns))
            return True, 'taken; it is weighed once compiled code is there'
        why = self.monitor.engine_stopped(arrival_ns)
        weighed = 'the stop is weighed with the readings, as of now within some seconds'
        return (False, f'of no use: {why}') if why else (True, weighed)

    def reset(self, reason: str, now_ns: int) -> None:
        """
        Drop all memory.
        """
        self.watch_clock(now_ns)
        self._reset(reason)

    def clock_was_set(self, reason: str, now_ns: int, *, ends: bool = True) -> None:
        """
        Publish and record that a clock was set; end a coastdown that runs.

        Parameters
        ----------
        ends
            Whether readings that matter to a coastdown are timed by that clock.
        """
        self.watch_clock(now_ns)
        if ends and self.monitor.state in (State.CANDIDATE, State.COASTDOWN):
            self._reset(reason)
        self._note(EventKind.CLOCK_JUMP, reason)

    def note(self, kind: EventKind, text: str, now_ns: int) -> None:
        """
        Publish and record what happened to the node itself or to what it receives.
        """
        self.watch_clock(now_ns)
        self._note(kind, text)

    def note_diagnosis(self, message: OutputMessage, now_ns: int) -> None:
        """
        Publish and record what a coastdown says is missing in the model.
        """
        self.watch_clock(now_ns)
        self._send(message)

    def finish(self) -> None:
        """
        Give the last figures and close the recording; needs no ROS.

        What still waits after that stays in the recording, for a replay: who asked for the end
        is not to wait for it.
        """
        until_s = time.monotonic() + FINISH_S
        try:
            while self._waiting and self._ready() and time.monotonic() < until_s:
                self.go_on()
            if not self._waiting:
                self._report(self.monitor.finish())
        finally:  # whatever is wrong, the bag is closed
            self.recorder.close()

    def _reset(self, reason: str) -> None:
        # first the request, at whose place a replay resets too
        arrival_ns = self._arrival_ns
        self._send(self._event(EventKind.RESET_REQUEST, reason))
        self.recorder.forget()

        def use() -> None:
            self._report(self.monitor.reset(arrival_ns, reason))
            self.latest = None

        self._in_turn(use)

    def _obey_in_replay(self, mark: OutputMessage, arrival_ns: int) -> None:
        """Publish and record what a replay obeys at its place, as it does an input."""
        self._publish(mark)
        if arrival_ns:
            self.recorder.request(mark, arrival_ns)

    def _note(self, kind: EventKind, text: str) -> None:
        self._send(self._event(kind, text))

    def _event(self, kind: EventKind, text: str) -> OutputMessage:
        """Encode what happens at the arrival of the last message."""
        return event_message(EventNote(kind, self._arrival_ns, text), node=self._node)

    def _report(self, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, Update | EndedCoastdown) and event.estimate is not None:
                self.latest = event.estimate
            self.why_none = event.reason if isinstance(event, NoEstimate) else ''
            self._on_event(event)
            for message in outputs(event, node=self._node):
                self._send(message)
            if isinstance(event, EndedCoastdown) and event.stands:
                self._ended(event, self.monitor.ended_window(event))

    def _send(self, message: OutputMessage) -> None:
        self._publish(message)
        cause_ns = self._cause_ns or self._arrival_ns
        if cause_ns:  # 0: sim time before the first /clock
            self.recorder.output(message, cause_ns)


AWAY_S = 5.0  # between two ticks: the node stood still, and what waits is not silence
_SIDE = ('sooner', 'later')
_SAID_S = 60.0  # a clock that was set is shown this long
STEP_S = 1.0  # a step this large is worth an end; slewing is slower
LOOKS = 20  # ticks on each side of a step back, at which lags are longer for good
_MOMENT_NS = 100_000_000
_LATEST = 2  # ticks that show a step forward


def both_ns() -> tuple[int, int] | None:
    """
    Return the clock of this computer and one that nobody sets at one moment [ns].

    The other goes on while the computer sleeps. None where the process was held up between them.
    """
    boot_ns = partial(time.clock_gettime_ns, time.CLOCK_BOOTTIME)
    before_ns, now_ns = boot_ns(), time.time_ns()
    after_ns = boot_ns()
    return (now_ns, after_ns) if after_ns - before_ns < _MOMENT_NS else None


class OwnClock:
    """The clock that arrivals are timed by, held against one that nobody sets."""

    def __init__(self) -> None:
        self._before: tuple[int, int] | None = None

    def step_s(self, now_ns: int, steady_ns: int) -> float:
        """
        Return by how much the clock was set since the last call [s], 0 if it was not.
        """
        before, self._before = self._before, (now_ns, steady_ns)
        if before is None:
            return 0.0
        step_s = ((now_ns - before[0]) - (steady_ns - before[1])) * 1e-9
        return step_s if abs(step_s) >= STEP_S else 0.0


class SensorClock:
    """The clock of one input, by the lags of its stamps."""

    def __init__(self) -> None:
        self._least_s: deque[float] = deque(maxlen=2 * LOOKS)

    def step_s(self, least_lag_s: float | None) -> float:
        """
        Return by how much the clock was set [s], 0 if it was not.

        Parameters
        ----------
        least_lag_s
            Smallest arrival minus stamp of the last second; None without a reading.
        """
        if least_lag_s is None:
            return 0.0
        self._least_s.append(least_lag_s)
        lags, step_s = list(self._least_s), 0.0
        if len(lags) > 2 * _LATEST:
            step_s = max(min(lags[:-_LATEST]) - max(lags[-_LATEST:]), 0.0)
        if step_s < STEP_S and len(lags) == 2 * LOOKS:
            step_s = min(min(lags[:LOOKS]) - min(lags[LOOKS:]), 0.0)
        if abs(step_s) < STEP_S:
            return 0.0
        self._least_s.clear()
        return step_s


def set_by(step_s: float) -> str:
    """
    Return that a clock was set, in words.
    """
    side = 'forward' if step_s > 0.0 else 'back'
    return f'went {side} by {abs(step_s):.1f} s'


class Watching:
    """
    One activation's watch over its inputs.

    Parameters
    ----------
    topics
        All inputs.
    parameters
        `data_stop_s`, `frozen_s` and `heading_convention` are used.
    simulated
        Whether the clock is simulated, and may stand or run as it likes.
    """

    def __init__(
        self, topics: Sequence[InputTopic], parameters: Parameters, *, simulated: bool
    ) -> None:
        self._topics = topics
        self._parameters = parameters
        self._simulated = simulated
        self._own = OwnClock()
        self._clocks = {topic.name: SensorClock() for topic in topics}
        self._lost = {topic.name: topic.lost for topic in topics}
        self._used = 0
        self._heard = (0.0, 0)  # steady time [s] and time of the node [ns]
        self._accepted = (0.0, 0)
        self._tick_s = -math.inf
        self._stepped: dict[str, tuple[float, str]] = {}

    def tick(self, session: Session, judged: Mapping[str, InputCounts], now_ns: int) -> None:
        """
        Look, and inform the session.

        Parameters
        ----------
        now_ns
            Clock of the node [ns], 0 while there is none.
        """
        if not now_ns:
            return
        self.watch_clock(session, now_ns)
        session.watch_clock(now_ns)  # also while nothing arrives
        self._watch_sensors(session, now_ns)
        self._watch_silence(session, judged, now_ns)
        for topic in self._topics:
            if topic.lost > self._lost[topic.name]:
                more, self._lost[topic.name] = topic.lost - self._lost[topic.name], topic.lost
                text = f'{more} messages were sent and not heard, {topic.lost} so far'
                session.note(EventKind.MESSAGE_LOST, f'{topic.name}: {text}', now_ns)

    def watch_clock(self, session: Session, now_ns: int) -> None:
        """
        Look whether the clock of this computer was set; before a message is taken, too.
        """
        moment = None if self._simulated else both_ns()
        if moment is None or not (step_s := self._own.step_s(*moment)):
            return
        self._clocks = {topic.name: SensorClock() for topic in self._topics}
        if step_s * 1e9 > -BACKWARD_JUMP_NS:  # further back, the arrivals show it
            session.clock_was_set(f'the clock of this computer {set_by(step_s)}', now_ns)

    def doubts(self) -> dict[str, str]:
        """
        Say of which inputs the clock was set lately, and whether a heading is turned twice.
        """
        now_s = time.monotonic()
        found = {
            name: text for name, (at_s, text) in self._stepped.items() if now_s < at_s + _SAID_S
        }
        for topic in self._topics:
            if topic.name == 'heading' and (topic.type or topic.fed_by):
                stamped = topic.type is None or types.is_stamped(topic.type)
                convention = self._parameters.heading_convention
                text = convention_doubt(convention, stamped=stamped, fed=bool(topic.fed_by))
                if text:
                    found[topic.name] = text
        return found

    def _watch_sensors(self, session: Session, now_ns: int) -> None:
        for topic in self._topics:
            step_s = self._clocks[topic.name].step_s(topic.least_lag_s())
            if not step_s or self._simulated:
                continue
            text = (
                f'its clock {set_by(step_s)}, or its readings come as much {_SIDE[step_s < 0.0]}'
            )
            self._stepped[topic.name] = (time.monotonic(), text)
            session.clock_was_set(f'{topic.name}: {text}', now_ns, ends=topic.name in ALL_MOTION)

    def _watch_silence(
        self, session: Session, judged: Mapping[str, InputCounts], now_ns: int
    ) -> None:
        steady_s = time.monotonic()
        now = (steady_s, now_ns)
        ages = [topic.age_s for topic in self._topics if topic.name in ALL_MOTION]
        used = sum(judged[name].used for name in ALL_MOTION if name in judged)
        last_s, self._tick_s = steady_s - self._tick_s, steady_s
        away = last_s > AWAY_S
        if away or any(age is not None and age <= last_s for age in ages):
            self._heard = now
        if away or used != self._used:
            self._accepted, self._used = now, used
        if session.monitor.state not in (State.CANDIDATE, State.COASTDOWN):
            return
        stop_s = self._parameters.data_stop_s
        stuck_s = max(stop_s, self._parameters.frozen_s)
        for since, limit_s, what in (
            (self._heard, stop_s, 'nothing was heard'),
            (self._accepted, stuck_s, 'no reading could be used'),
        ):
            # under simulated time both: one that stands still makes no silence
            silent_s = steady_s - since[0]
            if self._simulated:
                silent_s = min(silent_s, (now_ns - since[1]) * 1e-9)
            if silent_s > limit_s:
                names = ', '.join(MOTION_INPUTS)
                session.fall_silent(f'{what} of {names} for {silent_s:.0f} s', now_ns)
                return
