# SPDX-License-Identifier: Apache-2.0
"""
Whether an input can be believed: a level and a sentence that says why, and what to do.

Free of ROS. What counts is what became of the readings lately, not that
messages arrive.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from shipdrag_ros.messages.heard import ERROR, OK, STALE, WARN
from shipdrag_ros.samples import ALL_MOTION

RECENT_S = 30.0
SILENT_S = 10.0  # an input heard before and silent for longer is stale
USED_MIN = 0.98  # of the readings: a sensor that drops out more often wants a look
MOTION_USED_MIN = 0.5  # below, a motion is not known
RATE_MIN_HZ = 0.2  # slopes are taken over some tens of seconds
BEHIND_S = 5.0  # of the clock of this computer
AHEAD_S = 1.0
SKEW_S = 2.0  # between two inputs of the motion: 1 % of a coastdown's time scale


@dataclass(frozen=True)
class Finding:
    """One thing to say of an input."""

    level: int
    text: str


@dataclass(frozen=True)
class Counts:
    """
    What became of the messages of an input, up to a moment or over some time.

    Attributes
    ----------
    messages
        Heard.
    used
        Readings accepted.
    rejected
        Readings that were not, by reason; those that could not be read too.
    lost
        Messages sent and not heard.
    unstamped
        Readings whose header holds no time.
    """

    messages: int = 0
    used: int = 0
    rejected: Mapping[str, int] = field(default_factory=dict)
    lost: int = 0
    unstamped: int = 0

    @property
    def readings(self) -> int:
        """Used and rejected."""
        return self.used + sum(self.rejected.values())

    def since(self, before: Counts) -> Counts:
        """
        Return what was added since an earlier moment.
        """
        rejected = Counter(self.rejected)
        rejected.subtract(before.rejected)
        return Counts(
            self.messages - before.messages,
            self.used - before.used,
            {reason: times for reason, times in rejected.items() if times > 0},
            self.lost - before.lost,
            self.unstamped - before.unstamped,
        )


class Recently:
    """The counts of an input over the last `RECENT_S`."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, Counts]] = deque()

    def add(self, now_s: float, counts: Counts) -> None:
        """
        Take the counts of a moment on a steady clock [s].
        """
        if self._past and counts.used < self._past[-1][1].used:
            self._past.clear()  # a new activation counts from 0
        self._past.append((now_s, counts))
        while self._past[0][0] < now_s - RECENT_S:
            self._past.popleft()

    @property
    def seconds(self) -> float:
        """How long that is."""
        return self._past[-1][0] - self._past[0][0] if self._past else 0.0

    @property
    def counts(self) -> Counts:
        """What was added over that time."""
        return self._past[-1][1].since(self._past[0][1]) if self._past else Counts()

    @property
    def rate_hz(self) -> float:
        """Messages a second of the last step; None gives 0."""
        if len(self._past) < 2:
            return 0.0
        (before_s, before), (now_s, now) = self._past[-2], self._past[-1]
        return (now.messages - before.messages) / max(now_s - before_s, 1e-9)


@dataclass(frozen=True)
class InputFacts:
    """
    What is known of one input.

    Attributes
    ----------
    needed
        Whether nothing else shows the motion.
    type
        Heard; None while there is none.
    stamped
        Whether that type carries a time.
    fed, may_be_fed
        Whether NMEA feeds it, or could.
    other_types, accepted, absent
        Types published and not heard; types that could be; could be with their package.
    senders
        Nodes that publish the type heard.
    misfit
        QoS policy for which a publisher is not heard.
    active
        Whether readings are judged at all.
    age_s
        Since the last message; None before the first.
    total
        Since it is an input.
    recent, seconds
        Over the last while.
    offset_s
        Arrival minus stamp; None where unknown, or where the clock is simulated.
    behind
        The input of the motion whose stamps are nearest to their arrival, and by how much this
        one is behind it [s]; None where it is that one, or nothing is known.
    doubt
        What else is odd about it, '' if nothing is.
    about
        What else is to be shown of it, by key.
    """

    name: str
    needed: bool = False
    type: str | None = None
    stamped: bool = True
    fed: bool = False
    may_be_fed: bool = False
    other_types: tuple[str, ...] = ()
    accepted: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()
    senders: tuple[str, ...] = ()
    misfit: str | None = None
    active: bool = True
    age_s: float | None = None
    total: Counts = Counts()
    recent: Counts = Counts()
    seconds: float = 0.0
    offset_s: float | None = None
    behind: tuple[str, float] | None = None
    doubt: str = ''
    about: Mapping[str, object] = field(default_factory=dict)

    @property
    def fresh(self) -> bool:
        """Whether it was received lately."""
        return self.age_s is not None and self.age_s < SILENT_S


