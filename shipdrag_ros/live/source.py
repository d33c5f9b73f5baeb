# SPDX-License-Identifier: Apache-2.0
"""Where the picture comes from: a node that runs, or bags that are played."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol

from shipdrag_ros.bags.run import Run
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.errors import ShipdragError, reason_of
from shipdrag_ros.estimation import Window
from shipdrag_ros.live import FASTEST
from shipdrag_ros.live.bridge import Bridge
from shipdrag_ros.live.earlier import PastRun
from shipdrag_ros.live.timeline import Timeline
from shipdrag_ros.messages.heard import Heard, Samples
from shipdrag_ros.node.diagnosing import Diagnosing
from shipdrag_ros.replay.playback import settings_of
from shipdrag_ros.samples import SECOND_NS, concatenate
from shipdrag_ros.ship import Ship

WAITING = 20_000  # messages heard and not yet looked at; more are dropped and counted


class PictureFeed(Protocol):
    """What feeds the picture."""

    bridge: Bridge

    def advance(self, now_s: float) -> bool:
        """Take what is new at a time [s, steady clock]; True: the picture jumps."""
        ...

    def player(self) -> dict[str, Any] | None:
        """Return how it plays; None where nothing is played."""
        ...

    def control(self, action: str, value: float) -> None:
        """Play, pause, set the speed, seek."""
        ...

    def close(self) -> None:
        """End what it has begun."""
        ...


class NodeSource:
    """
    A node that runs: what a listener in another thread hears.
    """

    def __init__(self, ship: Ship | None = None) -> None:
        self.bridge = Bridge(ship)
        self.lost = 0
        self._waiting: deque[Heard | PastRun] = deque()

    def hear(self, heard: Heard | PastRun) -> None:
        """
        Take something, from any thread; never waits.
        """
        if len(self._waiting) >= WAITING:
            self.lost += 1
            return
        self._waiting.append(heard)

    def advance(self, now_s: float) -> bool:
        """Look at what was heard."""
        for _ in range(len(self._waiting)):
            heard = self._waiting.popleft()
            if isinstance(heard, PastRun):
                self.bridge.add_past(heard)
            else:
                self.bridge.hear(heard, now_s)
        restarted, self.bridge.trace.restarted = self.bridge.trace.restarted, False
        return restarted

    def player(self) -> dict[str, Any] | None:
        """Nothing is played."""
        return None

    def control(self, action: str, value: float) -> None:
        """There is nothing to control."""
        raise ShipdragError('a running node is watched: there is nothing to play')

    def close(self) -> None:
        """Nothing was begun."""


class BagSource:
    """
    Bags that are played, one after the other.

    Parameters
    ----------
    runs
        From `open_runs`.
    ship
        Instead of those attached to the bags.
    speed
        Seconds of record in a second.
    past
        Coastdowns that ended before.

    Raises
    ------
    BagError
        If a bag has no input, or no ship file where none is given.
    """

    def __init__(
        self,
        runs: Sequence[Run],
        *,
        ship: Ship | None = None,
        speed: float = 1.0,
        past: Sequence[PastRun] = (),
    ) -> None:
        self._runs = [(run, *settings_of(run, ship)) for run in runs]
        self._number = -1
        self._speed = speed
        self._playing = True
        self._at_ns = 0
        self._looked_s: float | None = None
        self._jumped = False
        self._past = list(past)
        self._diagnosing: Diagnosing | None = None
        self._open(0)

    def advance(self, now_s: float) -> bool:
        """Play on."""
        passed_s = 0.0 if self._looked_s is None else now_s - self._looked_s
        self._looked_s = now_s
        before_ns = self._at_ns
        if self._playing:
            step_ns = round(passed_s * self._speed * 1e9)
            self._at_ns = min(self._at_ns + step_ns, self._timeline.read_ns)
        self._hear(before_ns, self._at_ns, now_s)
        if self._playing and self._timeline.done and self._at_ns >= self._timeline.end_ns:
            if self._number + 1 < len(self._runs):
                self._open(self._number + 1)
            else:
                self._playing = False
        self._show_verdict()
        jumped, self._jumped = self._jumped, False
        return jumped

    def player(self) -> dict[str, Any] | None:
        """Return how it plays."""
        line = self._timeline
        return {
            'bags': [run.name for run, _, _ in self._runs],
            'bag': self._number,
            'playing': self._playing,
            'speed': self._speed,
            'start_s': line.start_ns // 10**9,
            'end_s': line.end_ns // 10**9,
            'read_s': line.read_ns // 10**9,
            'at_s': self._at_ns // 10**9,
            'problem': line.problem,
        }

    def control(self, action: str, value: float) -> None:
        """
        Play, pause, set the speed, seek to a second of the epoch, choose a bag by its number.

        Raises
        ------
        ShipdragError
            If that is none of them, or out of range.
        """
        match action:
            case 'play':
                if self._timeline.done and self._at_ns >= self._timeline.end_ns:
                    self._seek(self._timeline.start_ns)
                self._playing = True
            case 'pause':
                self._playing = False
            case 'speed' if 0.0 < value <= FASTEST:
                self._speed = value
            case 'seek' if 0.0 <= value < 2**33:
                self._seek(round(value * 1e9))
            case 'bag' if value in range(len(self._runs)):
                self._open(int(value))
            case _:
                raise ShipdragError(
                    f'{action!r} {value:g}: play, pause, speed 0 to {FASTEST:g}, seek, or bag'
                )

    def close(self) -> None:
        """Read no further, diagnose nothing more."""
        self._timeline.stop()
        if self._diagnosing is not None:
            self._diagnosing.close()

    def _open(self, number: int) -> None:
        if self._number >= 0:
            self._past = list(self.bridge.past)
            self.close()
        self._number = number
        run, ship, parameters = self._runs[number]
        self._diagnosing = Diagnosing(ship, parameters, enabled=True)
        self._timeline = Timeline(run, ship, parameters, ended=self._begin)
        self._reader = threading.Thread(target=self._read, name='reading', daemon=True)
        self._reader.start()
        self._rewind()

    def _read(self) -> None:
        line = self._timeline
        try:
            line.read()
        except Exception as error:  # a thread that ends unseen would leave the page waiting
            line.problem = reason_of(error)

    def _begin(self, coastdown: EndedCoastdown, window: Window) -> None:
        assert self._diagnosing is not None
        self._diagnosing.begin(coastdown, window)

    def _rewind(self) -> None:
        run, ship, _ = self._runs[self._number]
        self.bridge = Bridge(ship, bag=run.name)
        for past in self._past:
            self.bridge.add_past(past)
        self._at_ns = self._timeline.start_ns
        self._jumped = True

    def _seek(self, to_ns: int) -> None:
        line = self._timeline
        if to_ns // SECOND_NS >= line.end_ns // SECOND_NS:
            to_ns = line.end_ns  # a page knows whole seconds, and what ends there has to be heard
        to_ns = min(max(to_ns, line.start_ns), line.read_ns)
        if to_ns < self._at_ns:
            self._rewind()
            self._hear(line.start_ns - 1, to_ns, self._looked_s or 0.0)
        else:
            self._hear(self._at_ns, to_ns, self._looked_s or 0.0)
        self._at_ns = to_ns
        self._jumped = True

    def _hear(self, after_ns: int, until_ns: int, now_s: float) -> None:
        """Hear what lies between; readings without anything said between them at once."""
        if after_ns == self._timeline.start_ns:
            after_ns -= 1  # the first moment too
        waiting = []
        for moment in self._timeline.between(after_ns, until_ns):
            for heard in moment.heard:
                if isinstance(heard, Samples):
                    waiting.append(heard.block)
                    continue
                if waiting:
                    self.bridge.hear(Samples(concatenate(waiting)), now_s)
                    waiting = []
                self.bridge.hear(heard, now_s)
        if waiting:
            self.bridge.hear(Samples(concatenate(waiting)), now_s)
        self.bridge.keep_alive(now_s)

    def _show_verdict(self) -> None:
        """Say what the diagnosis says of a coastdown that has ended by now."""
        assert self._diagnosing is not None
        status = self._diagnosing.status
        of, found = status.coastdown, status.found
        if of is not None and of.end_ns > self._at_ns:  # read ahead, and not played yet
            return
        if found is not None:
            self.bridge.take_diagnosis(found)
        self.bridge.show_verdict(status.state.value, status.reason)
