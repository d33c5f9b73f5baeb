# SPDX-License-Identifier: Apache-2.0
"""
What /diagnostics says: where the node stands and why it may be silent.

Each function turns one part of the node into one DiagnosticStatus. A figure has
its unit in its key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from shipdrag_ros.coastdown.events import State
from shipdrag_ros.coastdown.health import MonitorProgress
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.messages.types import is_stamped
from shipdrag_ros.node.diagnosing import DiagnosisState, DiagnosisStatus
from shipdrag_ros.node.health import InputState
from shipdrag_ros.node.judging import Level
from shipdrag_ros.node.recorder import RecordingState, RecordingStatus
from shipdrag_ros.samples import MOTION_INPUTS

if TYPE_CHECKING:
    from shipdrag_ros.diagnosis import (
        DiagnosisResult,  # slow to import, and known once there is one
    )

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE
_SETS_SIZED = 3  # candidates of a set whose sizes are shown


def label(
    statuses: Sequence[DiagnosticStatus], *, node: str, hardware_id: str
) -> list[DiagnosticStatus]:
    """
    Say whose statuses these are, so that two nodes are not mixed up.

    Parameters
    ----------
    node
        Its full name; without the leading slash, as diagnostic_updater has it.
    hardware_id
        The ship.
    """
    for status in statuses:
        status.name = f'{node.lstrip("/")}: {status.name}'
        status.hardware_id = hardware_id
    return list(statuses)


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
    candidates
        Which topics may be meant, where nothing is heard; '' without any.
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
    candidates: str = ''
    steady_lead_s: float = 0.0
    steady_needed_s: float = 0.0
    progress: MonitorProgress | None = None
    compiling_s: float | None = None
    waiting: int = 0
    namesakes: int = 0


def state_status(standing: Standing, inputs: Sequence[InputState]) -> DiagnosticStatus:
    """
    Say where the node stands, what keeps it from estimating, and whether its name is another's.
    """
    status = _state(standing, inputs)
    if standing.namesakes:
        status.level = max(status.level, WARN)
        status.message += (
            f'; {standing.namesakes + 1} nodes have the name of this one, so that their figures '
            'and services are mixed up: end one, or name it with -r __node:=NAME'
        )
    return status


def _state(standing: Standing, inputs: Sequence[InputState]) -> DiagnosticStatus:
    monitor = standing.monitor
    values: dict[str, object] = {
        'lifecycle': standing.lifecycle,
        'monitor': 'none' if monitor is None else monitor.value,
        'clock': 'simulated' if standing.sim_time else 'system',
        **({} if standing.progress is None else standing.progress.values),
    }
    if standing.compiling_s is not None:
        values |= {'compiling [s]': standing.compiling_s, 'messages that wait': standing.waiting}
    if standing.sim_time and standing.clock_ns == 0:
        text = 'use_sim_time is true but no /clock: messages are not used'
        return _status('state', ERROR, text, values)
    if monitor is None:
        return _status('state', WARN, f'{standing.lifecycle}: not estimating', values)
    if standing.compiling_s is not None:
        text = (
            f'compiling, {standing.compiling_s:.0f} s: no estimates yet, one to three minutes on '
            f'a first start; {standing.waiting} messages are recorded and wait'
        )
        return _status('state', WARN, text, values)
    values['longest steady sailing [s]'] = standing.steady_lead_s
    motion = [each for each in inputs if each.topic.name in MOTION_INPUTS]
    fresh = [each for each in motion if each.fresh]
    if motion and not fresh:
        names = ', '.join(each.topic.name for each in motion)
        text = f'no data: nothing on any of {names}'
        if standing.candidates:
            values['candidates'] = standing.candidates
            text = f'{text}; {standing.candidates}'
        else:
            text = f'{text}; is the driver running, in this ROS domain and discovery range?'
        return _status('state', ERROR, text, values)
    if fresh and all(each.finding.level is Level.ERROR for each in fresh):
        why = '; '.join(f'{each.topic.name}: {each.finding.text}' for each in fresh)
        return _status('state', ERROR, f'no input can be used: {why}', values)
    if monitor is State.WAITING:
        text = f'waiting: not enough steady sailing yet to know a coastdown by, {_lead(standing)}'
    else:
        text = monitor.value
    # one good input is enough to estimate, but what it is held against is missing
    unwell = [
        f'{each.topic.name}: {each.finding.text}'
        for each in motion
        if each.topic.age_s is not None and each.finding.level is not Level.OK
    ]
    if unwell:
        return _status('state', WARN, f'{text}; not well, {"; ".join(unwell)}', values)
    return _status('state', OK, text, values)


def _lead(standing: Standing) -> str:
    return f'{standing.steady_lead_s:.0f} of {standing.steady_needed_s:.0f} s'


def input_status(state: InputState) -> DiagnosticStatus:
    """
    Say how one input is doing.
    """
    topic, health = state.topic, state.health
    values: dict[str, object] = {
        'topic': topic.topic if topic.fed is None else topic.fed.input,
        'type': (topic.type if topic.fed is None else topic.fed.type) or 'not yet known',
        **({'fed by': topic.fed_by} if topic.fed_by else {}),
        'publishers': sum(topic.publishers.values()),
        'published by': ', '.join(topic.senders) or 'none',
        'reliability': 'reliable' if topic.reliable else 'best effort',
        'messages': topic.received,
        'messages lost': topic.lost,
        'rate [Hz]': state.rate_hz,
        'age [s]': topic.age_s,
        'clock offset [s]': topic.clock_offset_s,
        'not used, node inactive or without clock': topic.unused,
        **{f'unreadable {reason}': times for reason, times in topic.unreadable.items()},
    }
    if topic.type is not None and not is_stamped(topic.type):
        values['time'] = 'of arrival: the type holds none'
    if topic.unstamped:
        values['unstamped'] = topic.unstamped
    if health is not None:
        values['used'] = health.used
        values |= {f'rejected {reason}': times for reason, times in health.rejected.items()}
        readings = state.recent.used + sum(state.recent.rejected.values())
        if readings:
            values['share used lately [1]'] = state.recent.used / readings
    level = bytes([state.finding.level])
    said = f'{state.finding.text}, from {topic.fed_by}' if topic.fed_by else state.finding.text
    return _status(f'input {topic.name}', level, said, values)


def nmea_status(
    address: str, level: bytes, message: str, values: Mapping[str, object]
) -> DiagnosticStatus:
    """
    Say how one source of NMEA 0183 is doing.
    """
    return _status(f'nmea {address}', level, message, values)


def recording_status(status: RecordingStatus) -> DiagnosticStatus:
    """
    Say how the recording stands.
    """
    progress = status.progress
    level = OK
    if status.state is RecordingState.FAILED:
        level = ERROR
    elif status.lost or status.slow:
        level = WARN
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
    values['quota'] = status.kept
    values['memory for a later start'] = 'too small' if status.ring_cut else 'sufficient'
    return _status('recording', level, status.text, values)


def estimate_status(estimate: Estimate | None, why_none: str) -> DiagnosticStatus:
    """
    Give the latest figures, or say why there are none.

    Parameters
    ----------
    why_none
        Why the coastdown that runs has no estimate, '' where it has one or none runs.
    """
    if estimate is None:
        if why_none:
            return _status('estimate', WARN, f'none yet: {why_none}', {})
        return _status('estimate', OK, 'none yet: no coastdown so far', {})
    low, high = estimate.froude_valid
    return _status(
        'estimate',
        WARN if why_none else OK,
        f'{estimate.estimator} over {estimate.duration_s:.0f} s'
        + (f'; none now: {why_none}' if why_none else ''),
        {
            'stamp [ns]': estimate.end_ns,
            'speed through water [m/s]': estimate.last_speed_m_s,
            'its standard deviation [m/s]': estimate.last_speed_sigma_m_s,
            'specific resistance [m/s^2]': estimate.last_resistance_m_s2,
            'standard deviation of it [m/s^2]': estimate.last_sigma_m_s2,
            'valid from Froude number [1]': low,
            'valid to Froude number [1]': high,
            'w, largest deviation over largest resistance [1]': estimate.max_relative_sigma,
            **{f'samples of {name} [1]': count for name, count in estimate.samples.items()},
        },
    )


def diagnosis_status(status: DiagnosisStatus) -> DiagnosticStatus:
    """
    Say what is missing in the model by the last coastdown, or why that cannot be said.
    """
    values: dict[str, object] = {'state': status.state.value}
    if status.coastdown is not None:
        values |= {
            'start of the coastdown [ns]': status.coastdown.start_ns,
            'end of the coastdown [ns]': status.coastdown.end_ns,
        }
    if status.found is None:
        level = WARN if status.state is DiagnosisState.FAILED else OK
        text = status.state.value
        text = f'{text}: {status.reason}' if status.reason else text
        if status.state in (DiagnosisState.IMPOSSIBLE, DiagnosisState.FAILED) and status.caveat:
            text = f'{text}. {status.caveat}'
        return _status('diagnosis', level, text, values)
    from shipdrag_ros.diagnosis import Verdict, words

    found = status.found
    level = OK if found.verdict is Verdict.NONE and not status.caveat else WARN
    message = ' '.join(filter(None, [words.sentence(found), status.caveat]))
    return _status('diagnosis', level, message, values | _figures(found))


def _figures(found: DiagnosisResult) -> dict[str, object]:
    """Return the figures of a diagnosis."""
    from shipdrag_ros.diagnosis.words import advice
    from shipdrag_ros.inference.decision import NONE, UNKNOWN
    from shipdrag_ros.simulation.effects import LIBRARY

    values: dict[str, object] = {
        'verdict': found.verdict.value,
        'probability that nothing is missing [1]': found.nothing,
        'probability of something without a name [1]': found.unnamed,
    }
    for candidate in found.candidates:
        if candidate.names not in (NONE, UNKNOWN):
            values[f'probability of {" + ".join(candidate.names)} [1]'] = candidate.probability
    sized = [(effect.name, effect) for effect in found.effects]
    if not sized:  # a set: what each would have
        sized = [
            (
                f'if {" + ".join(each.names)}' + (f', {effect.name}' if each.names[1:] else ''),
                effect,
            )
            for each in found.candidates[:_SETS_SIZED]
            for effect in each.effects
        ]
    for before, effect in sized:
        for quantity in LIBRARY[effect.name].parameters:
            size, unit = effect.parameters[quantity.name], quantity.unit or '1'
            name = f'{before}, {quantity.name} [{unit}]'
            values |= {name: size.value, f'standard deviation of {name}': size.sd}
    values['mean square of whitened residuals, before [1]'] = found.before.chi2_per_sample
    if found.after is not None:
        values['mean square of whitened residuals, after [1]'] = found.after.chi2_per_sample
    values |= {f'note {i}': note for i, note in enumerate(found.notes, start=1)}
    return values | {f'advice {i}': line for i, line in enumerate(advice(found), start=1)}


def _status(
    name: str, level: bytes, message: str, values: Mapping[str, object]
) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id='',
        values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()],
    )


def _text(value: object) -> str:
    if value is None:
        return 'none'
    return f'{value:.6g}' if isinstance(value, float) else str(value)