def judge(facts: InputFacts) -> Finding:
    """
    Return the gravest finding, with the others behind it.
    """
    found = sorted(_findings(facts), key=lambda finding: -finding.level)
    if not found:
        stamped = '' if facts.stamped else '; its type holds no time: it counts from its arrival'
        return Finding(OK, f'receiving{stamped}')
    return Finding(found[0].level, '; '.join(finding.text for finding in found))


def _findings(facts: InputFacts) -> Iterator[Finding]:
    others = ', '.join(facts.other_types)
    if facts.type is None and others:
        accepted = ', '.join(facts.accepted)
        text = f'wrong type: {others} is published, accepted are {accepted}'
        for name in set(facts.other_types).intersection(facts.absent):
            package = name.partition('/')[0]
            text = f'{name} is published, and its package is not here: install {package}'
        yield Finding(ERROR, text)
        return
    if facts.type is None or (facts.age_s is None and not facts.senders and not others):
        level = WARN if facts.needed else OK
        nor = ', and nothing by NMEA so far' if facts.may_be_fed else ''
        yield Finding(level, f'no publisher{nor}')
        return
    if others:
        text = (
            f'wrong type: also published as {others}, heard is only {facts.type}: stop one, or '
            f'name the one to hear in the parameter {facts.name}.type'
        )
        yield Finding(WARN, text)
    if facts.misfit is not None:
        text = f'a publisher is not heard: its {facts.misfit} QoS does not fit'
        yield Finding(WARN, text)
    if len(facts.senders) > 1:
        yield Finding(WARN, _one_stream(facts.senders))
    if facts.age_s is None:
        yield Finding(WARN, 'no data')
        return
    if facts.age_s > SILENT_S:
        gone = '' if facts.senders or facts.fed else ', no publisher any more'
        yield Finding(STALE, f'no data for {facts.age_s:.0f} s{gone}')
        return
    yield from _of_readings(facts)
    yield from _of_time(facts)
    if facts.doubt:
        yield Finding(WARN, facts.doubt)


def _one_stream(senders: tuple[str, ...]) -> str:
    times = Counter(senders)
    names = ', '.join(f'{name} {n} times' if n > 1 else name for name, n in times.items())
    return (
        f'{len(senders)} publishers, {names}, are taken for one stream: stop all but one, or '
        'remap the input to the topic of one'
    )


def _of_readings(facts: InputFacts) -> Iterator[Finding]:
    recent = facts.recent
    if recent.lost:
        text = f'{recent.lost} messages lost in {facts.seconds:.0f} s: sent and not heard'
        yield Finding(WARN, text)
    readings = recent.readings
    if not facts.active or not readings:
        return
    share = recent.used / readings
    if share >= USED_MIN:
        if (
            facts.name in ALL_MOTION
            and facts.seconds > 0.5 * RECENT_S
            and recent.used < RATE_MIN_HZ * facts.seconds
        ):
            rate = recent.used / facts.seconds
            yield Finding(WARN, f'{rate:.2g} Hz is too slow, at least 0.2 Hz is needed')
        return
    motion = facts.name in ALL_MOTION
    grave = share < MOTION_USED_MIN if motion else not recent.used
    reasons = sorted(recent.rejected.items(), key=lambda item: -item[1])
    why = ', '.join(f'{times} {reason.replace("_", " ")}' for reason, times in reasons)
    used = 'none' if not recent.used else f'{share:.0%}'
    text = f'{used} of {readings} readings used in {facts.seconds:.0f} s: {why}'
    if recent.unstamped:
        advice = 'the header holds no time: let the driver stamp its messages'
    else:
        advice = _ADVICE.get(reasons[0][0], '')
        if reasons[0][0] in ('future', 'late') and facts.offset_s is not None:
            advice = f'its clock is {_offset(facts.offset_s)}; set it'
    yield Finding(ERROR if grave else WARN, f'{text}; {advice}' if advice else text)


