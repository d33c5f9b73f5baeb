# SPDX-License-Identifier: Apache-2.0
"""Files and frames of one ship become one record."""

from __future__ import annotations

import gc
import struct
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest
from mcap.reader import make_reader

import shipdrag_ros as sd
from shipdrag_ros.samples import Channel

LOG = {'speed_through_water': 'log:kn'}
KNOT = 1852.0 / 3600.0
SHIP = sd.Ship(name='Coaster', length_m=80.0, displaced_volume_m3=4000.0)


def table(count: int = 60) -> dict[str, Any]:
    seconds = np.arange(float(count))
    return {'t': seconds, 'log': 12.0 / (1.0 + seconds / 700.0), 'revs': np.full(count, 90.0)}


def dates(count: int = 60, *, later_s: int = 0) -> Any:
    start = pd.Timestamp('2026-03-01T08:00:00') + pd.Timedelta(later_s, unit='s')
    return start + pd.to_timedelta(np.arange(count), unit='s')


def speeds(record: sd.Record) -> Any:
    block = record.samples()
    return block.value[block.channel == Channel.SPEED_THROUGH_WATER, 0]


@pytest.mark.parametrize('make', [pd.DataFrame, pl.DataFrame])
def test_a_frame_gives_the_numbers_that_are_in_it(make: Any) -> None:
    data = table()
    record = sd.read(make(data), ship=SHIP, columns=LOG, time='t')
    assert speeds(record).tolist() == (data['log'] * KNOT).tolist()
    assert record.ship == SHIP
    assert repr(record) == '<Record: Coaster, 1 run, 60 messages>'


@pytest.mark.parametrize('zone', [None, 'Europe/Rome'])
def test_dates_are_read_in_utc(zone: str | None) -> None:
    frame = pd.DataFrame(table()).drop(columns='t')
    frame.index = dates().tz_localize(zone) if zone else dates()
    record = sd.read(frame, columns=LOG)
    hour = 7 if zone else 8
    assert record.samples().stamp_ns[0] == pd.Timestamp(f'2026-03-01T{hour:02d}:00Z').value
    polars = pl.DataFrame({**table(), 'when': dates().to_numpy()}).drop('t')
    if zone:
        polars = polars.with_columns(pl.col('when').dt.replace_time_zone(zone))
    again = sd.read(polars, columns=LOG)
    assert again.samples().stamp_ns.tolist() == record.samples().stamp_ns.tolist()


def test_missing_values_are_counted_and_not_made_up() -> None:
    frame = pd.DataFrame(table())
    frame.loc[3, 'log'] = np.nan
    frame.loc[4, 'log'] = np.inf
    record = sd.read(frame, columns=LOG, time='t')
    assert len(speeds(record)) == 58
    assert any('empty' in note for note in record.notes)
    assert any('not a number' in note for note in record.notes)


def test_a_table_is_read_as_the_frame_of_it(tmp_path: Path) -> None:
    frame = pd.DataFrame(table())
    frame.to_csv(tmp_path / 'log.csv', index=False)
    told = {'columns': LOG, 'time': 't'}
    one, other = sd.read(tmp_path / 'log.csv', **told), sd.read(frame, **told)
    assert speeds(one).tolist() == speeds(other).tolist()
    assert one.runs[0].name == str(tmp_path / 'log.csv')


def test_rows_a_second_instead_of_times() -> None:
    record = sd.read(pd.DataFrame(table()), columns=LOG, rate_hz=2.0)
    assert np.diff(record.samples().stamp_ns).tolist() == [500_000_000] * 59


def test_files_that_follow_each_other_are_one_run() -> None:
    first, second = (
        pd.DataFrame(table(), index=dates(later_s=s)).drop(columns='t') for s in (0, 60)
    )
    record = sd.read([second, first], columns=LOG)
    assert len(record.runs) == 1
    assert np.diff(record.samples().stamp_ns).tolist() == [10**9] * 119


def test_instruments_of_the_same_time_are_one_run() -> None:
    whole = pd.DataFrame(table(), index=dates()).drop(columns='t')
    told = {**LOG, 'shaft': 'revs:rpm'}
    both = sd.read([whole[['log']], whole[['revs']]], columns=told)
    assert len(both.runs) == 1
    assert {topic.input for topic in both.runs[0].topics} == {'speed_through_water', 'shaft'}


