# SPDX-License-Identifier: Apache-2.0
"""Which recordings go when there is no room, and which stay."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from shipdrag_ros.bags.durable import LiveFile
from shipdrag_ros.bags.recover import SUFFIX
from shipdrag_ros.bags.retention import DAY_S, Keep, Removed, Retention
from shipdrag_ros.bags.writer import BagWriter, RecordWriter
from shipdrag_ros.messages import EncodedMessage
from shipdrag_ros.messages.topics import RESISTANCE

NOW_S = 1_800_000_000.0


def part(directory: Path, hour: int, number: int = 0, *, coastdown: bool = False) -> Path:
    """Make a part of 4096 bytes as it counts, an hour later than that of the hour before."""
    path = directory / f'coastdown_20260101T{hour:02d}0000Z_{number:03d}.mcap'
    with BagWriter(path) as bag:
        topic = RESISTANCE.under('/coastdown_node') if coastdown else '/depth'
        kind = RESISTANCE.type if coastdown else 'sensor_msgs/msg/Range'
        bag.put(EncodedMessage(topic, kind, b'\x00\x01\x00\x00', 1, 1))
    assert path.stat().st_size <= 4096
    changed_s = NOW_S - DAY_S + 3600.0 * hour
    os.utime(path, (changed_s, changed_s))
    return path


def names(removed: list[Removed]) -> list[str]:
    return [one.path.name[19:21] + one.path.name[26:30] for one in removed]


def test_the_oldest_go_first_and_coastdowns_last(tmp_path: Path) -> None:
    part(tmp_path, 0, coastdown=True)
    for hour in (1, 2, 3):
        part(tmp_path, hour)
    retention = Retention(tmp_path, Keep(size_bytes=2 * 4096))
    removed = retention.tidy(now_s=NOW_S)
    assert [(one.path.name[19:21], one.coastdown) for one in removed] == [
        ('01', False),
        ('02', False),
    ]
    assert retention.tidy(now_s=NOW_S) == []

    removed = Retention(tmp_path, Keep(size_bytes=1)).tidy(now_s=NOW_S)
    assert [(one.path.name[19:21], one.coastdown) for one in removed] == [
        ('03', False),
        ('00', True),
    ]
    assert 'held a coastdown: nothing else was left' in removed[1].text
    assert list(tmp_path.iterdir()) == []


def test_age_takes_no_coastdown_nor_its_steady_lead(tmp_path: Path) -> None:
    kept = [part(tmp_path, 1, 0), part(tmp_path, 1, 1, coastdown=True)]
    part(tmp_path, 0, 0)
    part(tmp_path, 2, 0)
    kept.append(part(tmp_path, 20))
    removed = Retention(tmp_path, Keep(days=0.5)).tidy(now_s=NOW_S)
    assert names(removed) == ['00_000', '02_000']
    assert sorted(tmp_path.iterdir()) == sorted(kept)
    assert 'older than 0.5 days' in removed[0].text


def test_what_is_not_ours_is_never_touched(tmp_path: Path) -> None:
    target = tmp_path / 'target'
    target.write_text('kept')
    link = tmp_path / 'coastdown_20260101T010000Z_000.mcap'
    link.symlink_to(target)
    os.mkfifo(tmp_path / 'coastdown_20260101T020000Z_000.mcap')
    damaged = tmp_path / 'coastdown_20260101T030000Z_000.mcap'
    damaged.write_text('no bag: what is in it is not known')
    others = [target, link, tmp_path / 'coastdown_20260101T020000Z_000.mcap']
    (tmp_path / 'notes.mcap').write_text('')
    others.append(tmp_path / 'notes.mcap')
    removed = Retention(tmp_path, Keep(days=1e-9, size_bytes=1)).tidy(now_s=2 * NOW_S)
    assert [(one.path, one.coastdown) for one in removed] == [(damaged, True)]
    assert sorted(tmp_path.iterdir()) == sorted(others)


@pytest.mark.parametrize('state', ['growing', 'closed, not yet compact'])
def test_what_another_node_writes_in_the_same_folder_stays(tmp_path: Path, state: str) -> None:
    path = tmp_path / 'coastdown_20260101T000000Z_000.mcap'
    ready, writes = os.pipe()
    child = os.fork()
    if child == 0:
        file = LiveFile(path, recording_id='r', part=0, attachments={})
        file.append([EncodedMessage('/depth', 'sensor_msgs/msg/Range', b'reading', 1, 1)])
        file.sync()
        if state != 'growing':
            file.close()
        os.write(writes, b'x')
        signal.pause()
    retention = Retention(tmp_path, Keep(days=1e-9, size_bytes=1))
    os.read(ready, 1)
    removed = retention.tidy(now_s=2 * NOW_S)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert removed == []
    # who wrote it is gone
    assert names(retention.tidy(now_s=2 * NOW_S)) == ['00_000']


def test_a_part_that_still_grows_is_not_judged_and_keeps_the_one_before_it(tmp_path: Path) -> None:
    before = part(tmp_path, 0)
    file = LiveFile(
        tmp_path / before.name.replace('_000', '_001'), recording_id='r', part=1, attachments={}
    )
    retention = Retention(tmp_path, Keep(days=1e-9))
    assert retention.tidy(now_s=2 * NOW_S) == []
    file.release()  # it is judged as it is now, though nothing was written since
    assert names(retention.tidy(now_s=2 * NOW_S)) == ['00_000', '00_001']


def test_what_a_killed_compaction_left_is_counted_and_goes_first(tmp_path: Path) -> None:
    kept = part(tmp_path, 1)
    left = [f'{kept.name}{SUFFIX}', f'.{kept.name}{SUFFIX}.part']
    for name in left:
        (tmp_path / name).write_bytes(b'half of a bag')
    running = RecordWriter(tmp_path / f'.{kept.name.replace("_000", "_001")}{SUFFIX}.part')
    retention = Retention(tmp_path, Keep(size_bytes=2 * 4096))
    removed = retention.tidy(now_s=NOW_S)
    assert {one.path.name for one in removed} == set(left)
    assert retention.over_bytes == 0
    assert set(tmp_path.iterdir()) == {kept, running.path}
    running.close()
    Retention(tmp_path, Keep(days=1e-9)).tidy(now_s=2 * NOW_S)
    assert list(tmp_path.iterdir()) == []


def test_where_nobody_said_how_much_a_coastdown_is_never_removed(tmp_path: Path) -> None:
    part(tmp_path, 0, coastdown=True)
    for hour in (1, 2, 3):
        part(tmp_path, hour)
    disk = os.statvfs(tmp_path)
    room = disk.f_blocks * disk.f_frsize
    retention = Retention(tmp_path, Keep(share=2.5 * 4096 / room))
    assert [one.path.name[19:21] for one in retention.tidy(now_s=NOW_S)] == ['01', '02']
    assert retention.over_bytes == 0
    retention = Retention(tmp_path, Keep(share=0.5 * 4096 / room))
    assert [one.path.name[19:21] for one in retention.tidy(now_s=NOW_S)] == ['03']
    assert retention.over_bytes == 2048
    assert [path.name[19:21] for path in tmp_path.iterdir()] == ['00']


def test_without_limits_everything_stays(tmp_path: Path) -> None:
    part(tmp_path, 0)
    assert Retention(tmp_path, Keep(share=0.0)).tidy(now_s=1e12) == []
    assert Retention(tmp_path / 'none', Keep(days=1)).tidy(now_s=1e12) == []


def child(code: str, *arguments: str | Path) -> str:
    """Return what a program of its own prints; it must end by itself."""
    done = subprocess.run(
        [sys.executable, '-c', code, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )
    assert done.returncode == 0, (done.returncode, done.stderr)
    return done.stdout


CUT = """
import os, sys, threading
from pathlib import Path
from shipdrag_ros.bags.retention import Keep, Retention
folder = Path(sys.argv[1])
def cut():
    os.truncate(next(folder.glob('*_000.mcap')), 100)
