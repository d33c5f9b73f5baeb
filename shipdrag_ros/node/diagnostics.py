# SPDX-License-Identifier: Apache-2.0
"""
What /diagnostics says: where the node stands and why it may be silent.

Each function turns one part of the node into one DiagnosticStatus. A figure has
its unit in its key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from shipdrag_ros.coastdown import InputHealth
from shipdrag_ros.coastdown.health import Progress
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.node.diagnosing import DiagnosisState, DiagnosisStatus
from shipdrag_ros.node.inputs import InputTopic
from shipdrag_ros.node.recorder import RecordingState, RecordingStatus
from shipdrag_ros.samples import MOTION_INPUTS

if TYPE_CHECKING:
    from shipdrag_ros.diagnosis import Diagnosis  # slow to import, and known once there is one

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE

SILENT_S = 10.0  # an input heard before and silent for longer is stale


def state_status(
    lifecycle: str,
    monitor: str | None,
    inputs: Sequence[InputTopic],
    *,
    clock_ns: int,
    sim_time: bool,
) -> DiagnosticStatus:
    """
    Say where the node stands, and what keeps it from estimating.

    Parameters
    ----------
    lifecycle
        State of the managed node.
    monitor
        State of the monitor, None while not active.
    clock_ns
        The node's clock; 0 under sim time before the first /clock.
    """
    values = {
        'lifecycle': lifecycle,
        'monitor': monitor or 'none',
        'clock': 'simulated' if sim_time else 'system',
    }
    motion = [topic for topic in inputs if topic.name in MOTION_INPUTS]
    if sim_time and clock_ns == 0:
        return _status(
            'state', ERROR, 'use_sim_time is true but no /clock: messages are not used', values
        )
    if monitor is None:
        return _status('state', WARN, f'{lifecycle}: not estimating', values)
    if not any(topic.age_s is not None and topic.age_s < SILENT_S for topic in motion):
        names = ', '.join(topic.name for topic in motion)
        return _status('state', ERROR, f'no data: nothing on any of {names}', values)
    return _status('state', OK, monitor, values)


def progress_values(progress: Progress) -> list[KeyValue]:
    """
    Say how far the monitor is, for the status of the state.
    """
    return [KeyValue(key=key, value=text) for key, text in progress.values.items()]


def input_status(topic: InputTopic, health: InputHealth | None) -> DiagnosticStatus:
    """
    Say how one input is doing; there is no health while the node is not active.
    """
    level, message = _input_health(topic)
    values: dict[str, object] = {
        'topic': topic.topic,
        'type': topic.type or 'not yet known',
        'publishers': sum(topic.publishers.values()),
        'messages': topic.received,
        'rate [Hz]': topic.rate_hz,
        'age [s]': topic.age_s,
        'clock offset [s]': None if health is None else health.clock_offset_s,
        'not used, node inactive or without clock': topic.unused,
        **{f'unreadable {reason}': times for reason, times in topic.unreadable.items()},
    }
    if health is not None:
        values['used'] = health.used
        values |= {f'rejected {reason}': times for reason, times in health.rejected.items()}
    return _status(f'input {topic.name}', level, message, values)


def _input_health(topic: InputTopic) -> tuple[bytes, str]:
    others = ', '.join(topic.other_types)
    if topic.type is None and others:
        accepted = ', '.join(topic.accepted)
        return ERROR, f'wrong type: {others} is published, accepted are {accepted}'
    if topic.type is None:
        return OK, 'no publisher'
    if others:
        return WARN, f'wrong type: also published as {others}, heard is only {topic.type}'
    if topic.incompatible_qos is not None:
        return WARN, f'a publisher is not heard: its {topic.incompatible_qos} QoS does not fit'
    if topic.age_s is None:
        return WARN, 'no data'
    if topic.age_s > SILENT_S:
        return STALE, f'no data for {topic.age_s:.0f} s'
    return OK, 'receiving'


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
    values['memory for a later start'] = 'too small' if status.ring_cut else 'sufficient'
    return _status('recording', level, status.text, values)


def estimate_status(estimate: Estimate | None) -> DiagnosticStatus:
    """
    Give the latest figures.
    """
    if estimate is None:
        return _status('estimate', OK, 'none yet', {})
    low, high = estimate.froude_valid
    return _status(
        'estimate',
        OK,
        f'{estimate.estimator} over {estimate.duration_s:.0f} s',
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
        return _status(
            'diagnosis', level, f'{text}: {status.reason}' if status.reason else text, values
        )
    from shipdrag_ros.diagnosis import Verdict, words

    found = status.found
    level = OK if found.verdict is Verdict.NONE else WARN
    return _status('diagnosis', level, words.sentence(found), values | _figures(found))


def _figures(found: Diagnosis) -> dict[str, object]:
    """Return the figures of a diagnosis."""
    from shipdrag_ros.diagnosis.words import advice
    from shipdrag_ros.simulation.effects import LIBRARY

    values: dict[str, object] = {
        'verdict': found.verdict.value,
        'probability that nothing is missing [1]': found.nothing,
        'probability of something without a name [1]': found.unnamed,
    }
    for candidate in found.candidates:
        if candidate.names:
            values[f'probability of {" + ".join(candidate.names)} [1]'] = candidate.probability
    for effect in found.effects:
        for quantity in LIBRARY[effect.name].parameters:
            size, unit = effect.parameters[quantity.name], quantity.unit or '1'
            values[f'{effect.name}, {quantity.name} [{unit}]'] = size.value
            values[f'standard deviation of {effect.name}, {quantity.name} [{unit}]'] = size.sd
    values['mean square of whitened residuals, before [1]'] = found.before.chi2_per_sample
    if found.after is not None:
        values['mean square of whitened residuals, after [1]'] = found.after.chi2_per_sample
    return values | {f'advice {i}': line for i, line in enumerate(advice(found), start=1)}


def _status(
    name: str, level: bytes, message: str, values: Mapping[str, object]
) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=level,
        name=f'coastdown_node: {name}',
        message=message,
        hardware_id='',
        values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()],
    )


def _text(value: object) -> str:
    if value is None:
        return 'none'
    return f'{value:.6g}' if isinstance(value, float) else str(value)