def test_days_apart_and_tests_without_dates_are_runs_of_their_own() -> None:
    near, far = (
        pd.DataFrame(table(), index=dates(later_s=s)).drop(columns='t') for s in (0, 86_400)
    )
    assert len(sd.read([near, far], columns=LOG).runs) == 2
    tests = [pd.DataFrame(table()), pd.DataFrame(table())]
    assert len(sd.read(tests, columns=LOG, time='t').runs) == 2


def test_bags_are_a_run_each(bag: Path, record: sd.Record, tmp_path: Path) -> None:
    read = sd.read([bag])
    assert read.ship == record.ship
    assert read.to_frame().equals(record.to_frame())
    other = sd.Ship(name='other', length_m=90.0, displaced_volume_m3=5000.0)
    given = sd.read(str(bag), ship=other)
    saved = sd.read(given.save(tmp_path / 'saved.mcap'))
    assert given.ship == saved.ship == other
    assert saved.to_frame().equals(record.to_frame())
    third = replace(other, name='third')
    path = sd.read(tmp_path / 'saved.mcap', ship=third).save(tmp_path / 'again.mcap')
    was = record.runs[0].attachments
    now = was | {'ship.yaml': third.to_yaml(), 'recorded_ship.yaml': was['ship.yaml']}
    with path.open('rb') as file:  # each of them once
        held = [(each.name, each.data.decode()) for each in make_reader(file).iter_attachments()]
    assert sorted(held) == sorted(now.items())


def test_what_was_read_can_be_saved_with_its_ship(tmp_path: Path) -> None:
    record = sd.read(pd.DataFrame(table()), ship=SHIP, columns=LOG, time='t')
    saved = sd.read(record.save(tmp_path / 'saved.mcap'))
    assert saved.ship == SHIP
    assert speeds(saved).tolist() == speeds(record).tolist()
    with pytest.raises(sd.ShipdragError, match='exists; choose another name'):
        record.save(tmp_path / 'saved.mcap')
    (tmp_path / 'log').mkdir()
    bare = sd.read(pd.DataFrame(table()), columns=LOG, time='t').save(tmp_path / 'log/bare.mcap')
    (tmp_path / 'log/ship.yaml').write_text(SHIP.to_yaml())
    assert sd.read(sd.read(bare).save(tmp_path / 'away.mcap')).ship == SHIP


@pytest.mark.parametrize('packed', ['file', 'message'])
def test_what_rosbag2_has_packed_is_saved_unpacked(tmp_path: Path, packed: str) -> None:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    writer = Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode[packed.upper()], CompressionFormat.ZSTD)
    kind, store = 'geometry_msgs/msg/TwistStamped', get_typestore(Stores.ROS2_JAZZY)
    with writer:
        topic = writer.add_connection('/speed_through_water', kind, typestore=store)
        reading = struct.pack('<4xiI4sx3x6d', 10**9, 0, b'\1', 5.0, *[0.0] * 5)
        writer.write(topic, 10**18, b'\0\1' + reading[2:])
    saved = sd.read(tmp_path / 'bag').save(tmp_path / 'saved.mcap')
    assert speeds(sd.read(saved)).tolist() == [5.0]


def test_what_cannot_be_read_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(sd.ShipdragError, match='does not exist'):
        sd.read('missing.mcap')
    with pytest.raises(sd.ShipdragError, match='no row'):
        sd.read(pd.DataFrame({'log': []}), columns=LOG)
    with pytest.raises(sd.ShipdragError, match="no column 'log'"):
        sd.read(pd.DataFrame({'t': [1.0], 'speed': [2.0]}), columns=LOG, time='t')
    with pytest.raises(sd.ShipdragError, match='give a bag, a log or a table'):
        sd.read([])
    (tmp_path / 'ship.yaml').write_text('length_m: -1')
    with pytest.raises(sd.ShipdragError, match='length_m'):
        sd.read(pd.DataFrame(table()), ship=tmp_path / 'ship.yaml', columns=LOG, time='t')


@pytest.mark.parametrize('source', [None, 3, {'a': [1]}, np.zeros((3, 2)), [None]])
def test_what_is_no_source_is_refused(source: Any) -> None:
    with pytest.raises(sd.ShipdragError, match='is no source; give the path'):
        sd.read(source)


