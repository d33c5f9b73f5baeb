# SPDX-License-Identifier: Apache-2.0
"""
Events of the monitor to the messages that the node publishes.

The node and replay both encode here, so that what was published and what is
replayed can be compared byte by byte.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from shipdrag_ros.coastdown.events import (
    EndedCoastdown,
    Event,
    NoEstimate,
    NotCoastdown,
    Onset,
    Reset,
    Update,
    WholeGlide,
)
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.forecast.path import PathAhead
from shipdrag_ros.forecast.result import Forecast
from shipdrag_ros.messages import types
from shipdrag_ros.messages.encoding import covariance6, vector3
from shipdrag_ros.messages.topics import (
    DEFAULT_NODE,
    DIAGNOSIS,
    EVENTS,
    FORECAST,
    FORECAST_PATH,
    RESISTANCE,
    RESISTANCE_CURVE,
    SPEED,
    OutputTopic,
)
from shipdrag_ros.samples import Float64

FRAME = 'base_link'
PLANE = 'position'
"""Frame of `~/forecast_path`: metres as `position` sends them, or east and north of its first."""
CURVE_FIELDS = ('speed', 'resistance', 'sigma', 'froude')
FORECAST_FIELDS = (
    'time',
    'speed',
    'speed_low',
    'speed_high',
    'distance',
    'distance_low',
    'distance_high',
)
_FLOAT64_BYTES = 8


@dataclass(frozen=True)
class OutputMessage:
    """A message of the node, ready to be published and recorded."""

    topic: str
    type: str
    payload: bytes
    stamp_ns: int


class EventKind(Enum):
    """What a message on `~/events` reports."""

    ONSET = 'onset'
    COASTDOWN = 'coastdown'
    NO_ESTIMATE = 'no_estimate'
    DISMISSED = 'dismissed'  # nearly a coastdown, or a part of one that was cut
    RESET = 'reset'  # done, whatever the cause
    RESET_REQUEST = 'reset_request'  # asked for from outside: an input of replay
    SILENCE = 'silence'  # by the clock, which no sample shows: an input of replay
    ENGINE_STOPPED = 'engine_stopped'  # a person says so: an input of replay
    LIFECYCLE = 'lifecycle'
    CLOCK_JUMP = 'clock_jump'
    FILES = 'files'  # recordings removed
    MESSAGE_LOST = 'message_lost'  # sent, and not received
    SOURCE = 'source'  # an input is fed by another

    @property
    def is_warning(self) -> bool:
        """Whether an operator should look at it."""
        return self in (
            EventKind.NO_ESTIMATE,
            EventKind.RESET,
            EventKind.CLOCK_JUMP,
            EventKind.FILES,
            EventKind.MESSAGE_LOST,
            EventKind.SOURCE,
            EventKind.SILENCE,
        )


@dataclass(frozen=True)
class EventNote:
    """
    The content of a message on `~/events`.

    `values` are texts by name, the unit at the end of the name.
    """

    kind: EventKind
    stamp_ns: int
    text: str
    values: Mapping[str, str]


def diagnosis_message(text: str, stamp_ns: int, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode the document of a diagnosis.

    Parameters
    ----------
    text
        JSON.
    stamp_ns
        End of the coastdown; the message itself holds no time [ns].
    """
    payload = types.serialize(DIAGNOSIS.type, types.make(DIAGNOSIS.type, data=text))
    return OutputMessage(DIAGNOSIS.under(node), DIAGNOSIS.type, payload, stamp_ns)


