# SPDX-License-Identifier: Apache-2.0
"""What is written, in which order, and what happens when it cannot be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import EventKind, EventNote, OutputMessage, event_message
from shipdrag_ros.node.recorder import Recorder, RecordingState
from shipdrag_ros.node.ring import RawMessage
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

SHIP = Ship.from_yaml('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n', subject='test')
PARAMETERS = Parameters(window_s=60.0, steady_s=60.0)


def recorder(directory: Path) -> Recorder:
    return Recorder(
        directory, namespace='/ship', ship=SHIP, parameters=PARAMETERS, history_ns=10**9
    )


def received(arrival_ns: int) -> RawMessage:
    return RawMessage('depth', 'sensor_msgs/msg/Range', b'as received', arrival_ns, 5)


def sent(stamp_ns: int) -> OutputMessage:
    return event_message(EventNote(EventKind.LIFECYCLE, stamp_ns, 'active', {}))


def rows(path: Path) -> list[tuple[str, int, int]]:
    with path.open('rb') as stream:
        messages = make_reader(stream).iter_messages(log_time_order=False)
        return [(c.topic, m.log_time, m.publish_time) for _, c, m in messages]


def attachments(path: Path) -> dict[str, str]:
    with path.open('rb') as stream:
        return {item.name: item.data.decode() for item in make_reader(stream).iter_attachments()}


def path_of(recorder: Recorder) -> Path:
    path = recorder.status().path
    assert path is not None
    return path


def test_writes_inputs_and_outputs_in_order(tmp_path: Path) -> None:
    it = recorder(tmp_path / 'made' / 'here')
    it.start()
    it.input(received(100))
    it.output(sent(7), 100)
    assert it.status().state is RecordingState.RECORDING
    assert it.status().messages == 2
    it.stop()
    assert it.status().state is RecordingState.OFF
    path = path_of(it)
    assert rows(path) == [('/ship/depth', 100, 5), ('/coastdown_node/events', 100, 7)]
    assert Ship.from_yaml(attachments(path)['ship.yaml'], subject='bag') == SHIP
    kept = Parameters.from_yaml(attachments(path)['parameters.yaml'], subject='bag')
    assert kept == PARAMETERS


def test_begins_with_what_came_before(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    it.input(received(1))
    it.output(sent(1), 1)
    it.input(received(2))
    it.start()
    it.input(received(3))
    it.stop()
    assert [log_ns for _, log_ns, _ in rows(path_of(it))] == [1, 2, 3]


def test_forgets_on_a_reset(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    it.input(received(1))
    it.forget()
    it.start()
    it.stop()
    assert rows(path_of(it)) == []


def test_never_overwrites(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    for arrival_ns in range(3):
        it.start()
        it.input(received(arrival_ns))
        it.stop()
        it.forget()
    assert len(list(tmp_path.glob('coastdown_*.mcap'))) == 3


def test_start_while_recording_and_stop_while_not_change_nothing(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    it.stop()
    it.start()
    first = path_of(it)
    it.start()
    assert path_of(it) == first
    it.stop()
    it.stop()


def test_a_new_part_only_while_recording(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    it.new_part()
    assert it.status().state is RecordingState.OFF
    it.start()
    it.new_part()
    it.stop()
    assert len(list(tmp_path.glob('*.mcap'))) == 2


def test_a_place_that_cannot_be_written_is_reported(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    it = recorder(tmp_path / 'file')
    it.start()
    it.input(received(1))
    it.output(sent(1), 1)
    status = it.status()
    assert status.state is RecordingState.FAILED
    assert status.lost == 2
    assert 'recording failed, 2 message(s) not written' in status.text


def test_a_disk_that_fills_up_is_counted_and_may_be_retried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    it = recorder(tmp_path)
    it.start()
    it.input(received(1))

    def full(*_: Any, **__: Any) -> None:
        raise BagError('No space left on device')

    with monkeypatch.context() as disk:
        disk.setattr(BagWriter, 'write', full)
        it.input(received(2))
    it.input(received(3))
    assert it.status().lost == 2
    assert 'No space left on device' in it.status().text
    it.start()
    it.stop()
    assert [log_ns for _, log_ns, _ in rows(path_of(it))] == [1, 2, 3]
    assert it.status().lost == 0


def test_a_bag_that_cannot_be_closed_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    it = recorder(tmp_path)
    it.start()
    close = BagWriter.close

    def full(writer: BagWriter) -> None:
        close(writer)
        raise BagError('No space left on device')

    monkeypatch.setattr(BagWriter, 'close', full)
    it.stop()
    assert it.status().state is RecordingState.FAILED
