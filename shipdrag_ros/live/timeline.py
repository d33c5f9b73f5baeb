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
from shipdrag_ros.coastdown import InputHealth, Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown, Event, OnCoastdown
from shipdrag_ros.messages import outputs
from shipdrag_ros.messages.heard import (
    OK,
    STALE,
    WARN,
    Health,
    Heard,
    NodeMessage,
    Samples,
    Status,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.playback import feed
from shipdrag_ros.samples import Block
from shipdrag_ros.ship import Ship

SECOND_NS = 1_000_000_000
_HEALTH_NS = 5 * SECOND_NS
_SILENT_S = 10.0


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
        health_ns = 0
        for piece in self._pieces():
            if self._stop.is_set():
                return
            heard: list[Heard] = []
            if isinstance(piece, Block):
                at_ns = int(piece.receive_ns[-1])
                heard.append(Samples(piece))
            else:
                at_ns = piece.receive_ns
            heard += self._heard(monitor, feed(monitor, piece))
            if at_ns - health_ns >= _HEALTH_NS or len(heard) > 1:
                health_ns = at_ns
                heard.append(_health(monitor, at_ns))
            self._add(at_ns, heard)
        last = self._heard(monitor, monitor.finish())
        self._add(self.end_ns, [*last, _health(monitor, self.end_ns)])
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


def _health(monitor: Monitor, now_ns: int) -> Health:
    """Say what a node would say of itself."""
    values = {'lifecycle': 'active', 'monitor': monitor.state.value}
    values |= monitor.progress.values
    state = Status('bag', 'state', OK, monitor.state.value, values)
    inputs = [
        _input(name, health, now_ns)
        for name, health in monitor.health().items()
        if health.messages
    ]
    return Health((state, *inputs))


def _input(name: str, health: InputHealth, now_ns: int) -> Status:
    level, text = OK, 'receiving'
    values = {f'rejected {reason}': str(count) for reason, count in health.rejected.items()}
    if health.rate_hz is not None:
        values['rate [Hz]'] = f'{health.rate_hz:.6g}'
    if health.last_receive_ns is None:
        level, text = WARN, 'nothing of it could be used'
    else:
        age_s = (now_ns - health.last_receive_ns) * 1e-9
        values['age [s]'] = f'{age_s:.6g}'
        if age_s > _SILENT_S:
            level, text = STALE, f'no data for {age_s:.0f} s'
    return Status('bag', f'input {name}', level, text, values)
