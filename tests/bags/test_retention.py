# SPDX-License-Identifier: Apache-2.0
"""Which recordings go when there is no room, and which stay."""

from __future__ import annotations

import os
from pathlib import Path

from shipdrag_ros.bags.retention import DAY_S, Keep, Removed, Retention
from shipdrag_ros.bags.writer import BagWriter
from shipdrag_ros.messages.topics import RESISTANCE

NOW_S = 1_800_000_000.0
NO_ONE: frozenset[Path] = frozenset()


def part(directory: Path, hour: int, number: int = 0, *, coastdown: bool = False) -> Path:
    """Make a part of 4096 bytes as it counts, an hour later than that of the hour before."""
    path = directory / f'coastdown_20260101T{hour:02d}0000Z_{number:03d}.mcap'
    with BagWriter(path) as bag:
        topic = RESISTANCE.under('/coastdown_node') if coastdown else '/depth'
        kind = RESISTANCE.type if coastdown else 'sensor_msgs/msg/Range'
        bag.write(topic, kind, b'\x00\x01\x00\x00', log_ns=1, publish_ns=1)
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
    removed = retention.tidy(busy=NO_ONE, now_s=NOW_S)
    assert [(one.path.name[19:21], one.coastdown) for one in removed] == [
        ('01', False),
        ('02', False),
    ]
    assert retention.tidy(busy=NO_ONE, now_s=NOW_S) == []

    removed = Retention(tmp_path, Keep(size_bytes=1)).tidy(busy=NO_ONE, now_s=NOW_S)
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
    removed = Retention(tmp_path, Keep(days=0.5)).tidy(busy=NO_ONE, now_s=NOW_S)
    assert names(removed) == ['00_000', '02_000']
    assert sorted(tmp_path.iterdir()) == sorted(kept)
    assert 'older than 0.5 days' in removed[0].text


def test_what_is_written_or_not_ours_is_never_touched(tmp_path: Path) -> None:
    busy = part(tmp_path, 0)
    target = tmp_path / 'target'
    target.write_text('kept')
    link = tmp_path / 'coastdown_20260101T010000Z_000.mcap'
    link.symlink_to(target)
    os.mkfifo(tmp_path / 'coastdown_20260101T020000Z_000.mcap')
    damaged = tmp_path / 'coastdown_20260101T030000Z_000.mcap'
    damaged.write_text('no bag: what is in it is not known')
    others = [target, link, tmp_path / 'coastdown_20260101T020000Z_000.mcap', busy]
    (tmp_path / 'notes.mcap').write_text('')
    others.append(tmp_path / 'notes.mcap')
    removed = Retention(tmp_path, Keep(days=1e-9, size_bytes=1)).tidy(busy={busy}, now_s=2 * NOW_S)
    assert [(one.path, one.coastdown) for one in removed] == [(damaged, True)]
    assert sorted(tmp_path.iterdir()) == sorted(others)


def test_without_limits_everything_stays(tmp_path: Path) -> None:
    part(tmp_path, 0)
    assert Retention(tmp_path, Keep()).tidy(busy=NO_ONE, now_s=1e12) == []
    assert Retention(tmp_path / 'none', Keep(days=1)).tidy(busy=NO_ONE, now_s=1e12) == []
