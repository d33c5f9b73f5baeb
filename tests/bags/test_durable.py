# SPDX-License-Identifier: Apache-2.0
"""Nothing handed over is lost while memory can hold it, whatever the disk does."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from threading import Event

import pytest

from shipdrag_ros.bags import durable as module
from shipdrag_ros.bags import open_runs
from shipdrag_ros.bags.durable import DurableRecording, LiveFile, PartLimits, RecordingProgress
from shipdrag_ros.bags.recover import compact
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import EncodedMessage
from tests.recorded import rows

WITHIN_S = 120.0
SECOND_NS = 10**9
FULL = BagError('No space left on device')


def message(number: int, *, size: int = 40) -> EncodedMessage:
    payload = number.to_bytes(8, 'little') + bytes(size - 8)
    return EncodedMessage(
        '/depth', 'sensor_msgs/msg/Range', payload, number * SECOND_NS, number * SECOND_NS
    )


def recording(
    directory: Path,
    *,
    limits: PartLimits | None = None,
    earlier: Iterable[EncodedMessage] = (),
    queue_bytes: int = 10**7,
) -> DurableRecording:
    it = DurableRecording(
        directory,
        stem='a',
        attachments={'ship.yaml': 'name: x\n'},
        limits=limits or PartLimits(),
        earlier=earlier,
        queue_bytes=queue_bytes,
    )
    it.wait_begun(WITHIN_S)
    return it


def numbers(path: Path) -> list[int]:
    return [row.log_ns // SECOND_NS for row in rows(path)]


def all_numbers(directory: Path) -> list[int]:
    """Return what is in the parts, in their order."""
    return [n for path in sorted(directory.glob('*.mcap')) for n in numbers(path)]


def end(it: DurableRecording) -> RecordingProgress:
    it.stop()
    assert it.wait_ended(WITHIN_S)
    return it.progress()


def wait_until(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + WITHIN_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Try a failed disk again soon."""
    monkeypatch.setattr(module, 'RETRY_S', 0.05)


def test_all_that_was_handed_over_is_there_in_order(tmp_path: Path) -> None:
    it = recording(tmp_path, earlier=map(message, range(10_000)))
    for number in range(10_000, 10_500):
        it.put(message(number))
    progress = end(it)
    assert (progress.messages, progress.waiting, progress.lost) == (10_500, 0, 0)
    assert all_numbers(tmp_path) == list(range(10_500))


def longest_in_memory_s(directory: Path) -> float:
    """Record for two seconds, and return how long a message waited at most."""
    it = recording(directory)
    longest_s = 0.0
    for number in range(100):
        it.put(message(number))
        longest_s = max(longest_s, it.progress().oldest_s)
        time.sleep(0.02)
    wait_until(lambda: it.progress().messages == 100)
    assert it.progress().oldest_s == 0.0
    end(it)
    return longest_s


def test_it_is_on_the_disk_within_a_second(tmp_path: Path) -> None:
    # a machine that is busy with other things may need more than one try
    assert any(0.0 < longest_in_memory_s(tmp_path / str(attempt)) < 1.0 for attempt in range(4))


