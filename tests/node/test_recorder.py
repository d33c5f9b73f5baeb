# SPDX-License-Identifier: Apache-2.0
"""What is recorded, in which order, and what is said when it cannot be."""

from __future__ import annotations

import re
import resource
import time
from collections.abc import Callable
from pathlib import Path
from threading import Event

import pytest

from shipdrag_ros.bags.durable import LiveFile, PartLimits
from shipdrag_ros.bags.retention import Keep, Removed
from shipdrag_ros.bags.writer import BagWriter
from shipdrag_ros.messages import (
    EncodedMessage,
    EventKind,
    EventNote,
    OutputMessage,
    event_message,
)
from shipdrag_ros.messages.topics import WARN
from shipdrag_ros.node.health import recording_status
from shipdrag_ros.node.recorder import (
    DEFAULT_LIMITS,
    EVERYTHING,
    SEGMENT_BYTES,
    RawRing,
    Recorder,
    RecordingState,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from tests.recorded import attachments, rows

SHIP = Ship.from_yaml('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n', subject='test')
PARAMETERS = Parameters(window_s=60.0, steady_s=60.0)
WITHIN_S = 120.0


def recorder(
    directory: Path, *, limits: PartLimits = DEFAULT_LIMITS, keep: Keep = EVERYTHING
) -> Recorder:
    return Recorder(
        directory,
        namespace='/ship',
        ship=SHIP,
        parameters=PARAMETERS,
        history_ns=10**9,
        limits=limits,
        keep=keep,
    )


def received(arrival_ns: int) -> EncodedMessage:
    return EncodedMessage('depth', 'sensor_msgs/msg/Range', b'as received', arrival_ns, 5)


def sent(stamp_ns: int) -> OutputMessage:
    return event_message(EventNote(EventKind.LIFECYCLE, stamp_ns, 'active', {}))


def path_of(recorder: Recorder) -> Path:
    progress = recorder.status().progress
    assert progress is not None
    assert progress.path is not None
    return progress.path


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + WITHIN_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_writes_inputs_and_outputs_in_order(tmp_path: Path) -> None:
    it = recorder(tmp_path / 'made' / 'here')
    assert it.status().text == 'not recording'
    it.start()
    it.input(received(100))
    it.output(sent(7), 100)
    assert it.status().state is RecordingState.RECORDING
    wait_until(lambda: it.status().text.endswith('.mcap'))
    assert it.status().text == f'recording to {path_of(it)}'
    it.close()
    assert it.status().state is RecordingState.OFF
    progress = it.status().progress
    assert progress is not None
    assert (progress.messages, progress.waiting, progress.lost) == (2, 0, 0)
    path = path_of(it)
    first, second = rows(path)
    assert first == ('/ship/depth', 100, 5, b'as received')
    assert second[:3] == ('/coastdown_node/events', 100, 7)
    assert Ship.from_yaml(attachments(path)['ship.yaml'], subject='bag') == SHIP
    kept = Parameters.from_yaml(attachments(path)['parameters.yaml'], subject='bag')
    assert kept == PARAMETERS


def test_what_was_said_before_the_first_input_is_recorded(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    it.start()
    for stamp_ns in range(300):
        it.output(sent(stamp_ns), 7)
    it.input(received(8))
    it.close()
    times = [row.publish_ns for row in rows(path_of(it))]
    assert times == [*range(200, 300), 5]  # the latest hundred, and the input


def test_files_are_not_for_everybody(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    it.start()
    it.input(received(1))
    wait_until(lambda: it.status().text.endswith('.mcap'))
    assert path_of(it).stat().st_mode & 0o137 == 0  # while it grows
    it.close()
    assert path_of(it).stat().st_mode & 0o137 == 0


def test_old_recordings_make_room(tmp_path: Path) -> None:
    for hour in range(3):
        (tmp_path / f'coastdown_20260101T0{hour}0000Z_000.mcap').write_bytes(b'')
    with BagWriter(tmp_path / 'coastdown_20260101T040000Z_000.mcap'):
        pass
    it = recorder(tmp_path, keep=Keep(size_bytes=3 * 4096))
    removed: list[Removed] = []
    wait_until(lambda: bool(removed.extend(it.removed())) or bool(removed))
    it.close()
    assert [part.path.name[10:25] for part in removed] == ['20260101T040000']


def test_what_is_kept_and_what_somebody_removed_is_said(tmp_path: Path) -> None:
    assert Keep().text.startswith('the oldest recordings are removed beyond 50% of the disk')
    it = recorder(tmp_path, keep=Keep())
    assert it.status().kept == Keep().text
    it.start()
    it.input(received(1))
    wait_until(lambda: [it.messages for it in [it.status().progress] if it] == [1])
    path_of(it).unlink()
    it.input(received(2))
    wait_until(lambda: it.status().lost == 1)
    it.close()
    assert 'somebody removed 1 file(s) that were being written' in it.status().text


def test_start_while_recording_and_stop_while_not_change_nothing(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    it.stop()
    it.start()
    it.input(received(1))
    wait_until(lambda: it.status().text.endswith('.mcap'))
    first = path_of(it)
    it.start()
    assert path_of(it) == first
    it.close()
    it.close()
    assert len(list(tmp_path.iterdir())) == 1


def test_a_new_part_only_while_recording(tmp_path: Path) -> None:
    it = recorder(tmp_path)
    it.new_part()
    assert it.status().state is RecordingState.OFF
    it.start()
    it.input(received(1))
    it.new_part()
    it.close()
    assert len(list(tmp_path.glob('*.mcap'))) == 2  # the second begins with what came before


def test_the_limits_of_a_part_are_those_given(tmp_path: Path) -> None:
    it = recorder(tmp_path, limits=PartLimits(size_bytes=10**9, duration_s=10.0))
    it.start()
    for second in range(30):
        it.input(received(second * 10**9))
    it.close()
    parts = sorted(tmp_path.glob('*.mcap'))
    assert [len(rows(part)) for part in parts] == [11, 11, 8]


def test_what_was_lost_is_counted_over_all_recordings(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    it = recorder(tmp_path / 'file')
    it.start()
    it.input(received(1))
    it.close()
    status = it.status()
    assert status.state is RecordingState.FAILED
    assert 'recording failed, 1 message(s) lost, 0 kept' in status.text
    (tmp_path / 'file').unlink()
    for _ in range(3):
        it.forget()
        it.start()
        it.close()
        assert it.status().lost == 1
    assert it.status().text == 'not recording, 1 message(s) lost'


def test_a_disk_that_hangs_holds_nobody_up_and_is_told(tmp_path, monkeypatch) -> None:
    it = recorder(tmp_path)
    it.start()
    it.input(received(0))
    wait_until(lambda: it.status().text.endswith('.mcap'))
    sync = LiveFile.sync
    freed = Event()

    def hang(file: LiveFile) -> None:
        assert freed.wait(WITHIN_S)
        sync(file)

    with monkeypatch.context() as disk:
        disk.setattr(LiveFile, 'sync', hang)
        it.input(received(1))
        wait_until(lambda: it.status().slow)
        it.input(received(2))
        assert re.search('the disk is slow, [0-9]+ s are in memory only', it.status().text)
        assert not freed.is_set()
        freed.set()
    it.close()
    assert [row.log_ns for row in rows(path_of(it))] == [0, 1, 2]
    assert not it.status().slow


def test_old_recordings_that_cannot_be_removed_are_said_until_they_can(tmp_path, monkeypatch):
    monkeypatch.setattr('shipdrag_ros.node.recorder.EVERY_S', 0.05)
    old = tmp_path / 'coastdown_20260101T000000Z_000.mcap'
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))  # nothing can be opened, as on a leak
    try:
        it = recorder(tmp_path, keep=Keep(size_bytes=1))
        wait_until(lambda: 'Too many open files' in it.status().text)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    said = recording_status(it.status())
    with BagWriter(old):
        pass
    wait_until(lambda: not old.exists())
    wait_until(lambda: it.status().text == 'not recording')
    assert said.level == WARN
    assert said.message == (
        f'not recording; old recordings cannot be removed: {tmp_path} (Too many open files); '
        'look at it, and at its disk'
    )
    it.close()


SECOND_NS = 10**9


def message(second: int, *, size: int = 100) -> EncodedMessage:
    return EncodedMessage(
        'depth', 'sensor_msgs/msg/Range', bytes(size), second * SECOND_NS, second
    )


def fill(ring: RawRing, count: int, *, size: int = 100) -> None:
    for second in range(count):
        ring.add(message(second, size=size))


def test_gives_back_what_it_took_in_order() -> None:
    ring = RawRing(10**6 * SECOND_NS)
    fill(ring, 2000)
    assert list(ring) == [message(second) for second in range(2000)]


def test_forgets_by_age_but_not_too_early() -> None:
    ring = RawRing(1000 * SECOND_NS)
    fill(ring, 10_000)
    seconds = [item.publish_ns for item in ring]
    segment = SEGMENT_BYTES // 100 + 1
    assert seconds[-1] == 9999
    assert 1000 <= len(seconds) <= 1000 + 2 * segment
    assert not ring.cut


def test_forgets_by_bytes_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('shipdrag_ros.node.recorder.LIMIT_BYTES', 10_000)
    ring = RawRing(10**9 * SECOND_NS)
    fill(ring, 50_000, size=1000)
    kept = [item.publish_ns for item in ring]
    assert kept == list(range(kept[0], 50_000))
    assert kept[0] > 0
    assert ring.cut


def test_forgets_all() -> None:
    ring = RawRing(SECOND_NS)
    fill(ring, 2000)
    ring.clear()
    assert list(ring) == []
