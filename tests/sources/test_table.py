# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers: all of them, or every reason why not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.errors import DataError
from shipdrag_ros.sources.formats.csv.table import read_numbers


@pytest.mark.parametrize('mark', [',', ';', '\t'])
def test_reads_columns_by_name(tmp_path: Path, mark: str) -> None:
    path = tmp_path / 'data.csv'
    path.write_text('a,b,c\n1,x,-2e-3\n\n4,y,.5\n'.replace(',', mark))
    found = read_numbers(str(path), ('c', 'a'), optional=('a', 'd'))
    assert found.names == ('c', 'a')
    np.testing.assert_array_equal(found.values, [[-2e-3, 1.0], [0.5, 4.0]])
    np.testing.assert_array_equal(found.column('a'), [1.0, 4.0])


def test_all_bad_cells_are_told_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / 'data.csv'
    path.write_text('a,b\n1,2\nnan,inf\n3\n1e9999,1_0\n5,-2e30\n-1e-40,1e30\n')
    with pytest.raises(DataError) as raised:
        read_numbers(path, ('a', 'b'))
    assert raised.value.problems == (
        "line 3, a: 'nan', expected a number, at most 1e+30 in size",
        "line 3, b: 'inf', expected a number, at most 1e+30 in size",
        "line 4, b: '', expected a number, at most 1e+30 in size",
        "line 5, a: '1e9999', expected a number, at most 1e+30 in size",
        "line 5, b: '1_0', expected a number, at most 1e+30 in size",
        "line 6, b: '-2e30', expected a number, at most 1e+30 in size",
    )


def test_a_decimal_comma_is_told(tmp_path: Path) -> None:
    path = tmp_path / 'data.csv'
    path.write_text('a;b\n1,5;1.5\n')
    with pytest.raises(DataError, match=r"a: '1,5', expected a number, .*; write a decimal point"):
        read_numbers(path, ('a', 'b'))


def test_many_bad_cells_are_counted(tmp_path: Path) -> None:
    path = tmp_path / 'data.csv'
    path.write_text('a\n' + 'x\n' * 50)
    with pytest.raises(DataError, match='and 30 more'):
        read_numbers(path, ('a',))