def test_a_frame_is_named_and_its_arguments_too(tmp_path: Path) -> None:
    speed = pd.DataFrame({'speed_through_water': table()['log']})
    with pytest.raises(sd.ShipdragError, match=r"'frame' has no column that is .* a time.*time="):
        sd.read(speed)
    with pytest.raises(sd.ShipdragError, match=r'frame\.collect\(\)'):
        sd.read(pl.LazyFrame(table()))
    for columns in (['log'], {'speed_through_water': 1}, {'speed_through_water': None}):
        with pytest.raises(sd.ShipdragError, match='give the column of each input'):
            sd.read(speed, columns=columns, rate_hz=1.0)  # type: ignore[arg-type]
    with pytest.raises(sd.ShipdragError, match=r'cannot be (written|made)'):
        sd.read(speed, rate_hz=1.0, columns={'speed_through_water': '1'}).save(
            tmp_path / 'none' / 'a.mcap'
        )


def test_a_frame_with_the_names_of_the_inputs_and_an_index_of_dates_is_si() -> None:
    frame = pd.DataFrame({'speed_through_water': table()['log']}, index=dates())
    assert speeds(sd.read(frame)).tolist() == table()['log'].tolist()


def test_what_is_no_ship_is_refused() -> None:
    with pytest.raises(sd.ShipdragError, match='expected a Ship'):
        sd.read(pd.DataFrame(table()), ship=4, columns=LOG, time='t')  # type: ignore[arg-type]


def test_no_file_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    record = sd.read(pd.DataFrame(table()), columns=LOG, time='t')
    simulated = sd.simulate(sd.Ship.example(), duration_s=10.0, lead_in_s=10.0)
    assert len(simulated.samples()) > 10
    del record, simulated
    gc.collect()
    assert list(tmp_path.iterdir()) == []


def places(latitude: float) -> pd.DataFrame:
    """A minute of a ship that goes north, with dates."""
    going = latitude + np.arange(60.0) * 5e-5
    return pd.DataFrame({'lat': going, 'lon': np.full(60, 10.25)}, index=dates())


def test_a_ship_is_nowhere_twice_at_one_time() -> None:
    columns = {'position': ('lat:deg', 'lon:deg')}
    receivers = sd.read([places(54.5), places(54.5005)], columns=columns)
    assert len(receivers.runs) == 1
    with pytest.raises(sd.ShipdragError, match='are 11 km apart about 2026-03-01 08:00'):
        sd.read([places(54.5), places(54.6)], columns=columns)


def test_bags_of_two_ships_are_refused(tmp_path: Path) -> None:
    other = sd.Ship(name='Other', length_m=90.0, displaced_volume_m3=5000.0)
    bags = [
        sd.read(pd.DataFrame(table()), ship=ship, columns=LOG, time='t').save(tmp_path / name)
        for ship, name in ((SHIP, 'one.mcap'), (other, 'two.mcap'))
    ]
    with pytest.raises(sd.ShipdragError, match=r"is of 'Coaster' and .* of 'Other'"):
        sd.read(bags)
    with pytest.raises(sd.ShipdragError, match=r"is of 'Coaster' .* with ship='FILE'"):
        sd.diagnose([sd.read(bag) for bag in bags])
    assert sd.read(bags, ship=SHIP).ship == SHIP


def test_options_of_the_import(tmp_path: Path) -> None:
    path = tmp_path / 'log.csv'
    path.write_text('time,STW\n' + ''.join(f'{k},{12.0 - k / 100.0}\n' for k in range(60)))
    with pytest.raises(sd.ShipdragError, match=r"options=\{'speed_unit': 'kn'\}") as refused:
        sd.read(path)
    assert ' --' not in str(refused.value)
    assert speeds(sd.read(path, options={'speed_unit': 'kn'}))[0] == 12.0 * KNOT
    for options, why in (
        ({'speed_unit': 'furlong'}, 'expected one of'),
        ({'rate': 1.0}, 'give rate_hz='),
        ({'unit': 'kn'}, 'there are date, '),
        ({'gear': 2.0}, 'has no use for it'),
        ({'format': 'txt'}, 'there are ardupilot, '),
    ):
        with pytest.raises(sd.ShipdragError, match=why):
            sd.read(path, options={'speed_unit': 'kn', **options})
    with pytest.raises(sd.ShipdragError, match='give each with its value'):
        sd.read(path, options=['speed_unit'])  # type: ignore[arg-type]


def test_arguments_that_a_bag_has_no_use_for_are_named(bag: Path) -> None:
    assert sd.read(bag, time='t').notes == ('time= not used: they are for logs and tables',)


def test_a_folder_of_logs_says_what_to_give(tmp_path: Path) -> None:
    (tmp_path / 'log.csv').write_text('time,STW [kn]\n0,12.0\n')
    with pytest.raises(sd.ShipdragError, match=r"holds log\.csv\. Logs are given .*log\.csv'"):
        sd.read(tmp_path)
