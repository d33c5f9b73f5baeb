# SPDX-License-Identifier: Apache-2.0
"""Which bags lie below a folder, and what lies beside them."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import pytest

from shipdrag_ros.errors import FleetError
from shipdrag_ros.fleet.find import LIMIT_BYTES, find


def names(folder: Path, without: Path | None = None) -> list[str]:
    return [source.bag for source in find([str(folder)], without=without).sources]


def touch(*paths: Path) -> None:
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


def test_every_bag_once_whatever_links_lead_to_it(fleet_folder: Path) -> None:
    found = find([str(fleet_folder)])
    assert [source.bag for source in found.sources] == [
        'bering/2026/run 1.mcap',
        'bering/2026/run 2.mcap',
        'bering/2026/run 3.mcap',
        'bering/2026/the same.mcap',
        'other/empty.mcap',
        'other/fore\nign.mcap',
    ]
    assert {source.root for source in found.sources} == {'fleet'}
    assert {(each.bag, each.reason.split(';')[0]) for each in found.skipped} == {
        ('other/endless.mcap', 'is a device and no file'),
        ('other/gone.mcap', 'cannot be read: No such file or directory'),
        ('other/pipe.mcap', 'is a pipe and no file'),
    }
    assert found.left_alone == 1


def test_a_bag_alone_may_be_given(fleet_folder: Path) -> None:
    (source,) = find([str(fleet_folder / 'bering' / '2026' / 'run 2.mcap')]).sources
    assert (source.root, source.bag) == ('2026', 'run 2.mcap')


@pytest.mark.parametrize(
    ('place', 'why'),
    [
        ('/nothing', 'does not exist; give a folder of bags'),
        ('', 'a variable that is not set'),
        ('https://127.0.0.1/bags', 'a web server has no folders'),
    ],
)
def test_what_is_no_folder_is_refused(place: str, why: str) -> None:
    with pytest.raises(FleetError, match=why):
        find([place])


def test_a_ship_file_that_is_no_file_is_not_passed_over(tmp_path: Path) -> None:
    """The ship file of the folder above would be that of another ship."""
    touch(tmp_path / 'ship.yaml', tmp_path / 'a' / 'x.mcap', tmp_path / 'b' / 'y.mcap')
    (tmp_path / 'a' / 'ship.yaml').symlink_to('gone.yaml')
    os.mkfifo(tmp_path / 'events.csv')
    found = find([str(tmp_path)])
    assert [each.bag for each in found.sources] == ['b/y.mcap']
    (skipped,) = found.skipped
    assert skipped.bag == 'a/x.mcap'
    assert 'ship.yaml' in skipped.reason
    assert 'is no regular file' in skipped.reason
    (note,) = found.notes
    assert note.startswith('no event is known, since ')
    assert 'events.csv' in note


def test_the_nearest_ship_file_upwards_counts(tmp_path: Path) -> None:
    for place, name in (('', 'fleet'), ('a', 'a'), ('a/b/c', 'c')):
        touch(tmp_path / place / 'ship.yaml', tmp_path / place / 'events.csv')
        (tmp_path / place / 'ship.yaml').write_text(f'name: {name}')
        (tmp_path / place / 'events.csv').write_text(f'events of {name}')
    touch(*(tmp_path / place / 'x.mcap' for place in ('', 'a', 'a/b', 'a/b/c', 'd')))
    found = {each.bag: each.beside for each in find([str(tmp_path)]).sources}
    assert {bag: beside.ship[6:] for bag, beside in found.items()} == {
        'x.mcap': 'fleet',
        'a/x.mcap': 'a',
        'a/b/x.mcap': 'a',
        'a/b/c/x.mcap': 'c',
        'd/x.mcap': 'fleet',
    }
    assert all(each.events == f'events of {each.ship[6:]}' for each in found.values())


def test_nothing_above_the_folder_given_speaks_for_its_bags(tmp_path: Path) -> None:
    bag = tmp_path / 'a' / 'bag'
    touch(tmp_path / 'a' / 'x.mcap', bag / 'metadata.yaml', bag / 'bag_0.mcap')
    (tmp_path / 'ship.yaml').write_text('name: of another')
    for place in (tmp_path / 'a', tmp_path / 'a' / 'x.mcap', bag):
        assert {each.beside.ship for each in find([str(place)]).sources} == {''}
    (tmp_path / 'a' / 'ship.yaml').write_text('name: own')
    for place in (tmp_path / 'a', tmp_path / 'a' / 'x.mcap', bag):  # beside what is given
        assert {each.beside.ship for each in find([str(place)]).sources} == {'name: own'}


def test_a_directory_of_rosbag2_is_one_bag(tmp_path: Path) -> None:
    bag = tmp_path / 'day' / 'bag'
    touch(bag / 'metadata.yaml', bag / 'bag_0.mcap', bag / 'bag_1.mcap', bag / 'notes.csv')
    touch(tmp_path / 'day' / 'old' / 'old_0.db3')
    found = find([str(tmp_path)])
    assert [(each.bag, len(each.files), each.folder) for each in found.sources] == [
        ('day/bag', 3, True),
        ('day/old', 1, True),
    ]


def test_the_store_is_not_searched(tmp_path: Path) -> None:
    touch(
        tmp_path / 'a.mcap', tmp_path / 'store' / 'deep' / 'b.mcap', tmp_path / 'store2' / 'c.mcap'
    )
    assert names(tmp_path, tmp_path / 'store') == ['a.mcap', 'store2/c.mcap']


def test_a_name_that_is_no_text_is_escaped(tmp_path: Path) -> None:
    path = os.fsdecode(os.fsencode(tmp_path) + b'/\xff.mcap')
    Path(path).touch()
    (source,) = find([str(tmp_path)]).sources
    assert source.bag == '\\xff.mcap'
    assert Path(source.files[0]).exists()


def test_a_file_beyond_all_measure_is_skipped(tmp_path: Path) -> None:
    with (tmp_path / 'huge.mcap').open('wb') as file:
        file.truncate(LIMIT_BYTES + 1)  # sparse: it takes no room
    (skipped,) = find([str(tmp_path)]).skipped
    assert 'cut it into parts' in skipped.reason


def test_a_ship_file_that_is_no_text_is_told_for_each_bag(tmp_path: Path) -> None:
    touch(tmp_path / 'a.mcap')
    (tmp_path / 'ship.yaml').write_bytes(b'\xff\xfe')
    (skipped,) = find([str(tmp_path)]).skipped
    assert skipped.bag == 'a.mcap'
    assert 'ship.yaml' in skipped.reason
    assert 'is not UTF-8' in skipped.reason


_SENTENCES = '$IIVHW,,T,,M,12.10,N,22.41,K*52\n$IIVHW,,T,,M,12.00,N,22.22,K*56\n' * 3
_LOGS = {
    'nmea 0183.txt': _SENTENCES,
    'signalk.jsonl': '{"context":"vessels.self","updates":[{"$source":"a","values":[]}]}\n' * 3,
    'track.gpx': '<?xml version="1.0"?>\n<gpx version="1.1"><trk></trk></gpx>\n',
    'n2k.log': '(1502979132.106111) slcan0 09F50374#000A00FFFF00FFFF\n' * 3,
}


def test_a_log_whose_name_does_not_say_so_is_known_by_its_first_bytes(tmp_path: Path) -> None:
    for name, text in _LOGS.items():
        (tmp_path / name).write_text(text)
    (tmp_path / 'packed').write_bytes(gzip.compress(_SENTENCES.encode()))
    (tmp_path / 'read me.md').write_text('Speeds by VHW, in knots.\n' * 3)
    (tmp_path / 'table.txt').write_text('time,speed_through_water\n0,6.0\n')
    (tmp_path / 'picture.png').write_bytes(b'\x89PNG\r\n\x1a\n' + bytes(64))
    (tmp_path / 'broken.gz').write_bytes(gzip.compress(_SENTENCES.encode())[:20] + bytes(64))
    found = find([str(tmp_path)])
    assert {source.bag for source in found.sources} == {*_LOGS, 'packed'}
    assert found.left_alone == 4
