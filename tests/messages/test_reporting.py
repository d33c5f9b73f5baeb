# SPDX-License-Identifier: Apache-2.0
"""What the node publishes, read back by the reference library."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedBy,
    EndedCoastdown,
    NoEstimate,
    NotCoastdown,
    Onset,
    Reset,
    Update,
)
from shipdrag_ros.estimation.result import Estimate, FroudeMax, ResistanceCurve
from shipdrag_ros.forecast.foretell import foretell
from shipdrag_ros.forecast.result import PathAhead
from shipdrag_ros.messages import EventKind, EventNote, MalformedMessage, event_message, read_event
from shipdrag_ros.messages.publishing import outputs
from shipdrag_ros.ship import Ship
from tests.messages.conftest import reference

STAMP_NS = 1_700_000_000_000_000_001


@pytest.fixture
def estimate() -> Estimate:
    speed = np.linspace(1.0, 8.0, 15)
    curve = ResistanceCurve(
        speed,
        1e-3 * speed**2,
        1e-4 * speed,
        5e-5 * speed,
        speed / 38.0,
        2e-3 * speed,
        1e-4 * speed,
        np.zeros_like(speed),
    )
    return Estimate(
        estimator='s1_joint',
        start_ns=STAMP_NS - 10**12,
        end_ns=STAMP_NS,
        order=6,
        orders=(),
        samples={},
        noise_sd={},
        calm=curve,
        conditions=curve,
        whole=curve,
        froude_valid=(0.05, 0.15),
        froude_max_by=FroudeMax.BRANCH_TOP,
        froude_max_argmax=0.2,
        max_relative_sigma=0.01,
        last_speed_m_s=1.25,
        last_speed_sigma_m_s=0.5,
        last_resistance_m_s2=2e-3,
        last_sigma_m_s2=1e-4,
        tracks={},
    )


def test_an_update_is_speed_resistance_and_curve(estimate: Estimate) -> None:
    speed, resistance, curve, *_ = outputs(Update(STAMP_NS, estimate))
    assert [m.topic for m in (speed, resistance, curve)] == [
        '/coastdown_node/speed',
        '/coastdown_node/resistance',
        '/coastdown_node/resistance_curve',
    ]
    assert {m.stamp_ns for m in (speed, resistance, curve)} == {STAMP_NS}
    twist = reference.deserialize(speed.type, speed.payload)
    assert twist.header.frame_id == 'base_link'
    assert twist.twist.twist.linear.x == 1.25
    assert twist.twist.covariance[0] == 0.25
    accel = reference.deserialize(resistance.type, resistance.payload)
    assert (accel.header.stamp.sec, accel.header.stamp.nanosec) == (1_700_000_000, 1)
    assert accel.accel.accel.linear.x == 2e-3
    assert accel.accel.covariance[0] == pytest.approx(1e-8, rel=1e-15)
    cloud = reference.deserialize(curve.type, curve.payload)
    valid = estimate.valid_curve
    assert 0 < len(valid) < len(estimate.curve)
    assert (cloud.height, cloud.width) == (1, len(valid))
    assert (cloud.point_step, cloud.row_step) == (32, 32 * len(valid))
    assert (cloud.is_dense, cloud.is_bigendian) == (True, False)
    assert [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields] == [
        ('speed', 0, 8, 1),
        ('resistance', 8, 8, 1),
        ('sigma', 16, 8, 1),
        ('froude', 24, 8, 1),
    ]
    points = cloud.data.view('<f8').reshape(-1, 4)
    np.testing.assert_array_equal(points[:, 0], valid.speed_m_s)
    np.testing.assert_array_equal(points[:, 1], valid.resistance_m_s2)
    np.testing.assert_array_equal(points[:, 2], valid.sigma_m_s2)
    np.testing.assert_array_equal(points[:, 3], valid.froude)


def test_rclpy_reads_what_is_published(estimate: Estimate) -> None:
    serialization = pytest.importorskip('rclpy.serialization')
    events = [Update(STAMP_NS, estimate), EndedCoastdown(1, 2, 3, EndedBy.TURN, estimate)]
    for message in [message for event in events for message in outputs(event)]:
        package, _, name = message.type.split('/')
        kind = getattr(importlib.import_module(f'{package}.msg'), name)
        read = serialization.deserialize_message(message.payload, kind)
        stamp = read.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == message.stamp_ns
        if name == 'PointCloud2' and message.topic.endswith('curve'):
            assert len(read.data) == read.row_step == 32 * read.width > 0
        if name == 'DiagnosticArray':
            assert read.status[0].level == b'\0'
            assert {item.key for item in read.status[0].values} > {'start_ns', 'ended_by'}
        if name == 'AccelWithCovarianceStamped':
            assert read.accel.accel.linear.x == estimate.last_resistance_m_s2


def test_the_node_name_is_that_given(estimate: Estimate) -> None:
    topics = {m.topic for m in outputs(Update(STAMP_NS, estimate), node='/mv/drag')}
    names = ('speed', 'resistance', 'resistance_curve', 'forecast', 'forecast_path')
    assert topics == {f'/mv/drag/{name}' for name in names}


def test_a_coastdown_gives_its_curve_and_an_event(estimate: Estimate) -> None:
    event = EndedCoastdown(1, STAMP_NS, 3, EndedBy.TURN, estimate, heading_rad=0.5)
    curve, forecast, path, note = outputs(event)
    assert curve.topic.endswith('/resistance_curve')
    assert [each.topic for each in (forecast, path)] == [
        '/coastdown_node/forecast',
        '/coastdown_node/forecast_path',
    ]
    assert curve.stamp_ns == STAMP_NS
    read = read_event(note.payload)
    assert read.kind is EventKind.COASTDOWN
    assert read.values == {
        'start_ns': '1',
        'end_ns': str(STAMP_NS),
        'ended_by': 'turn',
        'onset_detected_ns': '3',
        'heading_rad': '0.5',
        'estimator': 's1_joint',
        'froude_min': '0.05',
        'froude_max': '0.15',
    }


def test_a_forecast_and_its_path(estimate: Estimate) -> None:
    forecast = foretell(estimate, Ship.example())
    ahead = forecast.in_time()
    places = np.column_stack([3.0 * ahead[:, 4], 4.0 * ahead[:, 4]]) / 5.0
    stamps = STAMP_NS + np.round(1e9 * ahead[:, 0]).astype(np.int64)
    path = PathAhead(stamps, places, float(np.arctan2(4.0, 3.0)))
    *_, rest, where = outputs(Update(STAMP_NS, estimate, forecast, path))
    cloud = reference.deserialize(rest.type, rest.payload)
    assert [each.name for each in cloud.fields] == [
        'time',
        'speed',
        'speed_low',
        'speed_high',
        'distance',
        'distance_low',
        'distance_high',
    ]
    assert cloud.row_step == 56 * len(ahead) == len(cloud.data)
    np.testing.assert_array_equal(cloud.data.view('<f8').reshape(-1, 7), ahead)
    read = reference.deserialize(where.type, where.payload)
    last = read.poses[-1]
    assert (last.pose.position.x, last.pose.position.y) == tuple(places[-1])
    stamp = last.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == stamps[-1]
    assert last.pose.orientation.z == pytest.approx(np.sin(0.5 * path.course_rad))


def test_a_forecast_is_withdrawn_when_the_coastdown_ends(estimate: Estimate) -> None:
    for event in (
        Update(STAMP_NS, estimate),  # nothing is left to foretell
        EndedCoastdown(1, STAMP_NS, 3, EndedBy.ENGINE, estimate),
        EndedCoastdown(1, STAMP_NS, 3, EndedBy.RESET, None, failure='reset'),
    ):
        found = {each.topic.rpartition('/')[2]: each for each in outputs(event)}
        rest, where = found['forecast'], found['forecast_path']
        assert reference.deserialize(rest.type, rest.payload).width == 0
        assert reference.deserialize(where.type, where.payload).poses == []


def test_a_coastdown_without_estimate_says_why() -> None:
    *_, note = outputs(EndedCoastdown(1, 2, None, EndedBy.GIVEN, None, failure='too short'))
    assert 'too short' in read_event(note.payload).text


@pytest.mark.parametrize(
    ('event', 'kind', 'stamp_ns'),
    [
        (Onset(5, 9), EventKind.ONSET, 9),
        (NoEstimate(7, 'why'), EventKind.NO_ESTIMATE, 7),
        (NotCoastdown(5, 9, Dismissal.TURN, 'why'), EventKind.DISMISSED, 9),
        (Reset(8, 'why'), EventKind.RESET, 8),
    ],
)
def test_events_read_back(event: Any, kind: EventKind, stamp_ns: int) -> None:
    (message,) = outputs(event)
    assert message.topic == '/coastdown_node/events'
    note = read_event(message.payload)
    assert (note.kind, note.stamp_ns) == (kind, stamp_ns)


def test_notes_round_trip() -> None:
    asked = EventNote(EventKind.RESET_REQUEST, 11, 'service')  # not taken for one that is done
    for note in (EventNote(EventKind.LIFECYCLE, STAMP_NS, 'active', {'from': 'inactive'}), asked):
        assert read_event(event_message(note).payload) == note


def test_an_array_of_another_kind_is_malformed() -> None:
    name = 'diagnostic_msgs/msg/DiagnosticArray'
    empty = reference.make(name, header=reference.header(1), status=[])
    with pytest.raises(MalformedMessage):
        read_event(reference.serialize(name, empty))
