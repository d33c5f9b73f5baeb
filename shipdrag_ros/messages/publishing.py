# SPDX-License-Identifier: Apache-2.0
"""
Events of the monitor to the messages that the node publishes.

The node and replay both encode here, so that what was published and what is
replayed can be compared byte by byte.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shipdrag_ros.coastdown import events
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.forecast.result import Forecast, PathAhead
from shipdrag_ros.messages import topics, types
from shipdrag_ros.messages.topics import EventKind, EventNote
from shipdrag_ros.samples import Float64

FRAME = 'base_link'
PLANE = 'position'
"""Frame of `~/forecast_path`: metres as `position` sends them, or east and north of its first."""
CURVE_FIELDS = ('speed', 'resistance', 'sigma', 'froude')
FORECAST_FIELDS: tuple[str, ...] = ('time', 'speed', 'speed_low', 'speed_high')
FORECAST_FIELDS += ('distance', 'distance_low', 'distance_high')
_FLOAT64_BYTES = 8


def outputs(event: events.Event, *, node: str = topics.DEFAULT_NODE) -> list[topics.OutputMessage]:
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
        case events.Update(stamp_ns, estimate, forecast, path):
            return [
                *_figures(stamp_ns, estimate, node),
                _forecast(stamp_ns, forecast, node),
                _path(stamp_ns, path, node),
            ]
        case events.EndedCoastdown():
            curve = [] if event.estimate is None else [_curve(event.end_ns, event.estimate, node)]
            told = topics.event_message(_coastdown_note(event), node=node)
            return [*curve, *_withdrawn(event.end_ns, node), told]
        case events.Onset(start_ns, detected_ns):
            values = {'start_ns': str(start_ns)}
            note = EventNote(EventKind.ONSET, detected_ns, 'a coastdown has begun', values)
        case events.NoEstimate(stamp_ns, reason):
            note = EventNote(EventKind.NO_ESTIMATE, stamp_ns, reason, {})
        case events.NotCoastdown(start_ns, end_ns, dismissal, text):
            values = {'start_ns': str(start_ns), 'end_ns': str(end_ns), 'reason': dismissal.value}
            note = EventNote(EventKind.DISMISSED, end_ns, f'nearly a coastdown: {text}', values)
        case events.WholeGlide():  # for a diagnosis of the record alone
            return []
        case events.Reset(receive_ns, reason):
            note = EventNote(EventKind.RESET, receive_ns, reason, {})
    return [topics.event_message(note, node=node)]


def _figures(stamp_ns: int, estimate: Estimate, node: str) -> list[topics.OutputMessage]:
    """Speed, resistance and the curve of one estimate."""
    speed = estimate.last_speed_m_s, estimate.last_speed_sigma_m_s
    resistance = estimate.last_resistance_m_s2, estimate.last_sigma_m_s2
    return [
        _figure(topics.SPEED, 'twist', speed, stamp_ns, node),
        _figure(topics.RESISTANCE, 'accel', resistance, stamp_ns, node),
        _curve(stamp_ns, estimate, node),
    ]


def _figure(
    topic: topics.OutputTopic, part: str, figure: tuple[float, float], stamp_ns: int, node: str
) -> topics.OutputMessage:
    """Return a figure and its sigma as the part of a message that has a covariance."""
    value, sigma = figure
    fields = {
        'header': types.header(stamp_ns, FRAME),
        f'{part}.{part}.linear.x': float(value),
        f'{part}.covariance[0]': float(sigma) ** 2,
    }
    return topics.output_message(topic, types.make(topic.type, fields), stamp_ns, node)


def _curve(stamp_ns: int, estimate: Estimate, node: str) -> topics.OutputMessage:
    """Return r(v) inside the valid range, one point a speed."""
    curve = estimate.valid_curve
    points = np.column_stack(
        [curve.speed_m_s, curve.resistance_m_s2, curve.sigma_m_s2, curve.froude]
    )
    return _cloud(topics.RESISTANCE_CURVE, CURVE_FIELDS, points, stamp_ns, node)


def _forecast(stamp_ns: int, forecast: Forecast | None, node: str) -> topics.OutputMessage:
    """Return the rest of the glide, one point a time; none where it is withdrawn."""
    points = np.empty((0, len(FORECAST_FIELDS))) if forecast is None else forecast.in_time()
    return _cloud(topics.FORECAST, FORECAST_FIELDS, points, stamp_ns, node)


def _withdrawn(stamp_ns: int, node: str) -> list[topics.OutputMessage]:
    return [_forecast(stamp_ns, None, node), _path(stamp_ns, None, node)]


def _path(stamp_ns: int, path: PathAhead | None, node: str) -> topics.OutputMessage:
    """Return the positions to come, each with the time at which she is there."""
    poses = []
    if path is not None:
        half = 0.5 * path.course_rad
        for time_ns, (x, y) in zip(path.time_ns, path.position_m, strict=True):
            pose = {
                'header': types.header(int(time_ns), PLANE),
                'pose.position.x': float(x),
                'pose.position.y': float(y),
                'pose.orientation.z': math.sin(half),
                'pose.orientation.w': math.cos(half),
            }
            poses.append(types.make(types.POSE, pose))
    message = types.make(
        topics.FORECAST_PATH.type, header=types.header(stamp_ns, PLANE), poses=poses
    )
    return topics.output_message(topics.FORECAST_PATH, message, stamp_ns, node)


def _cloud(
    topic: topics.OutputTopic, names: Sequence[str], values: Float64, stamp_ns: int, node: str
) -> topics.OutputMessage:
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
    return topics.output_message(topic, cloud, stamp_ns, node)


def _coastdown_note(event: events.EndedCoastdown) -> EventNote:
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
