# SPDX-License-Identifier: Apache-2.0
"""Several sources of NMEA 0183 heard at once, their lines in order of arrival."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from shipdrag_ros.nmea.address import Address
from shipdrag_ros.nmea.listener import LineListener, SourceCounts

WAITING_LINES = 8000
"""That wait to be taken; what finds no room is counted."""


class Line(NamedTuple):
    """A line, where it was heard and when it was read [ns since the epoch]."""

    address: Address
    text: str
    read_ns: int


class LiveNmea:
    """
    Hears sources in threads, from `start` to `close`.

    Parameters
    ----------
    addresses
        Where to hear.
    clock_ns
        The clock that lines are stamped by [ns since the epoch].
    wake
        Called in a thread when there is something to take.

    Attributes
    ----------
    lost
        Lines that found no room among those that wait.
    """

    def __init__(
        self,
        addresses: Sequence[Address],
        *,
        clock_ns: Callable[[], int],
        wake: Callable[[], None],
    ) -> None:
        self.lost = 0
        self._clock_ns = clock_ns
        self._wake = wake
        self._waiting: deque[Line] = deque()
        self._lock = threading.Lock()
        self._listeners = [LineListener(address, self._deliver) for address in addresses]

    def start(self) -> None:
        """
        Begin to hear; a source that cannot be opened is tried again and said.
        """
        for listener in self._listeners:
            listener.start()

    def close(self) -> None:
        """
        End all threads.
        """
        for listener in self._listeners:
            listener.stop()
        for listener in self._listeners:
            listener.close()

    def take(self, most: int) -> list[Line]:
        """
        Return the oldest lines that wait, at most so many.
        """
        with self._lock:
            return [self._waiting.popleft() for _ in range(min(most, len(self._waiting)))]

    @property
    def waiting(self) -> int:
        """Lines that can be taken."""
        return len(self._waiting)

    def counts(self) -> Mapping[Address, SourceCounts]:
        """
        Return what became of each source.
        """
        return {listener.address: listener.counts for listener in self._listeners}

    def _deliver(self, address: Address, lines: list[str]) -> None:
        with self._lock:
            # in the lock, so that lines stand in the order of their times
            read_ns = self._clock_ns()
            room = WAITING_LINES - len(self._waiting)
            self._waiting.extend(Line(address, text, read_ns) for text in lines[:room])
            self.lost += max(len(lines) - room, 0)
        self._wake()
