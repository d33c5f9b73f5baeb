# SPDX-License-Identifier: Apache-2.0
"""Tables of numbers from which no surface and no regression comes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.bad_input.case import ROOT, SHIP_FILE, Case

Line = Callable[[Path], list[str]]
_ANGLES = (-90.0, -45.0, 0.0, 45.0, 90.0)
_GRID = tuple(f'{a},{b},{a * b + a * a}' for a in _ANGLES for b in _ANGLES)
_HULLS = tuple((ROOT / 'docs' / 'data' / 'river_ships.csv').read_text().splitlines())


def _surface(*rows: str, head: str = 'alpha,beta,c', more: tuple[str, ...] = ()) -> Line:
    """Fit a surface to a table."""

    def line(folder: Path) -> list[str]:
        path = folder / 'forces.csv'
        path.write_text('\n'.join((head, *rows)) + '\n')
        return ['surface', str(path), '--inputs', 'alpha,beta', '--target', 'c', *more]

    return line


def _residual(*rows: str, form: str = 'sirotina', more: tuple[str, ...] = ()) -> Line:
    """Fit a form to a table."""

    def line(folder: Path) -> list[str]:
        path = folder / 'models.csv'
        path.write_text('\n'.join(rows) + '\n')
        made = ('--write', str(folder / 'made.yaml')) if '--ship' in more else ()
        return ['residual', str(path), '--form', form, '--target', 'c_R', *more, *made]

    return line


def _case(kind: str, line: Line, status: int, *says: str) -> Case:
    return Case('Tables of numbers', kind, line, status, says)


CASES = (
    _case('a column that is not there', _surface(*_GRID, head='alpha,b,c'), 1, "column 'beta'"),
    _case(
        'words, nan and an empty cell among numbers',
        _surface('1,x,2', 'nan,2,3', '1,,3', *_GRID),
        1,
        "line 2, beta: 'x', expected a number",
        "line 3, alpha: 'nan', expected",
        "line 4, beta: '', expected",
    ),
    _case(
        'too few rows, and an input that does not vary',
        _surface('1,5,1', '2,5,2', '3,5,2'),
        1,
        'beta: 1 different value(s), expected 3 or more',
        '3 row(s), expected 7 or more for degree 2',
    ),
    _case(
        'inputs that follow from each other',
        _surface(*(f'{i},{2 * i},{i * i}' for i in range(20))),
        1,
        'alpha, beta: inputs follow from each other',
    ),
    _case('a header alone', _surface(), 1, 'no row below the header'),
    _case(
        'a degree of 1',
        _surface(*_GRID, more=('--max-degree', '1')),
        2,
        "'1', expected a whole number, 2 or more",
    ),
    _case(
        'a hull without block coefficient and slenderness',
        _residual('L_B,B_T,Fr,c_R', '8,4,0.1,0.001'),
        1,
        'neither C_B nor slenderness; give one, the other follows',
    ),
    _case(
        'a Froude number of 0, a negative ratio',
        _residual('L_B,B_T,C_B,Fr,c_R', '8,-4,0.8,0,0.001'),
        1,
        'B_T: -4 in row 1, expected above 0',
        'Fr: 0 in row 1, expected above 0',
    ),
    _case(
        'Sakhnovsky without lcb',
        _residual('L_B,B_T,C_B,Fr,c_R', '8,4,0.8,0.1,0.001', form='sakhnovsky'),
        1,
        "no column 'lcb'",
    ),
    _case('as many coefficients as rows', _residual(*_HULLS[:3]), 1, 'leave no scatter'),
    _case(
        'nine hulls, of which others cannot be predicted',
        _residual(*_HULLS[: 1 + 9 * 8]),
        0,
        '9 hulls determine 14 of 15 coefficients',
    ),
    _case(
        'a ship that is outside the data',
        _residual(*_HULLS, more=('--ship', str(SHIP_FILE))),
        1,
        'the fit may not be used for this hull',
        'B_T 2.51163 is outside',
    ),
)
