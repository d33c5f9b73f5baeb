# SPDX-License-Identifier: Apache-2.0
"""
How the node is, part by part: the one source for /diagnostics, the log, a terminal and the page.

Each function turns one part into one `Status`. A figure has its unit in its key.
Free of ROS, so that a bag that is played is judged as a node judges its topics.
"""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import InputCounts, State
from shipdrag_ros.display import printable
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.words import conditions
from shipdrag_ros.messages import TOPICS
from shipdrag_ros.messages.topics import AHEAD, ERROR, OF_CONDITIONS, OK, STALE, WARN, Status
from shipdrag_ros.node.background import DiagnosisState, DiagnosisStatus
from shipdrag_ros.node.recorder import RecordingState, RecordingStatus
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


class Recently:
    """The counts of an input over the last `RECENT_S`."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, InputCounts]] = deque()

    def add(self, now_s: float, counts: InputCounts) -> None:
        """
        Take the counts of a moment on a steady clock [s].
        """
        if self._past and (counts == self._past[0][1] or counts.used < self._past[-1][1].used):
            self._past.clear()  # nothing came yet; a new activation counts from 0
        self._past.append((now_s, counts))
        while self._past[0][0] < now_s - RECENT_S:
            self._past.popleft()

    @property
    def seconds(self) -> float:
        """How long that is."""
        return self._past[-1][0] - self._past[0][0] if self._past else 0.0

    @property
    def counts(self) -> InputCounts:
        """What was added over that time."""
        return self._past[-1][1].since(self._past[0][1]) if self._past else InputCounts()

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
    What is known of one input, and what is to be said of it.

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
    rate_hz
        Messages a second of steady time, before the last tick.
    finding
        What is to be said, once it is judged.
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
    total: InputCounts = field(default_factory=InputCounts)
    recent: InputCounts = field(default_factory=InputCounts)
    seconds: float = 0.0
    offset_s: float | None = None
    behind: tuple[str, float] | None = None
    doubt: str = ''
    about: Mapping[str, object] = field(default_factory=dict)
    rate_hz: float = 0.0
    finding: Finding = Finding(OK, '')

    @property
    def fresh(self) -> bool:
        """Whether it was received lately."""
        return self.age_s is not None and self.age_s < SILENT_S

    @property
    def status(self) -> Status:
        """The same for others."""
        values: dict[str, object] = {**self.about, 'rate [Hz]': self.rate_hz}
        values['age [s]'] = self.age_s
        if self.type is not None and not self.stamped:
            values['time'] = 'of arrival: the type holds none'
        if self.total.unstamped:
            values['unstamped'] = self.total.unstamped
        if self.active:
            values['used'] = self.total.used
            values |= {f'rejected {reason}': n for reason, n in self.total.rejected.items()}
            if self.recent.readings:
                values['share used lately [1]'] = self.recent.used / self.recent.readings
        text = self.finding.text
        if 'fed by' in self.about:
            text = f'{text}, from {self.about["fed by"]}'
        return Status.of(f'input {self.name}', self.finding.level, text, values)


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
    share, motion = recent.used / readings, facts.name in ALL_MOTION
    if share >= USED_MIN:
        enough = recent.used >= RATE_MIN_HZ * facts.seconds
        if motion and facts.seconds > 0.5 * RECENT_S and not enough:
            rate = math.floor(100.0 * recent.used / facts.seconds) / 100.0  # never rounded to 0.2
            yield Finding(WARN, f'{rate:g} Hz is too slow, at least 0.2 Hz is needed')
        return
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
        if name in ALL_MOTION and offset is not None and (simulated or offset >= -AHEAD_S)
    }
    first = min(known, key=known.__getitem__, default='')
    return {name: (first, known[name] - known[first]) for name in known if name != first}


_SHOWN = 6  # candidates of an input


class InputStates:
    """Judges the inputs, once a tick."""

    def __init__(self) -> None:
        self._recently: defaultdict[str, Recently] = defaultdict(Recently)

    def tick(
        self, facts: Iterable[InputFacts], *, simulated: bool, now_s: float | None = None
    ) -> tuple[InputFacts, ...]:
        """
        Look at all inputs again.

        Parameters
        ----------
        facts
            Of each input, but for what only all of them or their past show.
        simulated
            Whether the clock is simulated; it then says nothing about that of a sensor.
        now_s
            Steady time [s]; that of this computer by default.
        """
        facts = tuple(facts)
        now_s = time.monotonic() if now_s is None else now_s
        motion = {each.name for each in facts if each.fresh and each.name in ALL_MOTION}
        offsets_s = {each.name: each.offset_s for each in facts if each.fresh}
        behind = behind_others(offsets_s, simulated=simulated)
        states = []
        for each in facts:
            recently = self._recently[each.name]
            recently.add(now_s, each.total)
            judged = replace(
                each,
                needed=each.name in ALL_MOTION and not motion - {each.name},
                recent=recently.counts,
                seconds=recently.seconds,
                offset_s=None if simulated else each.offset_s,
                behind=behind.get(each.name),
                rate_hz=recently.rate_hz,
            )
            states.append(replace(judged, finding=judge(judged)))
        return tuple(states)


@dataclass(frozen=True)
class Standing:
    """
    Where the node stands.

    Attributes
    ----------
    lifecycle
        State of the managed node.
    monitor
        None while not active.
    clock_ns
        The node's clock; 0 under sim time before the first /clock.
    hint
        What to look at where nothing is received.
    candidates
        Which topics may be meant then; '' without any.
    steady_needed_s
        The longest that the ship is to be seen to be steady before an onset.
    compiling_s
        Since when code is being compiled; None where it is.
    waiting
        Messages that wait for it.
    namesakes
        Other nodes of the same full name.
    """

    lifecycle: str
    monitor: Monitor | None
    clock_ns: int
    sim_time: bool
    hint: str = 'is the driver running, in this ROS domain and discovery range?'
    candidates: str = ''
    steady_needed_s: float = 0.0
    compiling_s: float | None = None
    waiting: int = 0
    namesakes: int = 0


def state_status(standing: Standing, inputs: Sequence[InputFacts]) -> Status:
    """
    Say where the node stands, what keeps it from estimating, and whether its name is another's.
    """
    level, text = _state(standing, inputs)
    if standing.namesakes:
        level = max(level, WARN)
        text += (
            f'; {standing.namesakes + 1} nodes have the name of this one, so that their figures '
            'and services are mixed up: end one, or name it with -r __node:=NAME'
        )
    monitor = standing.monitor
    values: dict[str, object] = {
        'lifecycle': standing.lifecycle,
        'monitor': 'none' if monitor is None else monitor.state.value,
        'clock': 'simulated' if standing.sim_time else 'system',
        **({} if monitor is None else monitor.progress.values),
        'longest steady sailing [s]': 0.0 if monitor is None else monitor.steady_lead_s,
    }
    if standing.compiling_s is not None:
        values |= {'compiling [s]': standing.compiling_s, 'messages that wait': standing.waiting}
    if standing.candidates:
        values['candidates'] = standing.candidates
    return Status.of('state', level, text, values)


def _state(standing: Standing, inputs: Sequence[InputFacts]) -> tuple[int, str]:
    if standing.sim_time and standing.clock_ns == 0:
        return ERROR, 'use_sim_time is true but no /clock: messages are not used'
    if standing.monitor is None:
        return WARN, f'{standing.lifecycle}: not estimating'
    if standing.compiling_s is not None:
        return WARN, (
            f'compiling, {standing.compiling_s:.0f} s: no estimates yet, one to three minutes on '
            f'a first start; {standing.waiting} messages are recorded and wait'
        )
    motion = [each for each in inputs if each.name in ALL_MOTION]
    fresh = [each for each in motion if each.fresh]
    if motion and not fresh:
        names = ', '.join(each.name for each in motion)
        hint = standing.candidates or standing.hint
        return ERROR, f'no data: nothing on any of {names}; {hint}'
    # one good input is enough to estimate, but nothing is there to compare it with
    unwell = [each for each in motion if each.age_s is not None and each.finding.level != OK]
    said = '; '.join(f'{each.name}: {each.finding.text}' for each in unwell)
    if fresh and all(each.finding.level == ERROR for each in fresh):
        return ERROR, f'no input can be used: {said}'
    state = standing.monitor.state
    text = state.value
    if state is State.WAITING:
        lead = f'{standing.monitor.steady_lead_s:.0f} of {standing.steady_needed_s:.0f} s'
        text = f'waiting: not enough steady sailing yet to know a coastdown by, {lead}'
    elif state is State.COASTDOWN and not any(
        each.fresh for each in inputs if each.name == 'shaft'
    ):
        text += '; no shaft is received: is the engine stopped, and not astern?'
    return (WARN, f'{text}; not well, {said}') if unwell else (OK, text)


def recording_status(status: RecordingStatus) -> Status:
    """
    Say how the recording stands.
    """
    progress = status.progress
    level = WARN if status.lost or status.slow or status.untidy else OK
    if status.state is RecordingState.FAILED:
        level = ERROR
    values: dict[str, object] = {'state': status.state.value}
    if progress is not None:
        values |= {
            'file': progress.path or 'none',
            'part [1]': progress.part,
            'size [B]': progress.size_bytes,
            'messages': progress.messages,
            'messages in memory only': progress.waiting,
            'longest in memory only [s]': progress.oldest_s,
            'messages lost': status.lost,
            'parts left uncompacted': progress.uncompacted,
        }
        if progress.why_uncompacted:
            values['why left uncompacted'] = progress.why_uncompacted
    values['quota'] = status.kept
    values['memory for a later start'] = 'too small' if status.ring_cut else 'sufficient'
    return Status.of('recording', level, status.text, values)


def estimate_status(estimate: Estimate | None, why_none: str) -> Status:
    """
    Give the latest figures, or say why there are none.

    Parameters
    ----------
    why_none
        Why the coastdown that runs has no estimate, '' where it has one or none runs.
    """
    level = WARN if why_none else OK
    if estimate is None:
        return Status.of('estimate', level, f'none yet: {why_none or "no coastdown so far"}', {})
    low, high = estimate.froude_valid
    now = f'; none now: {why_none}' if why_none else ''
    values: dict[str, object] = {
        'stamp [ns]': estimate.end_ns,
        'speed through water [m/s]': estimate.last_speed_m_s,
        'its standard deviation [m/s]': estimate.last_speed_sigma_m_s,
        'specific resistance [m/s^2]': estimate.last_resistance_m_s2,
        'standard deviation of it [m/s^2]': estimate.last_sigma_m_s2,
        OF_CONDITIONS: conditions(estimate),
        'valid from Froude number [1]': low,
        'valid to Froude number [1]': high,
        'w, largest deviation over largest resistance [1]': estimate.max_relative_sigma,
        **{f'samples of {name} [1]': count for name, count in estimate.samples.items()},
    }
    text = f'{estimate.estimator} over {estimate.duration_s:.0f} s{now}'
    return Status.of('estimate', level, text, values)


def diagnosis_status(status: DiagnosisStatus, ahead: str = '') -> Status:
    """
    Say what is missing in the model by the last coastdown, or why that cannot be said.

    Parameters
    ----------
    status
    ahead
        What the next one would show; '' where that is not known.
    """
    values: dict[str, object] = {'state': status.state.value}
    if ahead:
        values[AHEAD] = ahead
    if status.coastdown is not None:
        values['start of the coastdown [ns]'] = status.coastdown.start_ns
        values['end of the coastdown [ns]'] = status.coastdown.end_ns
    if status.found is not None:
        values['verdict'] = status.found['verdict']
        level = OK if status.found['verdict'] == 'none' and not status.caveat else WARN
        text = ' '.join(filter(None, [status.found['sentence'], status.caveat]))
        return Status.of('diagnosis', level, text, values)
    text = ': '.join(filter(None, [status.state.value, status.reason]))
    if status.state in (DiagnosisState.IMPOSSIBLE, DiagnosisState.FAILED) and status.caveat:
        text = f'{text}. {status.caveat}'
    level = WARN if status.state is DiagnosisState.FAILED else OK
    return Status.of('diagnosis', level, text, values)


def candidates(
    published: Iterable[tuple[str, Sequence[str]]], inputs: Iterable[str], *, taken: Sequence[str]
) -> str:
    """
    Say which topics may be meant, the likeliest first, and how to name one; '' without any.

    Parameters
    ----------
    published
        Topics of the graph and their types.
    inputs
        Those that look for one.
    taken
        Topics that are inputs already.
    """
    there = [(topic, types) for topic, types in published if topic not in taken]
    listed, first = [], ''
    for name in inputs:
        fits = [topic for topic, types in there if set(types) & set(TOPICS[name])]
        if fits:
            fits = [printable(topic) for topic in sorted(fits, key=partial(_unlike, name))]
            listed.append(f'{name}: {", ".join(fits[:_SHOWN])}')
            first = first or f'{name}:={fits[0]}'
    if not listed:
        return ''
    return f'of a type that fits are {"; ".join(listed)}; name one with -r {first}'


def _unlike(name: str, topic: str) -> int:
    """Rank a topic: one that shares words with the input is more likely to be it."""
    return -len(set(name.split('_')) & set(topic.lower().replace('/', '_').split('_')))