def outputs(event: Event, *, node: str = DEFAULT_NODE) -> list[OutputMessage]:
    """
    Encode an event of the monitor, in the order to publish.

    Parameters
    ----------
    event
        What the monitor reported.
    node
        Full name of the node, the `~` of its topics.
    """
    match event:
        case Update(stamp_ns, estimate, forecast, path):
            return [
                *_figures(stamp_ns, estimate, node),
                _forecast(stamp_ns, forecast, node),
                _path(stamp_ns, path, node),
            ]
        case EndedCoastdown():
            curve = [] if event.estimate is None else [_curve(event.end_ns, event.estimate, node)]
            told = event_message(_coastdown_note(event), node=node)
            return [*curve, *_withdrawn(event.end_ns, node), told]
        case Onset(start_ns, detected_ns):
            note = EventNote(
                EventKind.ONSET,
                detected_ns,
                'a coastdown has begun',
                {'start_ns': str(start_ns)},
            )
        case NoEstimate(stamp_ns, reason):
            note = EventNote(EventKind.NO_ESTIMATE, stamp_ns, reason, {})
        case NotCoastdown(start_ns, end_ns, dismissal, text):
            note = EventNote(
                EventKind.DISMISSED,
                end_ns,
                f'nearly a coastdown: {text}',
                {
                    'start_ns': str(start_ns),
                    'end_ns': str(end_ns),
                    'reason': dismissal.value,
                },
            )
        case WholeGlide():  # for a diagnosis of the record alone
            return []
        case Reset(receive_ns, reason):
            note = EventNote(EventKind.RESET, receive_ns, reason, {})
    return [event_message(note, node=node)]