_ADVICE = {
    'nan': 'the sensor gives no number: look at it',
    'infinite': 'the sensor gives no finite number: look at it',
    'absurd': 'no ship moves like that: look at sensor and unit',
    'frozen': 'the sensor repeats itself: it is stuck, look at it',
    'outlier': 'impossible after the readings before: look at the sensor',
    'duplicate': 'stamps repeat: is it published twice, or not stamped anew?',
    'out_of_order': 'stamps go back: are there two sources on the topic?',
    'late': 'stamps are far behind those of other inputs: set its clock',
    'future': 'stamps are ahead of the clock of this computer: set either',
    'malformed': 'no message of its type: is the driver built for this ROS?',
    'too_long': 'over 64 KiB, as no instrument sends: not recorded; look who publishes it',
    'flood': 'over 1000 a second, as no instrument sends: not recorded; look who publishes it',
    'no_joint': 'no joint with the name and value that is read: see the list of inputs',
    'surplus_joint': 'more joints than are read',
}


def _of_time(facts: InputFacts) -> Iterator[Finding]:
    offset_s = facts.offset_s
    if facts.recent.unstamped or not facts.stamped or 'future' in facts.recent.rejected:
        return  # said with the readings
    if offset_s is not None and (offset_s > BEHIND_S or offset_s < -AHEAD_S):
        text = f'its clock is {_offset(offset_s)}: set either'
        yield Finding(WARN, text)
    elif facts.behind is not None and facts.behind[1] > SKEW_S:
        other, seconds = facts.behind
        text = f'its stamps are {seconds:.1f} s behind those of {other}: set its clock'
        yield Finding(WARN, text)


def _offset(offset_s: float) -> str:
    side = 'behind' if offset_s > 0.0 else 'ahead of'
    size = abs(offset_s)
    figure = f'{size:.1f} s' if size < 1e4 else f'{size / 86400.0:.3g} days'
    return f'{figure} {side} that of this computer'


def convention_doubt(convention: str, *, stamped: bool, fed: bool) -> str:
    """
    Say that a heading would be turned twice, '' if it is not.

    Parameters
    ----------
    convention
        `Parameters.heading_convention`.
    stamped
        Whether its type holds a time; the one that does not is degrees of a compass.
    fed
        Whether NMEA feeds it.
    """
    if convention == 'rep103' or (stamped and not fed):
        return ''
    source = 'NMEA' if fed else 'its type'
    return (
        f'heading_convention is {convention}, but {source} is known to count from north and is '
        'turned already: set it to rep103'
    )


def behind_others(
    offsets_s: Mapping[str, float | None], *, simulated: bool = False
) -> dict[str, tuple[str, float]]:
    """
    Return by how much each input of the motion lags the one with the least lag [s].

    Parameters
    ----------
    offsets_s
        Arrival minus stamp of the inputs that are heard, by name. One that is ahead of this
        computer is no measure for the others: nothing is measured after it arrives.
    simulated
        Whether the clock is simulated; being ahead of it then means nothing.
    """
    known = {
        name: offset
        for name, offset in offsets_s.items()
        if name in ALL_MOTION and offset is not None and math.isfinite(offset)
    }
    if len(known) < 2:
        return {}
    measures = [name for name in known if simulated or known[name] >= -AHEAD_S]
    if not measures:
        return {}
    first = min(measures, key=lambda name: known[name])
    return {
        name: (first, known[name] - known[first])
        for name in known
        if name != first and known[name] >= known[first]
    }
