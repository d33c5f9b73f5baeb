# SPDX-License-Identifier: Apache-2.0
"""Bad ship files and bad tables."""

from __future__ import annotations

from pathlib import Path

from tests.bad_input.case import SHIP_FILE, Case

_SMALL = 'length_m: 150.0\ndisplaced_volume_m3: 20200.0\n'
_HEADER = 'time,speed\n'
_TABLE = _HEADER + ''.join(f'{t},{8.0 - 0.01 * t}\n' for t in range(100))
_MAP = ('--time', 'time', '--map', 'speed_through_water=speed')


def _ship(kind: str, content: str | bytes, *says: str, status: int = 1) -> Case:
    def line(folder: Path) -> list[str]:
        path = folder / 'ship.yaml'
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return ['simulate', '--ship', str(path), '-o', str(folder / 'bag.mcap')]

    return Case('Ship files', kind, line, status, says)


def _changed(old: str, new: str) -> str:
    text = SHIP_FILE.read_text(encoding='utf-8')
    assert old in text
    return text.replace(old, new, 1)


def _csv(
    kind: str, content: str | bytes, *says: str, status: int = 1, arguments: tuple[str, ...] = _MAP
) -> Case:
    def line(folder: Path) -> list[str]:
        path = folder / 'table.csv'
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return ['import', str(path), '-o', str(folder / 'bag.mcap'), *arguments]

    return Case('CSV files', kind, line, status, says)


def _missing_ship(folder: Path) -> list[str]:
    return ['simulate', '--ship', str(folder / 'ship.yml'), '-o', str(folder / 'bag.mcap')]


SHIPS = (
    Case(
        'Ship files',
        'a file that is not there',
        _missing_ship,
        1,
        ('cannot be read: No such file or directory; give the path',),
    ),
    _ship('an empty file', '', 'the file: empty, expected the keys name, length_m'),
    _ship(
        'not YAML', 'length_m: [150.0\nbreadth_m 21.6\n', 'not YAML: line 3, column 1: expected'
    ),
    _ship('a binary file', bytes(range(256)), 'is not a text file', 'save it as UTF-8'),
    _ship(
        'a list for a mapping',
        '- length_m: 150.0\n- displaced_volume_m3: 20200.0\n',
        'is no ship file, none of its keys is known',
        'length_m',
    ),
    _ship(
        'tonnes, under a key of their own',
        'length_m: 150.0\ndisplacement_t: 20705.0\n',
        'displacement_t: unknown key; did you mean displaced_volume_m3?',
    ),
    _ship(
        'tables of different lengths',
        _changed('[0.0, 0.12, 0.18,', '[0.0, 0.18,'),
        'baseline.wave_coefficient: 5 values, expected 4',
    ),
    _ship(
        'several of these at once',
        'length_m: 492 ft\nspeed: 8\nbreadth_m: -1\n',
        'ship.yaml: 4 problem(s)',
        'speed: unknown key',
        "'492 ft'",
        'breadth_m: -1',
    ),
    _ship(
        'no baseline, where one is needed',
        _SMALL,
        'has no baseline resistance; add `baseline` to its ship file',
    ),
)
TABLES = (
    _csv('an empty file', '', "'table.csv' is empty; give a log or a table"),
    _csv(
        'a header and no row',
        _HEADER,
        'gave no sample from 0 row(s); give a table with a line a sample',
    ),
    _csv(
        'a column that is not there',
        _TABLE.replace('speed', 'log'),
        "has no column 'speed'; it has 'time', 'log'",
    ),
    _csv(
        'an unknown input',
        _TABLE,
        "no input 'stw'; inputs are speed_through_water",
        arguments=('--time', 'time', '--map', 'stw=speed'),
    ),
    _csv(
        'no column of a time',
        'count,speed\n0,8.0\n1,7.9\n',
        "has no column that is known as a time; it has 'count', 'speed'",
        'Give --time COLUMN[:unit], or --rate HZ',
        arguments=('--map', 'speed_through_water=speed'),
    ),
    _csv(
        'words in all cells',
        _HEADER + '0,fast\n1,slow\n',
        'gave no sample from 2 row(s)',
        "line 2: 'fast'",
        'expected numbers',
    ),
    _csv(
        'NaN and inf in cells',
        _TABLE.replace(',7.9\n', ',nan\n').replace(',7.8\n', ',inf\n'),
        "2 rejected, not a number: line 12: 'nan', line 22: 'inf'",
        status=0,
    ),
    _csv(
        'dates whose day and month are ambiguous',
        _HEADER + '03/04/2026 08:00:00,8.0\n03/04/2026 08:00:01,7.9\n',
        'day and month are ambiguous',
        'give --date-order dmy or --date-order mdy',
    ),
    _csv(
        'equal times',
        _TABLE.replace('\n11,', '\n10,').replace('\n12,', '\n10,'),
        '2 rows have the stamp of an earlier one; a replay rejects those.',
        status=0,
    ),
    _csv(
        'times that go back',
        _TABLE.replace('\n50,', '\n20,'),
        '1 rows are stamped before an earlier one; a replay rejects those, or begins '
        'again where 3 in a row are more than 10 s back.',
        status=0,
    ),
    _csv(
        'separated by *',
        _TABLE.replace(',', '*'),
        "it has 'time*speed', and no comma, semicolon or tab",
    ),
    _csv(
        'UTF-16, as some spreadsheets save',
        _TABLE.encode('utf-16'),
        "'table.csv' is in UTF-16; save it as UTF-8",
    ),
    _csv(
        'commas that may be those of thousands',
        'time;speed\n' + ''.join(f'{t};8,{100 + t}\n' for t in range(100)),
        "100 rejected, not a number: line 2: '8,100'",
        'expected numbers with a decimal point',
    ),
    _csv(
        'rows too short and too long',
        _TABLE.replace('10,7.9\n', '10\n11,7.8,3,4\n'),
        '1 rejected, empty: line 12',
        "1 rejected, more than 2 columns: line 13: '11,7.8,3,4'",
        status=0,
    ),
    _csv(
        'bytes 0 in the middle',
        _TABLE.encode() + bytes(100) + b'\n100,7.0\n',
        'time: 1 rejected, not a number: line 102',
        status=0,
    ),
    _csv(
        'a spreadsheet (.xlsx)',
        b'PK\x03\x04' + bytes(range(256)) * 8,
        "is no text, it begins with 'PK",
        'save it as CSV',
    ),
)
CASES = (*SHIPS, *TABLES)
