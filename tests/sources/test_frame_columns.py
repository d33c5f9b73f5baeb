# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers: the samples of their texts, without a step of Python for each row."""

from __future__ import annotations

import sys
from decimal import Decimal
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shipdrag_ros as sd
from shipdrag_ros.samples import Block
from shipdrag_ros.sources.formats.csv.cells import BadCell, CellReader, row_clock
from shipdrag_ros.sources.formats.csv.table import NANOSECONDS, LogTable, parse_time

COLUMNS = {
    'speed_through_water': 'log:kn',
    'position': ('lat:deg', 'lon:deg'),
    'heading': 'yaw:compass',
}


def frame(rows: int) -> pd.DataFrame:
    """A frame of plausible numbers, seed 5; some are none."""
    rng = np.random.default_rng(5)
    time_s = np.arange(rows) * 0.1
    table = pd.DataFrame(
        {
            't': time_s,
            'log': rng.normal(12.0, 0.1, rows),
            'lat': 45.0 + time_s * 1e-6,
            'lon': rng.uniform(-180.0, 360.0, rows),
            'yaw': rng.uniform(0.0, 360.0, rows),
        }
    )
    table.loc[7, 'log'], table.loc[8, 'log'], table.loc[9, 'lat'] = np.nan, np.inf, 91.0
    return table


def samples(source: Any) -> Block:
    return sd.read(source, columns=COLUMNS, time='t').samples()


def test_a_frame_gives_the_samples_of_its_table(tmp_path: Any) -> None:
    table = frame(3000)
    table.to_csv(tmp_path / 'a.csv', index=False)
    one, other = samples(table), samples(tmp_path / 'a.csv')
    for name in ('channel', 'stamp_ns', 'receive_ns', 'value'):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert len(one) == 3 * 3000 - 3


def test_no_step_of_python_for_each_row() -> None:
    calls = {}
    for rows in (2000, 42_000):
        table = frame(rows)
        sd.read(table, columns=COLUMNS, time='t')
        count = [0]
        sys.setprofile(lambda *_, count=count: count.__setitem__(0, count[0] + 1))
        sd.read(table, columns=COLUMNS, time='t')
        sys.setprofile(None)
        calls[rows] = count[0]
    # the remainder of an angle is the one step that a row costs, of the C library
    assert calls[42_000] - calls[2000] < 4 * 40_000


@pytest.mark.parametrize('unit', NANOSECONDS)
@given(
    values=st.lists(
        st.one_of(
            st.floats(0.0, 2e9),
            st.floats(-2e9, 2e9).map(lambda value: round(value, 3)),
            st.integers(0, 2**31).map(float),
            st.just(float('nan')),
        ),
        min_size=1,
        max_size=20,
    )
)
def test_counts_as_numbers_are_the_times_of_their_texts(unit: str, values: list[float]) -> None:
    table = LogTable.__new__(LogTable)
    found = []
    texts = [repr(each) if each == each else '' for each in values]
    for cells in (np.array(values), np.array(texts, object)):
        bad: dict[int, BadCell] = {}
        clock = row_clock(parse_time(f't:{unit}'), None, np.array([], object), table)
        times = clock.times(cells, bad)
        found.append([None if place in bad else int(t) for place, t in enumerate(times)])
    assert found[0] == found[1]
    first = values[0]
    if found[0][0] is not None:
        exact = Decimal(repr(first)) * NANOSECONDS[unit]
        assert found[0][0] - (clock.base_ns or 0) == int(exact.to_integral_value())


@given(
    st.lists(st.floats(-400.0, 400.0).map(lambda value: round(value, 4)), min_size=1),
    st.sampled_from(['', 'NS', 'EW']),
)
def test_numbers_and_their_texts_are_read_alike(values: list[float], side: str) -> None:
    read = CellReader(side=side)
    texts = np.array([f'{value:.4f}' for value in values], object)
    bad: list[dict[int, BadCell]] = [{}, {}]
    one, other = read.all(np.array(values), bad[0]), read.all(texts, bad[1])
    assert np.array_equal(one, other, equal_nan=True)
    assert {k: each.reason for k, each in bad[0].items()} == {
        k: each.reason for k, each in bad[1].items()
    }
    assert all(float(each.cell) == values[k] for k, each in bad[0].items())


def test_two_columns_of_one_name_are_refused() -> None:
    table = frame(20)
    with pytest.raises(sd.ShipdragError, match="the frame has 2 columns 'log'"):
        sd.read(pd.concat([table, table[['log']]], axis=1))
