# SPDX-License-Identifier: Apache-2.0
"""Tables as people and spreadsheets write them: taken right, or refused, never taken wrong."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.sources.format import Job
from shipdrag_ros.sources.formats.csv.importer import FORMAT
from shipdrag_ros.sources.log import Log
from shipdrag_ros.sources.reading import read_any

SPEED = 5.0  # m/s, to the north


def read(folder: Path, header: str, rows: Iterable[str]) -> tuple[Block, str]:
    """Return the samples of a table, and what is shown of it."""
    path = folder / 'log.csv'
    path.write_text('\n'.join([header, *rows]) + '\n')
    shown: list[list[str]] = []
    (run,) = read_any([path], show=shown.append)
    block = run.inputs().block()
    return block, '\n'.join(shown[0])


def of(block: Block, channel: Channel) -> np.ndarray:
    return block.value[block.channel == channel]


def clock(second: int) -> str:
    return f'12:{second // 60:02d}:{second % 60:02d}'


def latitude(second: int) -> str:
    return f'{54.5 + math.degrees(SPEED * second / 6.371e6):.6f}'


@pytest.mark.parametrize(('written', 'degrees'), [('200.5', -159.5), ('110.25', 110.25)])
def test_a_longitude_in_degrees_stays_one(tmp_path: Path, written: str, degrees: float) -> None:
    rows = [
        f'2018-03-02T{clock(i)}Z,{latitude(i)},{"999.9" if i == 50 else written}'
        for i in range(100)
    ]
    block, shown = read(tmp_path, 'time,Lat,Lon', rows)
    assert set(of(block, Channel.POSITION_GEODETIC)[:, 1]) == {degrees}
    assert "line 52: '999.9'" in shown


def test_a_time_in_small_steps_and_no_unit_is_taken_as_seconds(tmp_path: Path) -> None:
    block, said = read(tmp_path, 't,STW [kn]', [f'{i},10.{i % 10}' for i in range(60)])
    assert np.ptp(block.stamp_ns) == 59 * 10**9
    assert 'states no unit and is taken as s' in said


def test_longitudes_in_the_column_of_latitudes_are_none(tmp_path: Path) -> None:
    rows = [f'{i},110.25,{latitude(i)},10' for i in range(20)]
    block, shown = read(tmp_path, 'time,Lat,Lon,STW [kn]', rows)
    assert len(of(block, Channel.POSITION_GEODETIC)) == 0
    assert 'position: 20 rejected' in shown


@pytest.mark.parametrize(
    ('north', 'east', 'expected'),
    [
        ('5430.6', '01015.0', (54.51, 10.25)),
        ('5430.6N', '01015.0W', (54.51, -10.25)),
        ('0030.6', '00015.0', (0.51, 0.25)),
        ('130.6', '215.0', (1.51, 2.25)),
    ],
)
def test_degrees_and_minutes_in_one_number(tmp_path, north, east, expected):
    rows = [f'{i},{north},{east},10' for i in range(20)]
    block, _ = read(tmp_path, 'time,Lat,Lon,STW [kn]', rows)
    np.testing.assert_allclose(of(block, Channel.POSITION_GEODETIC)[:, :2], [expected] * 20)


@pytest.mark.parametrize(
    ('name', 'first', 'step', 'why'),
    [
        ('time [min]', 0.0, 1.0, 'is said to be in'),
        ('Time (h)', 0.0, 1.0, 'is said to be in'),
        ('time', 43161.5, 1 / 86400, 'as the days of a spreadsheet do'),
        ('t', 0.0, 100.0, r'its steps are 100\. Give --time t:ms, or :s'),
    ],
)
def test_a_time_of_which_the_unit_is_not_clear_is_refused(tmp_path, name, first, step, why):
    rows = [f'{first + step * i:.8f},10.{i % 10}' for i in range(60)]
    with pytest.raises(ImportDataError, match=why):
        read(tmp_path, f'{name},STW [kn]', rows)


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('Rudder [%]', '30'),
        ('Heading [mrad]', '3000'),
        ('RPM [1/s]', '1.5'),
        ('Shaft [kn]', '5'),
        ('Lat [m],Lon [m]', '50,60'),
    ],
)
def test_a_unit_that_does_not_fit_is_said_and_not_used(tmp_path, name: str, value: str) -> None:
    block, shown = read(tmp_path, f'time,STW [kn],{name}', [f'{i},10,{value}' for i in range(20)])
    assert set(block.channel.tolist()) == {Channel.SPEED_THROUGH_WATER}
    assert 'Not used: ' in shown


@pytest.mark.parametrize(('unit', 'factor'), [('mph', 0.44704), ('ft/s', 0.3048)])
def test_a_stated_unit_that_agrees_with_the_way_is_taken(tmp_path, unit, factor):
    rows = [f'2018-03-02T{clock(i)}Z,{latitude(i)},10.25,{SPEED / factor:.4f}' for i in range(100)]
    block, _ = read(tmp_path, f'time,Lat,Lon,SOG [{unit}]', rows)
    np.testing.assert_allclose(of(block, Channel.SPEED_OVER_GROUND)[:, 0], SPEED, rtol=1e-4)


@pytest.mark.parametrize(
    ('header', 'row'),
    [
        ('Date;Time;STW [kn]', '22.03.2018 00:00:00;{};10,25'),  # a spreadsheet's midnight
        ('time,STW [kn]', '2018-03-22 {} UTC,10'),
    ],
)
def test_a_date_is_read_however_it_is_written(tmp_path: Path, header: str, row: str) -> None:
    block, _ = read(tmp_path, header, [row.format(clock(i)) for i in range(20)])
    assert block.stamp_ns[0] == 1_521_720_000 * 10**9  # 2018-03-22 12:00:00
    assert np.all(np.diff(block.stamp_ns) == 10**9)


def test_rows_that_change_places_at_midnight_stay_in_their_day(tmp_path: Path) -> None:
    times = ['23:59:58', '23:59:59', '00:00:00', '23:59:59', '00:00:01', '00:00:02']
    block, _ = read(tmp_path, 'time,STW [kn]', [f'{each},10' for each in times])
    assert block.stamp_ns.max() - block.stamp_ns.min() == 4 * 10**9


def test_thousands_with_points_beside_decimal_commas_are_refused(tmp_path: Path) -> None:
    rows = [f'{i};10,25;1.234;3,5' for i in range(20)]
    block, shown = read(tmp_path, 'time;STW [kn];Shaft [rpm];Rudder [deg]', rows)
    assert set(block.channel.tolist()) == {Channel.SPEED_THROUGH_WATER, Channel.RUDDER}
    assert 'shaft: 20 rejected' in shown


def test_lines_behind_an_open_quotation_mark_are_said(tmp_path: Path) -> None:
    rows = [f'{i},10,{chr(34) if i == 20 else ""}x' for i in range(50)]
    _, shown = read(tmp_path, 'time,STW [kn],Note', rows)
    assert '29 line(s) were taken as part of a cell in quotation marks' in shown


def test_of_two_columns_of_one_name_the_other_is_not_used(tmp_path: Path) -> None:
    _, shown = read(tmp_path, 'time,stw_kn,stw_kn', [f'{i},10,11' for i in range(20)])
    assert "speed_through_water <- '2' [kn]" in shown
    assert "Columns not used: '3'" in shown


def test_a_title_with_empty_cells_behind_it(tmp_path: Path) -> None:
    block, _ = read(tmp_path, 'Sea trial;;\ntime;STW [kn];Note', [f'{i};10;x' for i in range(20)])
    assert len(block) == 20


@pytest.mark.parametrize('cell', ['2018-03-02 12:00:00' + ' ' * 60_000 + 'x', '1' * 100_000 + 'x'])
def test_a_long_cell_takes_no_long_time(tmp_path: Path, cell: str) -> None:
    path = tmp_path / 'log.csv'
    path.write_text(f'time,STW [kn],SOG [kn]\n0,10,{cell}\n{cell},10,9\n1,10,9\n')
    code = f'from shipdrag_ros.sources.reading import read_any\nread_any([{str(path)!r}])'
    subprocess.run([sys.executable, '-c', code], check=True, timeout=60)


def test_a_header_may_stand_on_line_38(tmp_path: Path) -> None:
    titles = [f'# key {k}: value, with a comma, here' for k in range(37)]
    rows = [f'2024-05-17T09:{s // 60:02d}:{s % 60:02d}Z,{SPEED},{SPEED}' for s in range(120)]
    block, shown = read(tmp_path, '\n'.join([*titles, 'Time (UTC),STW [m/s],SOG [m/s]']), rows)
    assert len(of(block, Channel.SPEED_THROUGH_WATER)) == 120
    assert '37 line(s) above the table were left out' in shown
    pairs = '\n'.join([*(f'Key{k},value{k}' for k in range(59)), 'Time (UTC),STW [m/s],SOG [m/s]'])
    assert len(of(read(tmp_path, pairs, rows)[0], Channel.SPEED_OVER_GROUND)) == 120


@pytest.mark.parametrize(
    ('name', 'channel', 'factor'),
    [
        ('stw_mps', Channel.SPEED_THROUGH_WATER, 1.0),
        ('stw_kn', Channel.SPEED_THROUGH_WATER, 1852.0 / 3600.0),
        ('heading_rad', Channel.HEADING, 1.0),
        ('rudder_rad', Channel.RUDDER, 1.0),
        ('rudder_deg', Channel.RUDDER, math.pi / 180.0),
        ('shaft_rad_s', Channel.SHAFT, 1.0),
        ('propeller_rps', Channel.SHAFT, 2.0 * math.pi),
    ],
)
def test_a_unit_may_stand_at_the_end_of_a_name(tmp_path, name, channel, factor):
    rows = [f'{s},{SPEED},{0.5 + s / 1000}' for s in range(30)]
    block, _ = read(tmp_path, f'time_s,sog_mps,{name}', rows)
    expected = [(0.5 + s / 1000) * factor for s in range(30)]
    assert of(block, channel)[:, 0] == pytest.approx(expected)


@pytest.mark.parametrize('columns', ['n', 'n,m'])
def test_a_pitch_is_told_with_its_unit(tmp_path: Path, columns: str) -> None:
    path = tmp_path / 'log.csv'
    path.write_text('n,m\n0.5,0.25\n')
    log = Log()
    result = FORMAT.read(Job(path, {'map': [f'pitch={columns}'], 'rate': 1.0}), log)
    assert "  pitch <- 'n' [ratio], first 0.5 ratio or rad" in result.told(path, '')


def test_rows_beyond_the_last_date_are_counted(tmp_path: Path) -> None:
    path = tmp_path / 'log.csv'
    path.write_text('n\n' + '1\n' * 20)
    result = FORMAT.read(Job(path, {'map': ['shaft=n'], 'rate': 1e-9}), Log())
    assert result.written == {'shaft': 2}
    assert result.rejected['time']['no possible date'].count == 18


def test_a_condition_that_leaves_no_row_beside_a_row_that_is_too_wide(tmp_path: Path) -> None:
    path = tmp_path / 'log.csv'
    path.write_text('a,n\n' + 'x,1\n' * 20 + 'x,1,2\n')
    options = {'map': ['shaft=n'], 'rate': 1.0, 'where': [('a', 'y')]}
    with pytest.raises(ImportDataError, match='the column holds x'):
        FORMAT.read(Job(path, options), Log())


def test_the_order_of_dates_helps_to_find_the_unit_of_a_speed(tmp_path: Path) -> None:
    path = tmp_path / 'log.csv'
    rows = [f'03.04.2018 {clock(i)},{latitude(i)},10.25,{SPEED}' for i in range(100)]
    path.write_text('\n'.join(['time,Lat,Lon,SOG', *rows]))
    log = Log()
    result = FORMAT.read(Job(path, {'date_order': 'dmy'}), log)
    assert result.written['speed_over_ground'] == 100
    assert log.first[Channel.SPEED_OVER_GROUND] == (SPEED,)


def test_a_refused_time_is_told_as_it_stands(tmp_path: Path) -> None:
    rows = [f'{i},{i % 10}5;10' for i in range(20)]
    _, shown = read(tmp_path, 'time [s];STW [kn]', [*rows, '20,-5;10'])
    assert "time: 1 rejected, not a number: line 22: '20,-5'" in shown
