# SPDX-License-Identifier: Apache-2.0
"""
What no message shows: silence, clocks that are set, messages that were lost.

Looked at every tick; what comes of it goes through the session, so that it is
published, recorded, and obeyed by a replay.

A clock that is set amid a coastdown puts readings where the ship never was. Its
own clock the node knows by one that nobody sets; that of a sensor by the lag of
its stamps, whose smallest over some seconds changes only if a clock does:
a network that stalls makes lags longer for a while, and none shorter.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence

from shipdrag_ros.coastdown import InputHealth
from shipdrag_ros.coastdown.events import State
from shipdrag_ros.messages import EventKind
from shipdrag_ros.messages.types import is_stamped
from shipdrag_ros.node.health import convention_doubt
from shipdrag_ros.node.inputs import InputTopic
from shipdrag_ros.node.session import Session
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import ALL_MOTION, BACKWARD_JUMP_NS, MOTION_INPUTS

AWAY_S = 5.0  # between two ticks: the node stood still, and what waits is not silence
_SIDE = ('sooner', 'later')
_SAID_S = 60.0  # a clock that was set is shown this long
STEP_S = 1.0  # a step this large is worth an end; slewing is slower
LOOKS = 20  # ticks on each side of a step back, at which lags are longer for good
_MOMENT_NS = 100_000_000
_LATEST = 2  # ticks that show a step forward


def boot_ns() -> int:
    """
    Return a time that nobody sets, and that goes on while the computer sleeps [ns].
    """
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def both_ns() -> tuple[int, int] | None:
    """
    Return the clock of this computer and `boot_ns` at one moment.

    None where the process was held up between the two.
    """
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

    def tick(self, session: Session, health: Mapping[str, InputHealth], now_ns: int) -> None:
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
        self._watch_silence(session, health, now_ns)
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
                stamped = topic.type is None or is_stamped(topic.type)
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
        self, session: Session, health: Mapping[str, InputHealth], now_ns: int
    ) -> None:
        steady_s, _ = now = time.monotonic(), now_ns
        ages = [topic.age_s for topic in self._topics if topic.name in ALL_MOTION]
        used = sum(health[name].used for name in ALL_MOTION if name in health)
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