@pytest.mark.usefixtures('quick')
def test_a_disk_that_is_full_for_a_while_loses_nothing(tmp_path, monkeypatch) -> None:
    it = recording(tmp_path)
    it.put(message(0))
    wait_until(lambda: it.progress().messages == 1)
    write = LiveFile._write
    attempts: list[int] = []

    def half(file: LiveFile, data: bytes) -> None:
        file._file.write(data[: len(data) // 2])
        attempts.append(len(data))
        raise FULL

    with monkeypatch.context() as disk:
        disk.setattr(LiveFile, '_write', half)
        it.put(message(1))
        wait_until(lambda: it.progress().error)
        it.put(message(2))
        failed = len(attempts)
        wait_until(lambda: len(attempts) > failed + 2)
        assert it.progress().waiting == 2
    assert LiveFile._write is write
    wait_until(lambda: it.progress().messages == 3)
    assert it.progress().error == ''
    it.put(message(3))
    assert end(it).lost == 0
    assert [path.name for path in sorted(tmp_path.iterdir())] == ['a_000.mcap', 'a_001.mcap']
    assert all_numbers(tmp_path) == [0, 1, 2, 3]


@pytest.mark.usefixtures('quick')
def test_what_was_written_but_not_safe_is_written_again_and_not_twice(tmp_path, monkeypatch):
    it = recording(tmp_path)
    it.put(message(0))
    wait_until(lambda: it.progress().messages == 1)

    def fail(file: LiveFile) -> None:
        raise FULL

    with monkeypatch.context() as disk:
        disk.setattr(LiveFile, 'sync', fail)
        it.put(message(1))
        wait_until(lambda: it.progress().error)
    assert end(it).lost == 0
    assert all_numbers(tmp_path) == [0, 1]


def test_a_finished_part_that_is_removed_before_it_is_compact_is_counted(tmp_path, monkeypatch):
    with monkeypatch.context() as disk:
        disk.setattr(module, 'compact', _full)
        it = recording(tmp_path, limits=PartLimits(size_bytes=10**9, duration_s=5.0))
        for number in range(7):
            it.put(message(number))
        wait_until(lambda: it.progress().messages == 7)
        wait_until(lambda: it.progress().uncompacted == 1)
        (tmp_path / 'a_000.mcap').unlink()
    progress = end(it)
    assert (progress.messages, progress.lost, progress.vanished) == (1, 6, 1)
    assert (progress.uncompacted, progress.error) == (0, '')
    assert all_numbers(tmp_path) == [6]


@pytest.mark.usefixtures('quick')
def test_a_file_that_is_moved_is_not_lost(tmp_path: Path) -> None:
    it = recording(tmp_path)
    it.put(message(0))
    wait_until(lambda: it.progress().messages == 1)
    (tmp_path / 'a_000.mcap').rename(tmp_path / 'b.mcap')
    it.put(message(1))
    wait_until(lambda: it.progress().messages == 2)
    progress = end(it)
    assert (progress.messages, progress.lost, progress.vanished) == (2, 0, 0)
    assert numbers(tmp_path / 'a_001.mcap') == [1]
    (moved,) = open_runs([tmp_path / 'b.mcap'])
    assert moved.topics[0].messages == 1


def _full(path: Path, *, messages: int) -> None:
    raise FULL


def test_memory_is_bounded_and_what_finds_no_room_is_counted(tmp_path: Path) -> None:
    (tmp_path / 'taken').write_text('')
    it = recording(tmp_path / 'taken', queue_bytes=100_000)
    for number in range(1000):
        it.put(message(number, size=600))
    progress = it.progress()
    assert progress.waiting == 100
    assert progress.lost == 900
    progress = end(it)
    assert (progress.waiting, progress.lost) == (0, 1000)
    assert 'File exists' in progress.error


def test_a_part_that_cannot_be_compacted_is_whole_and_counted_and_it_is_said_why(tmp_path) -> None:
    (tmp_path / 'a_000.mcap.compacting').mkdir()  # where it would be written
    it = recording(tmp_path, earlier=map(message, range(10)))
    progress = end(it)
    assert (progress.lost, progress.uncompacted, progress.error) == (0, 1, '')
    assert 'cannot be compacted: Is a directory' in progress.why_uncompacted
    (tmp_path / 'a_000.mcap.compacting').rmdir()
    assert all_numbers(tmp_path) == list(range(10))


def test_it_goes_on_while_a_part_is_compacted(tmp_path, monkeypatch) -> None:
    released = Event()

    def slow(path: Path, *, messages: int) -> None:
        assert released.wait(WITHIN_S)
        compact(path, messages=messages)

    monkeypatch.setattr(module, 'compact', slow)
    it = recording(tmp_path, limits=PartLimits(size_bytes=10**9, duration_s=5.0))
    for number in range(12):
        it.put(message(number))
    wait_until(lambda: it.progress().messages == 12)
    assert (it.progress().part, it.progress().uncompacted) == (1, 1)
    it.put(message(12))
    wait_until(lambda: it.progress().messages == 13)
    released.set()
    assert end(it).uncompacted == 0
    assert all_numbers(tmp_path) == list(range(13))


def test_no_file_is_ever_overwritten(tmp_path: Path) -> None:
    for _ in range(3):
        end(recording(tmp_path, earlier=[message(1)]))
    names = [path.name for path in sorted(tmp_path.iterdir())]
    assert names == ['a_000.mcap', 'a_000_2.mcap', 'a_000_3.mcap']


def test_recordings_that_begin_at_once_never_take_the_name_of_another(tmp_path: Path) -> None:
    """Sixteen threads look for a free name in the same moment, in 10 rounds."""
    for round_ in range(10):
        folder = tmp_path / str(round_)
        recordings = [
            DurableRecording(folder, stem='a', attachments={}, limits=PartLimits())
            for _ in range(16)
        ]
        for number, it in enumerate(recordings):
            it.put(message(number))
            it.stop()
        assert all(it.wait_ended(WITHIN_S) for it in recordings)
        assert sum(it.progress().lost for it in recordings) == 0
        assert sorted(all_numbers(folder)) == list(range(16))
