# SPDX-License-Identifier: Apache-2.0
"""
A bag as a node would have shown it: through the same monitor, second by second.

Read once, ahead of whoever plays it; playing, pausing and seeking only walk
what is there.
"""

from __future__ import annotations

import bisect
import threading
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from shipdrag_ros.bags.run import Mark, Run
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown, Event, OnCoastdown
from shipdrag_ros.messages.heard import Health, Heard, NodeMessage, Samples
from shipdrag_ros.messages.publishing import outputs
from shipdrag_ros.node.health import InputStates, Standing, state_status
from shipdrag_ros.node.judging import Counts, InputFacts
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.playback import feed
from shipdrag_ros.samples import SECOND_NS, Block, Channel
from shipdrag_ros.ship import Ship

_HEALTH_NS = 5 * SECOND_NS


class Moment(NamedTuple):
    """What was heard in a second of a bag, by its time of arrival [ns]."""

    receive_ns: int
    heard: tuple[Heard, ...]


class Timeline:
    """
    All moments of a bag, as far as it has been read.

    Parameters
    ----------
    run
    ship, parameters
        What the monitor is given.
    ended
        Called, while it is read, with each coastdown that has ended.

    Attributes
    ----------
    start_ns, end_ns
        First time of arrival in the bag, and just after the last.
    done
        Whether all of it has been read.
    problem
        Why reading stopped early; '' if it did not.
    """

    def __init__(
        self, run: Run, ship: Ship, parameters: Parameters, *, ended: OnCoastdown | None = None
    ) -> None:
        self.start_ns, last_ns = run.span_ns or (0, 0)
        self.end_ns = last_ns + 1  # after the last message: what ends with the record
        self.done = False
        self.problem = ''
        self._run = run
        self._ship, self._parameters = ship, parameters
        self._ended = ended
        self._moments: list[Moment] = []
        self._times: list[int] = []
        self._last_ns: dict[str, int] = {}  # arrival, by input
        self._stop = threading.Event()

    @property
    def read_ns(self) -> int:
        """How far it has been read."""
        if self.done:
            return self.end_ns
        return self._times[-1] if self._times else self.start_ns

    def between(self, after_ns: int, until_ns: int) -> list[Moment]:
        """
        Return the moments that are read, after one time and until another.
        """
        first = bisect.bisect_right(self._times, after_ns)
        return self._moments[first : bisect.bisect_right(self._times, until_ns)]

    def stop(self) -> None:
        """
        Read no further.
        """
        self._stop.set()

    def read(self) -> None:
        """
        Read the bag; for a thread of its own.
        """
        monitor = Monitor(self._ship, self._parameters)
        inputs = InputStates()
        health_ns = 0
        for piece in self._pieces():
            if self._stop.is_set():
                return
            heard: list[Heard] = []
            if isinstance(piece, Block):
                at_ns = int(piece.receive_ns[-1])
                heard.append(Samples(piece))
                for code in np.unique(piece.channel).tolist():
                    self._last_ns[Channel(code).input] = at_ns
            else:
                at_ns = piece.receive_ns
            heard += self._heard(monitor, feed(monitor, piece))
            if at_ns - health_ns >= _HEALTH_NS or len(heard) > 1:
                health_ns = at_ns
                heard.append(self._health(monitor, inputs, at_ns))
            self._add(at_ns, heard)
        last = self._heard(monitor, monitor.finish())
        self._add(self.end_ns, [*last, self._health(monitor, inputs, self.end_ns)])
        self.done = True

    def _pieces(self) -> Iterator[Block | Mark]:
        """Yield the inputs, a second of arrival at a time."""
        for item in self._run.inputs():
            if not isinstance(item, Block):
                yield item
                continue
            seconds = item.receive_ns // SECOND_NS
            cuts = np.flatnonzero(np.diff(seconds, prepend=-1, append=seconds[-1] + 1))
            for i, j in pairwise(cuts.tolist()):
                yield item[i:j]

    def _add(self, at_ns: int, heard: list[Heard]) -> None:
        at_ns = max(at_ns, self._times[-1] if self._times else at_ns)
        self._moments.append(Moment(at_ns, tuple(heard)))
        self._times.append(at_ns)  # last: whoever looks finds the moment there

    def _heard(self, monitor: Monitor, events: list[Event]) -> list[Heard]:
        heard: list[Heard] = []
        for event in events:
            for message in outputs(event):
                heard.append(NodeMessage(message.topic.rpartition('/')[2], message.payload))
            if self._ended is not None and isinstance(event, EndedCoastdown) and event.stands:
                self._ended(event, monitor.ended_window(event))
        return heard

    def _health(self, monitor: Monitor, inputs: InputStates, now_ns: int) -> Health:
        """Say what a node would say of itself."""
        doubts, last_ns = monitor.doubts(), self._last_ns
        facts = [
            InputFacts(
                name,
                type=name,
                senders=('the record',),
                age_s=(now_ns - last_ns[name]) * 1e-9,
                doubt=doubts.get(name, ''),
                total=Counts(health.messages, health.used, health.rejected),
            )
            for name, health in monitor.health().items()
            if name in last_ns
        ]
        states = inputs.tick(facts, simulated=True, now_s=now_ns * 1e-9)
        standing = Standing(
            'active',
            monitor.state,
            now_ns,
            sim_time=False,
            hint='the record is silent here',
            steady_lead_s=monitor.steady_lead_s,
            steady_needed_s=self._parameters.slope_window_s,
            progress=monitor.progress,
        )
        return Health((state_status(standing, states), *(each.status for each in states)))