threading.Timer(0.3, cut).start()
print([one.path.name for one in Retention(folder, Keep(days=1e-9)).tidy(now_s=2e9)])
"""


def test_a_recording_that_is_cut_while_it_is_read_ends_no_process(tmp_path: Path) -> None:
    """As one whose disk is pulled out; reading a mapped file would end the process."""
    long = b'\x89MCAP0\r\n' + (b'\x05\x20' + bytes(7) + b'\xff' * 30) * 250_000
    (tmp_path / 'coastdown_20260101T000000Z_000.mcap').write_bytes(long)  # some seconds to read
    second = part(tmp_path, 1, 1)
    assert second.name in child(CUT, tmp_path)


HUGE = """
import os, resource, sys
from pathlib import Path
from shipdrag_ros.bags.retention import Keep, Retention
folder = Path(sys.argv[1])
retention = Retention(folder, Keep(days=1e-9))
retention.tidy(now_s=0.0)  # whatever is needed for that is imported now
huge = folder / 'coastdown_20260101T000000Z_000.mcap'
huge.write_bytes(b'')
os.truncate(huge, 200 * 2**20)
pages = int(Path('/proc/self/statm').read_text().split()[0])
resource.setrlimit(resource.RLIMIT_AS, (pages * 4096 + 64 * 2**20, resource.RLIM_INFINITY))
print([one.path.name for one in retention.tidy(now_s=2e9)], retention.problem)
"""


def test_a_recording_that_finds_no_room_in_memory_keeps_no_other(tmp_path: Path) -> None:
    other = part(tmp_path, 1)
    said = child(HUGE, tmp_path)
    huge = 'coastdown_20260101T000000Z_000.mcap'
    assert said == (
        f"['{other.name}'] {huge} cannot be read (MemoryError), so that it stays; "
        'move or remove it\n'
    )
    assert [path.name for path in tmp_path.iterdir()] == [huge]
