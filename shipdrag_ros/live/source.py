# SPDX-License-Identifier: Apache-2.0
"""Where the picture comes from: a node that runs, or bags that are played."""

from __future__ import annotations

import bisect
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import chain, groupby, pairwise
from typing import Any, NamedTuple

import numpy as np

from shipdrag_ros.bags.run import Mark, Run
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown, Event, OnCoastdown
from shipdrag_ros.errors import ShipdragError, reason_of
from shipdrag_ros.library.replaying import ship_in
from shipdrag_ros.live import FASTEST
from shipdrag_ros.live.bridge import Bridge
from shipdrag_ros.live.outputs import PastRun
from shipdrag_ros.messages.publishing import outputs
from shipdrag_ros.messages.topics import Health, Heard, NodeMessage, Samples
from shipdrag_ros.node.background import Diagnosing
from shipdrag_ros.node.health import InputFacts, InputStates, Standing, state_status
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.playback import feed, settings_of
from shipdrag_ros.samples import SECOND_NS, Block, Channel, concatenate
from shipdrag_ros.ship import Ship

_HEALTH_NS = 5 * SECOND_NS


class Moment(NamedTuple):
    """What was heard in a second of a bag, by its time of arrival [ns]."""

    receive_ns: int
    heard: tuple[Heard, ...]


class Timeline:
    """
    All moments of a bag as a node would have shown it, as far as it has been read.

    It is read once, through the same monitor, second by second, ahead of whoever plays it;
    playing, pausing and seeking only walk what is there.

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
        self,
        run: Run,
        ship: Ship,
        parameters: Parameters,
        *,
        ended: OnCoastdown = lambda coastdown, window: None,
    ) -> None:
        self.start_ns, last_ns = run.span_ns or (0, 0)
        self.end_ns = last_ns + 1  # after the last message: what ends with the record
        self.done = False
        self.problem = ''
        self._run = run
        self._ship, self._parameters = ship, parameters
        self._ended = ended
        self._moments: list[Moment] = []
        self._last_ns: dict[str, int] = {}  # arrival, by input
        self._stop = threading.Event()

    @property
    def read_ns(self) -> int:
        """How far it has been read."""
        if self.done:
            return self.end_ns
        return self._moments[-1].receive_ns if self._moments else self.start_ns

    def between(self, after_ns: int, until_ns: int) -> list[Moment]:
        """
        Return the moments that are read, after one time and until another.
        """
        first, last = (
            bisect.bisect_right(self._moments, at_ns, key=lambda each: each.receive_ns)
            for at_ns in (after_ns, until_ns)
        )
        return self._moments[first:last]

    def stop(self) -> None:
        """
        Read no further.
        """
        self._stop.set()

    def read_or_say(self) -> None:
        """
        Read the bag, in a thread of its own, which would leave a page waiting if it ended unseen.
        """
        try:
            self.read()
        except Exception as error:
            self.problem = reason_of(error)

    def read(self) -> None:
        """
        Read the bag.
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
        last_ns = self._moments[-1].receive_ns if self._moments else at_ns
        self._moments.append(Moment(max(at_ns, last_ns), tuple(heard)))

    def _heard(self, monitor: Monitor, events: list[Event]) -> list[Heard]:
        heard: list[Heard] = []
        for event in events:
            heard += [
                NodeMessage(message.topic.rpartition('/')[2], message.payload)
                for message in outputs(event)
            ]
            if isinstance(event, EndedCoastdown) and event.stands:
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
                total=counts,
            )
            for name, counts in monitor.counts().items()
            if name in last_ns
        ]
        states = inputs.tick(facts, simulated=True, now_s=now_ns * 1e-9)
        standing = Standing(
            'active',
            monitor,
            now_ns,
            sim_time=False,
            hint='the record is silent here',
            steady_needed_s=self._parameters.slope_window_s,
        )
        return Health((state_status(standing, states), *(each.status for each in states)))


WAITING = 20_000  # messages heard and not yet looked at; more are dropped and counted


class PictureFeed:
    """What feeds the picture; one that plays something says how, and may be controlled."""

    bridge: Bridge

    def advance(self, now_s: float) -> bool:
        """Take what is new at a time [s, steady clock]; True: the picture jumps."""
        raise NotImplementedError

    def player(self) -> dict[str, Any] | None:
        """Return how it plays; None where nothing is played."""
        return None

    def control(self, action: str, value: float) -> None:
        """Play, pause, set the speed, seek."""
        raise ShipdragError('a running node is watched: there is nothing to play')

    def close(self) -> None:
        """End what it has begun."""


class NodeSource(PictureFeed):
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
        return False


class BagSource(PictureFeed):
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
        self._runs = [(run, *settings_of(run, ship_in(run, ship)[0])) for run in runs]
        self._number = -1
        self._speed = speed
        self._playing = True
        self._at_ns = 0
        self._looked_s: float | None = None
        self._jumped = False
        self._past = list(past)
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
        self.bridge.problem = self._timeline.problem
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
        self._diagnosing.close()

    def _open(self, number: int) -> None:
        if self._number >= 0:
            self._past = list(self.bridge.past)
            self.close()
        self._number = number
        run, ship, parameters = self._runs[number]
        self._diagnosing = Diagnosing(ship, parameters, enabled=True)
        self._timeline = Timeline(run, ship, parameters, ended=self._diagnosing.begin)
        threading.Thread(target=self._timeline.read_or_say, name='reading', daemon=True).start()
        self._rewind()

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
        self._hear(self._at_ns, to_ns, self._looked_s or 0.0)
        self._at_ns = to_ns
        self._jumped = True

    def _hear(self, after_ns: int, until_ns: int, now_s: float) -> None:
        """Hear what lies between; readings without anything said between them at once."""
        if after_ns == self._timeline.start_ns:
            after_ns -= 1  # the first moment too
        between = self._timeline.between(after_ns, until_ns)
        said = chain.from_iterable(moment.heard for moment in between)
        for _, each in groupby(said, key=lambda heard: isinstance(heard, Samples)):
            together = list(each)
            blocks = [heard.block for heard in together if isinstance(heard, Samples)]
            for heard in [Samples(concatenate(blocks))] if blocks else together:
                self.bridge.hear(heard, now_s)
        self.bridge.keep_alive(now_s)

    def _show_verdict(self) -> None:
        """Say what the diagnosis says of a coastdown that has ended by now."""
        status = self._diagnosing.status
        of, found = status.coastdown, status.found
        if of is not None and of.end_ns > self._at_ns:  # read ahead, and not played yet
            return
        if found is not None:
            self.bridge.take_diagnosis(found)
        self.bridge.show_verdict(status.state.value, status.reason)
