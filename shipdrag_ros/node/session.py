# SPDX-License-Identifier: Apache-2.0
"""
One activation of the node: from bytes received to bytes published and recorded.

Free of ROS, so that what a replay must reproduce can be tested without it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from time import monotonic

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import (
    EndedCoastdown,
    Event,
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
from shipdrag_ros.node.recorder import Recorder
from shipdrag_ros.samples import BACKWARD_JUMP_NS

Publish = Callable[[OutputMessage], None]
OnEvent = Callable[[Event], None]
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
        publish: Publish,
        node: str,
        ended: OnCoastdown = lambda coastdown, window: None,
        on_event: OnEvent = lambda event: None,
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
        # also what will be rejected: the bag holds what came, not what was liked
        keep = partial(EncodedMessage, source.input, source.type, payload, arrival_ns)
        waits = bool(self._waiting) or not self._ready()
        if waits:  # nothing compiled may be called
            self.recorder.input(keep(types.stated_stamp_ns(source.type, payload, arrival_ns)))

        def use() -> None:
            decoded = decode(source, [payload], [arrival_ns])
            if not waits:
                stamps = decoded.block.stamp_ns
                self.recorder.input(keep(int(stamps[0]) if len(stamps) else arrival_ns))
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
        self.recorder.input(
            EncodedMessage(source.input, source.type, payload, arrival_ns, arrival_ns)
        )

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
        until_s = monotonic() + FINISH_S
        try:
            while self._waiting and self._ready() and monotonic() < until_s:
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
