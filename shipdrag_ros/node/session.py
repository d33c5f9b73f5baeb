# SPDX-License-Identifier: Apache-2.0
"""
One activation of the node: from bytes received to bytes published and recorded.

Free of ROS, so that what a replay must reproduce can be tested without it.
"""

from __future__ import annotations

from collections.abc import Callable

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import (
    Coastdown,
    EndedBy,
    Event,
    NoEstimate,
    State,
    Update,
)
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.messages import (
    Decoded,
    EventKind,
    EventNote,
    OutputMessage,
    Source,
    decode,
    event_message,
    outputs,
    reset_request,
    silence_mark,
)
from shipdrag_ros.node.recorder import Recorder
from shipdrag_ros.node.ring import RawMessage
from shipdrag_ros.samples import BACKWARD_JUMP_NS

Publish = Callable[[OutputMessage], None]
Ended = Callable[[Coastdown, Window], None]
Told = Callable[[Event], None]


class Session:
    """
    A monitor between what is received and what is published.

    Parameters
    ----------
    recorder
        Told of every message in and out.
    publish
        Called with every message out.
    node
        Full name of the node.
    ended
        Called after each coastdown with all of its samples; not after one that
        was withdrawn, or that a reset ended, which has dropped them.
    told
        Called with every event of the monitor.

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
        ended: Ended | None = None,
        told: Told | None = None,
    ) -> None:
        self.monitor = monitor
        self.recorder = recorder
        self.latest: Estimate | None = None
        self._publish = publish
        self._node = node
        self._ended = ended
        self._told = told
        self.why_none = ''
        self._arrival_ns = 0

    def receive(self, source: Source, payload: bytes, now_ns: int) -> Decoded:
        """
        Take one message; `now_ns` is the clock of the node [ns].
        """
        arrival_ns = self.watch_clock(now_ns)
        decoded = decode(source, [payload], [arrival_ns])
        stamps = decoded.block.stamp_ns
        stamp_ns = int(stamps[0]) if len(stamps) else arrival_ns
        # also what will be rejected: the bag holds what came, not what was liked
        self.recorder.input(RawMessage(source.input, source.type, payload, arrival_ns, stamp_ns))
        self._report(self.monitor.update(decoded.block))
        return decoded

    def keep(self, source: Source, payload: bytes, now_ns: int) -> None:
        """
        Record one message that feeds no input by itself.
        """
        arrival_ns = self.watch_clock(now_ns)
        self.recorder.input(RawMessage(source.input, source.type, payload, arrival_ns, arrival_ns))

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
        mark = silence_mark(arrival_ns, reason, node=self._node)
        self._publish(mark)
        if arrival_ns:
            self.recorder.request(mark, arrival_ns)
        self._report(self.monitor.fall_silent())

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
            Whether readings that matter to a coastdown are told by that clock.
        """
        self.watch_clock(now_ns)
        if ends and self.monitor.state in (State.CANDIDATE, State.COASTDOWN):
            self._reset(reason)
        self._note(EventKind.CLOCK_JUMP, reason)

    def note_lifecycle(self, text: str, now_ns: int) -> None:
        """
        Publish and record a change of the node's own state.
        """
        self.watch_clock(now_ns)
        self._note(EventKind.LIFECYCLE, text)

    def note_removed(self, now_ns: int, warn: Callable[[str], object]) -> None:
        """
        Publish, record and log which recordings were removed since the last time.
        """
        self.watch_clock(now_ns)
        for part in self.recorder.removed():
            warn(part.text)
            self._note(EventKind.FILES, part.text)

    def note_lost(self, text: str, now_ns: int) -> None:
        """
        Publish and record that messages were lost on their way here.
        """
        self.watch_clock(now_ns)
        self._note(EventKind.MESSAGE_LOST, text)

    def finish(self) -> None:
        """
        Give the last figures and close the recording; needs no ROS.
        """
        try:
            self._report(self.monitor.finish())
        finally:  # whatever is wrong, the bag is closed
            self.recorder.close()

    def _reset(self, reason: str) -> None:
        # first the request, at whose place a replay resets too
        self._send(reset_request(self._arrival_ns, reason, node=self._node))
        self._report(self.monitor.reset(self._arrival_ns, reason))
        self.recorder.forget()
        self.latest = None

    def _note(self, kind: EventKind, text: str) -> None:
        self._send(event_message(EventNote(kind, self._arrival_ns, text, {}), node=self._node))

    def _report(self, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, Update | Coastdown) and event.estimate is not None:
                self.latest = event.estimate
            self.why_none = event.reason if isinstance(event, NoEstimate) else ''
            if self._told is not None:
                self._told(event)
            for message in outputs(event, node=self._node):
                self._send(message)
            if (
                self._ended is not None
                and isinstance(event, Coastdown)
                and event.ended_by is not EndedBy.RESET
                and not event.withdrawn
            ):
                self._ended(event, self.monitor.ended_window(event))

    def _send(self, message: OutputMessage) -> None:
        self._publish(message)
        if self._arrival_ns:  # 0: sim time before the first /clock
            self.recorder.output(message, self._arrival_ns)
