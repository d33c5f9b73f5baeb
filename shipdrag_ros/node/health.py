# SPDX-License-Identifier: Apache-2.0
"""
How the node is, part by part: the one source for /diagnostics, the log, a terminal and the page.

Each function turns one part into one `Status`. A figure has its unit in its key.
Free of ROS, so that a bag that is played is judged as a node judges its topics.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from shipdrag_ros.coastdown.events import State
from shipdrag_ros.coastdown.health import MonitorProgress
from shipdrag_ros.display import printable
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.words import conditions
from shipdrag_ros.messages import TOPICS
from shipdrag_ros.messages.heard import ERROR, OF_CONDITIONS, OK, WARN, Status
from shipdrag_ros.node.background import DiagnosisState, DiagnosisStatus
from shipdrag_ros.node.judging import Finding, InputFacts, Recently, behind_others, judge
from shipdrag_ros.node.recorder import RecordingState, RecordingStatus
from shipdrag_ros.samples import ALL_MOTION

_SHOWN = 6  # candidates of an input


@dataclass(frozen=True)
class InputState:
    """
    One input, judged.

    Attributes
    ----------
    facts
        What it was judged by.
    finding
        What is to be said.
    rate_hz
        Messages a second of steady time, before the last tick.
    """

    facts: InputFacts
    finding: Finding
    rate_hz: float

    @property
    def name(self) -> str:
        """Of the input."""
        return self.facts.name

    @property
    def fresh(self) -> bool:
        """Whether it was received lately."""
        return self.facts.fresh

    @property
    def status(self) -> Status:
        """The same for others."""
        facts = self.facts
        values: dict[str, object] = {**facts.about, 'rate [Hz]': self.rate_hz}
        values['age [s]'] = facts.age_s
        if facts.type is not None and not facts.stamped:
            values['time'] = 'of arrival: the type holds none'
        if facts.total.unstamped:
            values['unstamped'] = facts.total.unstamped
        if facts.active:
            values['used'] = facts.total.used
            values |= {f'rejected {reason}': n for reason, n in facts.total.rejected.items()}
            if facts.recent.readings:
                values['share used lately [1]'] = facts.recent.used / facts.recent.readings
        text = self.finding.text
        if 'fed by' in facts.about:
            text = f'{text}, from {facts.about["fed by"]}'
        return Status.of(f'input {facts.name}', self.finding.level, text, values)


class InputStates:
    """Judges the inputs, once a tick."""

    def __init__(self) -> None:
        self._recently: defaultdict[str, Recently] = defaultdict(Recently)

    def tick(
        self, facts: Iterable[InputFacts], *, simulated: bool, now_s: float | None = None
    ) -> tuple[InputState, ...]:
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
            )
            states.append(InputState(judged, judge(judged), recently.rate_hz))
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
        State of the monitor, None while not active.
    clock_ns
        The node's clock; 0 under sim time before the first /clock.
    hint
        What to look at where nothing is received.
    candidates
        Which topics may be meant then; '' without any.
    steady_lead_s, steady_needed_s
        The longest that the ship was seen to be steady, and what an onset needs.
    progress
        How far the monitor is by now, None while not active.
    compiling_s
        Since when code is being compiled; None where it is.
    waiting
        Messages that wait for it.
    namesakes
        Other nodes of the same full name.
    """

    lifecycle: str
    monitor: State | None
    clock_ns: int
    sim_time: bool
    hint: str = 'is the driver running, in this ROS domain and discovery range?'
    candidates: str = ''
    steady_lead_s: float = 0.0
    steady_needed_s: float = 0.0
    progress: MonitorProgress | None = None
    compiling_s: float | None = None
    waiting: int = 0
    namesakes: int = 0


def state_status(standing: Standing, inputs: Sequence[InputState]) -> Status:
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
    values: dict[str, object] = {
        'lifecycle': standing.lifecycle,
        'monitor': 'none' if standing.monitor is None else standing.monitor.value,
        'clock': 'simulated' if standing.sim_time else 'system',
        **({} if standing.progress is None else standing.progress.values),
        'longest steady sailing [s]': standing.steady_lead_s,
    }
    if standing.compiling_s is not None:
        values |= {'compiling [s]': standing.compiling_s, 'messages that wait': standing.waiting}
    if standing.candidates:
        values['candidates'] = standing.candidates
    return Status.of('state', level, text, values)


def _state(standing: Standing, inputs: Sequence[InputState]) -> tuple[int, str]:
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
    unwell = [each for each in motion if each.facts.age_s is not None and each.finding.level != OK]
    said = '; '.join(f'{each.name}: {each.finding.text}' for each in unwell)
    if fresh and all(each.finding.level == ERROR for each in fresh):
        return ERROR, f'no input can be used: {said}'
    text = standing.monitor.value
    if standing.monitor is State.WAITING:
        lead = f'{standing.steady_lead_s:.0f} of {standing.steady_needed_s:.0f} s'
        text = f'waiting: not enough steady sailing yet to know a coastdown by, {lead}'
    elif standing.monitor is State.COASTDOWN and not any(
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


def diagnosis_status(status: DiagnosisStatus) -> Status:
    """
    Say what is missing in the model by the last coastdown, or why that cannot be said.
    """
    values: dict[str, object] = {'state': status.state.value}
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
) -> dict[str, list[str]]:
    """
    Return the topics whose type an input accepts, by input, the likeliest first.

    Parameters
    ----------
    published
        Topics of the graph and their types.
    inputs
        Those that look for one.
    taken
        Topics that are inputs already.
    """
    found: dict[str, list[str]] = {}
    there = [(topic, types) for topic, types in published if topic not in taken]
    for name in inputs:
        fits = [topic for topic, types in there if set(types) & set(TOPICS[name])]
        if fits:
            found[name] = sorted(fits, key=partial(_unlike, name))[:_SHOWN]
    return found


def _unlike(name: str, topic: str) -> int:
    """Rank a topic: one that shares words with the input is more likely to be it."""
    return -len(set(name.split('_')) & set(topic.lower().replace('/', '_').split('_')))


def candidates_text(found: Mapping[str, Sequence[str]]) -> str:
    """
    Say which topics may be meant, and how to name one; '' without any.
    """
    if not found:
        return ''
    listed = '; '.join(f'{name}: {printable(", ".join(topics))}' for name, topics in found.items())
    name, topics = next(iter(found.items()))
    return f'of a type that fits are {listed}; name one with -r {name}:={printable(topics[0])}'