def reset_request(receive_ns: int, reason: str, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode that a reset was asked for, so that replay resets there too.

    To be recorded before the reset is done, at log time `receive_ns`. Resets
    that the monitor decides by itself need none: the samples bring them about.
    """
    return event_message(EventNote(EventKind.RESET_REQUEST, receive_ns, reason, {}), node=node)


def silence_mark(receive_ns: int, reason: str, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode that all sources are silent, so that replay ends a coastdown there too.

    To be recorded before the coastdown is ended, at log time `receive_ns`.
    """
    return event_message(EventNote(EventKind.SILENCE, receive_ns, reason, {}), node=node)


def stop_mark(receive_ns: int, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode that a person said that the engine was stopped just then, so that replay takes it too.

    To be recorded before the monitor takes it, at log time `receive_ns`.
    """
    note = EventNote(EventKind.ENGINE_STOPPED, receive_ns, 'the engine was stopped', {})
    return event_message(note, node=node)


def event_message(note: EventNote, *, node: str = DEFAULT_NODE) -> OutputMessage:
    """
    Encode a note for `~/events`.
    """
    status = types.class_of('diagnostic_msgs/msg/DiagnosticStatus')
    message = types.make(
        EVENTS.type,
        header=types.header(note.stamp_ns, ''),
        status=[
            status(
                level=status.WARN if note.kind.is_warning else status.OK,
                name=note.kind.value,
                message=note.text,
                hardware_id='',
                values=[
                    types.make('diagnostic_msgs/msg/KeyValue', key=key, value=value)
                    for key, value in note.values.items()
                ],
            )
        ],
    )
    return _message(EVENTS, message, note.stamp_ns, node)


def read_event(payload: bytes) -> EventNote:
    """
    Decode a message of `~/events`.

    Raises
    ------
    MalformedMessage
        If it is none of this package's.
    """
    message = types.deserialize(EVENTS.type, payload)
    try:
        (status,) = message.status
        kind = EventKind(status.name)
    except ValueError as error:
        raise types.MalformedMessage(f'not an event of the node: {error}') from error
    values = {item.key: item.value for item in status.values}
    return EventNote(kind, types.stamp_ns(message), status.message, values)


def _figures(stamp_ns: int, estimate: Estimate, node: str) -> list[OutputMessage]:
    """Speed, resistance and the curve of one estimate."""
    still = vector3(0.0, 0.0)
    speed = types.make(
        SPEED.type,
        header=types.header(stamp_ns, FRAME),
        twist=types.make(
            'geometry_msgs/msg/TwistWithCovariance',
            twist=types.make(
                'geometry_msgs/msg/Twist',
                linear=vector3(float(estimate.last_speed_m_s), 0.0),
                angular=still,
            ),
            covariance=covariance6(float(estimate.last_speed_sigma_m_s) ** 2),
        ),
    )
    resistance = types.make(
        RESISTANCE.type,
        header=types.header(stamp_ns, FRAME),
        accel=types.make(
            'geometry_msgs/msg/AccelWithCovariance',
            accel=types.make(
                'geometry_msgs/msg/Accel',
                linear=vector3(float(estimate.last_resistance_m_s2), 0.0),
                angular=still,
            ),
            covariance=covariance6(float(estimate.last_sigma_m_s2) ** 2),
        ),
    )
    return [
        _message(SPEED, speed, stamp_ns, node),
        _message(RESISTANCE, resistance, stamp_ns, node),
        _curve(stamp_ns, estimate, node),
    ]


def _curve(stamp_ns: int, estimate: Estimate, node: str) -> OutputMessage:
    """Return r(v) inside the valid range, one point a speed."""
    curve = estimate.valid_curve
    points = np.column_stack(
        [curve.speed_m_s, curve.resistance_m_s2, curve.sigma_m_s2, curve.froude]
    )
    return _cloud(RESISTANCE_CURVE, CURVE_FIELDS, points, stamp_ns, node)


def _forecast(stamp_ns: int, forecast: Forecast | None, node: str) -> OutputMessage:
    """Return the rest of the glide, one point a time; none where it is withdrawn."""
    points = np.empty((0, len(FORECAST_FIELDS))) if forecast is None else forecast.in_time()
    return _cloud(FORECAST, FORECAST_FIELDS, points, stamp_ns, node)


def _withdrawn(stamp_ns: int, node: str) -> list[OutputMessage]:
    return [_forecast(stamp_ns, None, node), _path(stamp_ns, None, node)]


def _path(stamp_ns: int, path: PathAhead | None, node: str) -> OutputMessage:
    """Return the positions to come, each with the time at which she is there."""
    poses = []
    if path is not None:
        half = 0.5 * path.course_rad
        ahead = types.make(
            'geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)
        )
        for time_ns, (x, y) in zip(path.time_ns, path.position_m, strict=True):
            place = types.make('geometry_msgs/msg/Point', x=float(x), y=float(y), z=0.0)
            pose = types.make('geometry_msgs/msg/Pose', position=place, orientation=ahead)
            head = types.header(int(time_ns), PLANE)
            poses.append(types.make(types.POSE, header=head, pose=pose))
    message = types.make(FORECAST_PATH.type, header=types.header(stamp_ns, PLANE), poses=poses)
    return _message(FORECAST_PATH, message, stamp_ns, node)


def _cloud(
    topic: OutputTopic, names: Sequence[str], values: Float64, stamp_ns: int, node: str
) -> OutputMessage:
    """Return points (n, k) with their k fields."""
    points = values.astype('<f8')
    field = types.class_of('sensor_msgs/msg/PointField')
    point_step = _FLOAT64_BYTES * len(names)
    cloud = types.make(
        topic.type,
        header=types.header(stamp_ns, FRAME),
        height=1,
        width=len(points),
        fields=[
            field(name=name, offset=_FLOAT64_BYTES * index, datatype=field.FLOAT64, count=1)
            for index, name in enumerate(names)
        ],
        is_bigendian=False,
        point_step=point_step,
        row_step=point_step * len(points),
        data=np.frombuffer(points.tobytes(), np.uint8),
        is_dense=True,
    )
    return _message(topic, cloud, stamp_ns, node)


def _coastdown_note(event: EndedCoastdown) -> EventNote:
    values = {
        'start_ns': str(event.start_ns),
        'end_ns': str(event.end_ns),
        'ended_by': event.ended_by.value,
    }
    if event.onset_detected_ns is not None:
        values['onset_detected_ns'] = str(event.onset_detected_ns)
    if event.heading_rad is not None:
        values['heading_rad'] = repr(float(event.heading_rad))
    text = f'a coastdown has ended: {event.ended_by.value}'
    if event.estimate is None:
        text += f'; no estimate: {event.failure}'
    else:
        values['estimator'] = event.estimate.estimator
        low, high = event.estimate.froude_valid
        values['froude_min'] = repr(float(low))
        values['froude_max'] = repr(float(high))
    return EventNote(EventKind.COASTDOWN, event.end_ns, text, values)


def _message(topic: OutputTopic, message: object, stamp_ns: int, node: str) -> OutputMessage:
    return OutputMessage(
        topic.under(node), topic.type, types.serialize(topic.type, message), stamp_ns
    )
