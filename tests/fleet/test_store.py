# SPDX-License-Identifier: Apache-2.0
"""The Parquet files of a fleet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest

from shipdrag_ros.errors import FleetError
from shipdrag_ros.fleet.store import (
    BAGS,
    COASTDOWNS,
    FROUDE,
    BagResult,
    Store,
    coastdown_schema,
    partition,
    read_bags,
    read_coastdowns,
    ship_texts,
)

SHIPS = ('Vitus Bering', 'a/b=c%20', 'Ærø\n', '..')


def result(ship: str | None, digest: str, *, many: int = 1, error: str | None = None) -> BagResult:
    bag = {
        'root': 'fleet',
        'bag': f'{digest}\n.mcap',
        'content_hash': digest,
        'software_version': '1',
        'ship': ship,
        'coastdowns': many,
        'messages': 10,
        'warnings': ['one', 'two'],
        'error': error,
    }
    row: dict[str, Any] = dict.fromkeys(coastdown_schema().names)
    row |= {name: bag[name] for name in ('bag', 'content_hash', 'software_version')}
    row |= {'flags': ['cut'], 'facts': [], 'froude': FROUDE, 'resistance_m_s2': FROUDE * np.nan}
    rows = [{**row, 'time_ns': 100 - n} for n in range(many)]
    return BagResult(bag, tuple(rows))


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for number, ship in enumerate(SHIPS):
        store.write(result(ship, f'{number:064x}', many=2))
    store.write(result(None, 'f' * 64, many=0, error='broken'))
    table = read_coastdowns(tmp_path)
    assert table.schema == coastdown_schema()
    assert sorted(set(table['ship'].to_pylist())) == sorted(SHIPS)
    assert table['time_ns'].to_pylist() == [99, 100] * len(SHIPS)
    row = table.to_pylist()[0]
    np.testing.assert_array_equal(row['froude'], FROUDE)
    assert np.isnan(row['resistance_m_s2']).all()
    assert row['clean_m_s2'] is None
    assert row['flags'] == ['cut']
    bags = read_bags(tmp_path).to_pylist()
    assert [bag['error'] for bag in bags] == [None] * len(SHIPS) + ['broken']
    assert store.done()['f' * 64].error == 'broken'
    # no name of a ship leads out of the store
    assert {path.parent for path in (tmp_path / COASTDOWNS).iterdir()} == {tmp_path / COASTDOWNS}


def test_other_tools_read_the_partitions(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for number, ship in enumerate(('Vitus Bering', 'Alder')):
        store.write(result(ship, f'{number:064x}', many=2))
    question = (
        f"SELECT ship, count(*) FROM read_parquet('{tmp_path}/coastdowns/**/*.parquet', "
        'hive_partitioning=true) GROUP BY ship ORDER BY ship'
    )
    assert duckdb.sql(question).fetchall() == [('Alder', 2), ('Vitus Bering', 2)]


def test_new_rows_of_a_bag_replace_the_former(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.write(result('Alder', '0' * 64, many=3))
    store.write(result('Birch', '0' * 64, many=1))
    assert read_coastdowns(tmp_path)['ship'].to_pylist() == ['Birch']
    store.remove('0' * 64)
    assert len(read_coastdowns(tmp_path)) == len(read_bags(tmp_path)) == 0


def test_what_a_killed_run_left_half_written_is_removed(tmp_path: Path) -> None:
    Store(tmp_path).write(result('Alder', '0' * 64))
    left = tmp_path / COASTDOWNS / partition('Alder') / '.new-1-x.parquet'
    left.write_bytes(b'half')
    Store(tmp_path)
    assert not left.exists()
    assert len(read_coastdowns(tmp_path)) == 1


def test_files_of_a_ship_are_kept(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.keep_ship('a/b', {'ship.yaml': 'name: a/b', 'events.csv': ''})
    assert ship_texts(tmp_path) == {'a/b': {'ship.yaml': 'name: a/b'}}


def test_no_store_and_a_broken_one_are_told(tmp_path: Path) -> None:
    with pytest.raises(FleetError, match='is no store of a fleet; make one with `shipdrag fleet'):
        read_bags(tmp_path)
    Store(tmp_path)
    (tmp_path / BAGS / 'x.parquet').write_bytes(b'no Parquet')
    with pytest.raises(FleetError, match='remove it and run `shipdrag fleet` again'):
        read_bags(tmp_path)
    (tmp_path / 'file').touch()
    with pytest.raises(FleetError, match='give one that may be written'):
        Store(tmp_path / 'file')
