# SPDX-License-Identifier: Apache-2.0
"""Tables of numbers from which no surface and no regression comes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.bad_input.case import ROOT, Case

Line = Callable[[Path], list[str]]
_ANGLES = (-90.0, -45.0, 0.0, 45.0, 90.0)
_GRID = tuple(f'{a},{b},{a * b + a * a}' for a in _ANGLES for b in _ANGLES)
_HULLS = tuple((ROOT / 'docs' / 'data' / 'river_ships.csv').read_text().splitlines())


def _surface(*rows: str) -> Line:
    """Fit a surface to a table."""

    def line(folder: Path) -> list[str]:
        path = folder / 'forces.csv'
        path.write_text('\n'.join(('alpha,beta,c', *rows)) + '\n')
        return ['surface', str(path), '--inputs', 'alpha,beta', '--target', 'c']

    return line


def _residual(*rows: str) -> Line:
    """Fit a form to a table."""

    def line(folder: Path) -> list[str]:
        path = folder / 'models.csv'
        path.write_text('\n'.join(rows) + '\n')
        return ['residual', str(path), '--form', 'sirotina', '--target', 'c_R']

    return line


def _case(kind: str, line: Line, *says: str, status: int = 1) -> Case:
    return Case('Tables of numbers', kind, line, status, says)


CASES = (
    _case(
        'words, nan and an empty cell among numbers',
        _surface('1,x,2', 'nan,2,3', '1,,3', *_GRID),
        "line 2, beta: 'x', expected a number",
        "line 3, alpha: 'nan', expected",
        "line 4, beta: '', expected",
    ),
    _case(
        'too few rows, and an input that does not vary',
        _surface('1,5,1', '2,5,2', '3,5,2'),
        'beta: 1 different value(s), expected 3 or more',
        '3 row(s), expected 7 or more for degree 2',
    ),
    _case('a header alone', _surface(), 'no row below the header'),
    _case(
        'a Froude number of 0, a negative ratio',
        _residual('L_B,B_T,C_B,Fr,c_R', '8,-4,0.8,0,0.001'),
        'B_T: -4 in row 1, expected above 0',
        'Fr: 0 in row 1, expected above 0',
    ),
    _case('as many coefficients as rows', _residual(*_HULLS[:3]), 'leave no scatter'),
    _case(
        'nine hulls, of which others cannot be predicted',
        _residual(*_HULLS[: 1 + 9 * 8]),
        '9 hulls determine 14 of 15 coefficients',
        status=0,
    ),
)
