# SPDX-License-Identifier: Apache-2.0
"""Tables of every make come in whole, and what does not is told by line."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shipdrag_ros.bags import open_runs
from shipdrag_ros.errors import BagError, ImportDataError
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.sources.formats.csv.importer import (
    TableResult,
    read_csv,
)
from shipdrag_ros.sources.formats.csv.table import LogTable, parse_input, parse_time
from shipdrag_ros.sources.log import BASE_NS, Log

from .conftest import into_bag

Imported = tuple[TableResult, Block]
Import = Callable[..., Imported]


@pytest.fixture
def import_text(tmp_path: Path) -> Import:
    """Write a table, import it, read the bag."""

    def run(text: str | bytes, *maps: str, time: str | None = None, **options: Any) -> Imported:
        source, out = tmp_path / 'in.csv', tmp_path / 'out.mcap'
        source.write_bytes(text if isinstance(text, bytes) else text.encode())
        out.unlink(missing_ok=True)
        progress = options.pop('progress', None)
        result = into_bag(
            read_file, source, out, columns(maps, time, **options), progress=progress
        )
        return result, samples(out)

    return run


def read_file(source: Path, log: Log, options: dict[str, Any], **more: Any) -> TableResult:
    return read_csv(LogTable(source), log, options, **more)


def columns(maps: Sequence[str], time: str | None = None, **options: Any) -> dict[str, Any]:
    return {'map': maps, 'time': None if time is None else parse_time(time), **options}


def samples(path: Path) -> Block:
    (run,) = open_runs([path])
    assert run.warnings == ()
    return run.inputs().block()


_PAIR = '{}\n' + ''.join(f'{t},{54.1 + 1e-5 * t:.5f},{7.9 + 1e-5 * t:.5f}\n' for t in range(9))


@pytest.mark.parametrize(
    ('header', 'mapped'),
    [
        ('t,lat,lon', 'position=lat,lon'),
        ('t,Latitude (deg),Longitude (deg)', 'position=Latitude (deg),Longitude (deg)'),
        ('t,fix_a [deg],fix_b [deg]', 'position=fix_a [deg],fix_b [deg]'),
        ('t,a,b', 'position=a,b:deg'),
    ],
)
def test_a_position_in_degrees_is_one_without_a_unit_too(import_text, header, mapped):
    _, block = import_text(_PAIR.format(header), mapped, time='t')
    assert set(block.channel) == {Channel.POSITION_GEODETIC}
    assert block.value[0].tolist() == [54.1, 7.9]


@pytest.mark.parametrize('header', ['t,a,b', 't,lat,b'])
def test_values_that_may_be_degrees_are_asked_about(import_text: Import, header: str) -> None:
    given = ','.join(header.split(',')[1:])
    with pytest.raises(ImportDataError, match=r'may be degrees; give .*:deg'):
        import_text(_PAIR.format(header), f'position={given}', time='t')


@pytest.mark.parametrize(
    ('header', 'message'),
    [
        ('t,lon,lat', 'latitude comes first; give position=lat,lon'),
        ('t,lat [deg],lon [m]', 'do not say one unit, but deg and m; give one'),
        ('t,east (km),north', 'do not say one unit, but km and none; give one'),
    ],
)
def test_columns_of_a_position_that_disagree_are_refused(import_text, header, message):
    given = ','.join(header.split(',')[1:])
    with pytest.raises(ImportDataError, match=message):
        import_text(_PAIR.format(header), f'position={given}', time='t')


@pytest.mark.parametrize(
    ('header', 'given', 'first'),
    [
        ('t,a,b', 'a,b:m', [54.1, 7.9]),
        ('t,x,y', 'x,y', [54.1, 7.9]),
        ('t,a_m,b_m', 'a_m,b_m', [54.1, 7.9]),
        ('t,a_km,b_km', 'a_km,b_km', [54100.0, 7900.0]),
    ],
)
def test_metres_stay_metres(import_text, header, given, first):
    _, block = import_text(_PAIR.format(header), f'position={given}', time='t')
    assert set(block.channel) == {Channel.POSITION}
    np.testing.assert_allclose(block.value[0], first)
    far, block = import_text('t,a,b\n0,100,500000\n1,101,500000', 'position=a,b', time='t')
    assert far.written == {'position': 2}
    assert set(block.channel) == {Channel.POSITION}


@pytest.mark.parametrize('header', ['t,ve [m/s],vn [kn]', 't,ve [m/s],vn'])
def test_components_of_which_not_both_state_one_unit_are_asked_about(import_text, header):
    with pytest.raises(ImportDataError, match=r'unit not known; .*--map'):
        import_text(f'{header}\n' + ''.join(f'{t},3,4\n' for t in range(20)), speed_unit='kn')


def test_further_instruments_come_in_as_the_first(import_text: Import) -> None:
    maps = (
        'speed_through_water=a',
        'speed_through_water_2=b:kn',
        'speed_over_ground_3=e,n',
        'position_2=la,lo:deg',
        'position_3=e,n:km',
    )
    text = 't,a,b,e,n,la,lo\n0,5.5,10,3,4,-12.5,131\n1,5.25,9,3,4,-12.25,131\n'
    result, block = import_text(text, *maps, time='t')
    assert list(result.written) == [each.partition('=')[0] for each in maps]
    assert set(result.written.values()) == {2}
    assert block.value[block.channel == Channel.SPEED_THROUGH_WATER_2, 0] == pytest.approx(
        [10 * 1852 / 3600, 9 * 1852 / 3600]
    )
    assert block.value[block.channel == Channel.SPEED_OVER_GROUND_3, 0].tolist() == [5.0, 5.0]
    (first, _) = block.value[block.channel == Channel.POSITION_GEODETIC_2].tolist()
    assert first == [-12.5, 131.0]
    (first, _) = block.value[block.channel == Channel.POSITION_3].tolist()
    assert first == [3000.0, 4000.0]


@pytest.mark.parametrize('delimiter', [',', ';', '\t'])
@pytest.mark.parametrize('start', ['', '\ufeff', '\n\n', ' , \n'.replace(',', '')])
@pytest.mark.parametrize('end', ['\n', '\r\n', '\r'])
def test_delimiters_marks_and_line_ends(import_text, delimiter, start, end):
    lines = ['"time, s";u', '1; 2.5', ';', '"2";3.5']
    text = start + end.join(lines).replace(';', delimiter)
    result, block = import_text(text, 'speed_through_water=u', time='1')
    assert result.delimiter == delimiter
    assert block.value[:, 0].tolist() == [2.5, 3.5]


@pytest.mark.parametrize(
    ('text', 'name', 'value'),
    [
        ('1\n', 'speed_through_water=1:kn', 1852 / 3600),
        ('36\n', 'speed_over_ground=1:km/h', 10.0),
        ('10\n', 'speed_over_ground=1:ft/s', 3.048),
        ('2\n', 'speed_over_ground=1:m/s', 2.0),
        ('180\n', 'heading=1:deg', math.pi),
        ('60\n', 'shaft=1:rpm', 2 * math.pi),
        ('2\n', 'shaft=1:rad/s', 2.0),
        ('2\n', 'shaft=1:rev/s', 4 * math.pi),
        ('-80\n', 'pitch=1:%', -0.8),
        ('0.7\n', 'pitch=1', 0.7),
        ('180\n', 'pitch=1:deg', math.pi),
        ('90\n', 'rudder=1:deg', math.pi / 2),
        ('10\n', 'depth=1:ft', np.float32(3.048)),
        ('0.5\n', 'depth=1:km', 500.0),
    ],
)
def test_units(import_text: Import, text: str, name: str, value: float) -> None:
    _, block = import_text(text, name, rate=1.0)
    assert block.value[0, 0] == pytest.approx(value, rel=1e-15)


def test_several_shafts_and_their_pitch(import_text: Import) -> None:
    text = 'p,s,a,b\n60,-120,50,25\n,90,0,x\n'
    result, block = import_text(text, 'shaft=p,s:rpm', 'pitch=a:%,b:ratio', rate=1)
    assert block.channel.tolist() == [
        *(Channel.SHAFT, Channel.SHAFT_2, Channel.PITCH, Channel.PITCH_2),
        *(Channel.SHAFT_2, Channel.PITCH),
    ]
    turn = 2 * math.pi
    np.testing.assert_allclose(
        block.value[:, 0], [turn, -2 * turn, 0.5, 25.0, 1.5 * turn, 0.0], rtol=1e-15
    )
    assert result.written == {'shaft': 6}
    assert {reason: each.count for reason, each in result.rejected['shaft'].items()} == {
        'empty': 1,
        'not a number': 1,
    }


@pytest.mark.parametrize(
    ('columns', 'value'),
    [
        ('position=1,2:km', [1000.0, 2000.0]),
        ('position=1:km,2', [1000.0, 2000.0]),
        ('position=1:km,2:km', [1000.0, 2000.0]),
        ('position=1:km,2:m', [1000.0, 2.0]),
        ('position=1:km,2:nmi', [1000.0, 3704.0]),
        ('position=1:deg,2:deg', [1.0, 2.0]),
        ('wind_apparent=2,1', [2.0, 1.0]),
        ('position=1,2:deg', [1.0, 2.0]),
        ('position=1:deg,2', [1.0, 2.0]),
        ('wind_apparent=1,2:kn', [1852 / 3600, 2 * 1852 / 3600]),
    ],
)
def test_a_unit_given_once_holds_for_both_columns(import_text, columns, value):
    _, block = import_text('1,2\n', columns, rate=1)
    assert block.value[0] == pytest.approx(value, rel=1e-15)
    geodetic = block.channel[0] == Channel.POSITION_GEODETIC
    assert geodetic == ('deg' in columns)


@pytest.mark.parametrize(
    ('time', 'cell', 'expected_ns', 'base_ns'),
    [
        ('t', '0.000000001', BASE_NS + 1, BASE_NS),
        ('t:s', '1.5e3', BASE_NS + 1_500_000_000_000, BASE_NS),
        ('t', '-2', BASE_NS - 2_000_000_000, BASE_NS),
        ('t:us', '7', BASE_NS + 7000, BASE_NS),
        ('t:ns', '7', BASE_NS + 7, BASE_NS),
        ('t:ms', '1544175458614', 1_544_175_458_614_000_000, None),
        ('t:ns', '1544175458614000001', 1_544_175_458_614_000_001, None),
        ('t', '1700000000.123456789', 1_700_000_000_123_456_789, None),
    ],
)
def test_times_are_exact(import_text, time, cell, expected_ns, base_ns):
    result, block = import_text(f't,u\n{cell},1\n', 'shaft=u', time=time)
    assert block.stamp_ns.tolist() == [expected_ns]
    assert result.base_ns == base_ns


def test_a_rate_counts_the_rows_that_are_chosen(import_text: Import) -> None:
    text = 'test,u\na,1\nb,2\nb,\nb,4\nc,5\n'
    result, block = import_text(text, 'shaft=u', rate=3.0, where=[('test', 'b')])
    assert (block.stamp_ns - BASE_NS).tolist() == [0, 666_666_667]
    assert block.value[:, 0].tolist() == [2.0, 4.0]
    assert (result.rows, result.left_out) == (5, 2)
    assert result.base_ns == BASE_NS


def test_all_conditions_must_hold(import_text: Import) -> None:
    text = 'test,part,u\na,x,1\na,y,2\nb,y,3\n'
    _, block = import_text(text, 'shaft=u', rate=1, where=[('test', 'a'), ('2', 'y')])
    assert block.value[:, 0].tolist() == [2.0]


def test_bad_cells_are_counted_by_reason_with_their_lines(import_text: Import, tmp_path) -> None:
    cells = ['1', '', 'x', '2,5', 'nan', '1_0', 'inf', '0x1', '1e9999', '5', '--']
    rows = [f'{i};"{cell}";{i}' for i, cell in enumerate(cells)]
    result, block = import_text(
        '\n'.join(['t;u;n', *rows, '11']), 'speed_through_water=u', 'shaft=n', time='t'
    )
    bad = result.rejected['speed_through_water']
    assert bad['empty'].count == 2
    assert bad['empty'].first == ["line 3: ''", "line 13: ''"]
    assert bad['not a number'].count == 7
    assert bad['not a number'].first == ["line 4: 'x'", "line 5: '2,5'", "line 6: 'nan'"]
    assert result.rejected['shaft']['empty'].count == 1
    assert result.written == {'speed_through_water': 3, 'shaft': 11}
    # a number too large for any computer is written, and rejected by the monitor
    log = block.value[block.channel == Channel.SPEED_THROUGH_WATER, 0]
    assert log.tolist() == [1.0, math.inf, 5.0]
    used = replay(
        open_runs([tmp_path / 'out.mcap'])[0],
        ship=Ship(name='x', length_m=100.0, displaced_volume_m3=9000.0),
    ).inputs['speed_through_water']
    assert used.rejected == {'infinite': 1}


def test_a_row_without_a_time_is_counted_whole(import_text: Import) -> None:
    text = 't,u\n0,1\n,2\nnoon,3\n1e15,4\n-1e15,5\n9999999999,6\n1,7\n'
    result, block = import_text(text, 'shaft=u', time='t')
    assert block.value[:, 0].tolist() == [1.0, 7.0]
    assert {reason: bad.count for reason, bad in result.rejected['time'].items()} == {
        'empty': 1,
        'not a number': 1,
        'no possible date': 3,
    }


def test_rows_out_of_order_stay_in_their_order_and_are_counted(import_text: Import) -> None:
    result, block = import_text('t,u\n0,1\n2,2\n1,3\n2,4\n3,5\n', 'shaft=u', time='t')
    assert block.value[:, 0].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert ((block.stamp_ns - BASE_NS) // 10**9).tolist() == [0, 2, 1, 2, 3]
    assert ((block.receive_ns - BASE_NS) // 10**9).tolist() == [0, 2, 2, 2, 3]
    assert result.backward == 1


@pytest.mark.parametrize('before', [1000, 1022, 1023, 1024])
def test_a_clock_set_back_is_seen_wherever_rows_are_cut(import_text: Import, before: int) -> None:
    times = [*range(before), *range(before - 100, before + 100)]
    rows = '\n'.join(f'{t},1' for t in times)
    _, block = import_text(f't,u\n{rows}\n', 'shaft=u', time='t')
    steps = np.diff(block.receive_ns) // 10**9
    assert steps[before - 1] == 0
    assert np.all(np.delete(steps, before - 1) == 1)


def test_a_leap_second_of_a_table_is_the_midnight_after_it(import_text: Import) -> None:
    rows = '\n'.join(f'2016-12-31T23:59:{second}Z,1' for second in (58, 59, 60))
    result, block = import_text(f't,u\n{rows}\n2017-01-01T00:00:01Z,1\n', 'shaft=u', time='t')
    assert np.diff(block.stamp_ns).tolist() == [10**9] * 3
    assert result.rejected == {}


def test_a_month_has_two_digits_at_most(import_text: Import) -> None:
    with pytest.raises(ImportDataError, match='no possible date'):
        import_text('t,u\n0001-01-02,1\n', 'shaft=u', time='t')


@pytest.mark.filterwarnings('error')
def test_what_a_unit_makes_larger_than_any_number_is_no_warning(import_text: Import) -> None:
    _, block = import_text('t,u\n0,1e308\n1,5\n', 'shaft=u:rps', time='t')
    assert np.isinf(block.value[0, 0])


def test_many_rows_are_the_same_rows(import_text: Import) -> None:
    values = np.random.default_rng(2).normal(5.0, 1.0, 10_000)
    told: list[tuple[int, int]] = []
    _, block = import_text(
        '\n'.join(map(repr, values.tolist())),
        'speed_through_water=1',
        rate=10.0,
        progress=lambda done, total: told.append((done, total)),
    )
    np.testing.assert_array_equal(block.value[:, 0], values)
    assert len(told) >= 10
    assert all(0 < done <= total for done, total in told)
    assert told[-1][0] > told[0][0]


def test_the_bag_says_where_it_comes_from(import_text: Import, tmp_path: Path) -> None:
    text = 'a,u,v,p\nx,1,2,3\n'
    import_text(text, 'shaft=u,v', 'pitch=p', rate=2.0, where=[('a', 'x')])
    (run,) = open_runs([tmp_path / 'out.mcap'])
    assert yaml.safe_load(run.attachments['import.yaml']) == {
        'source': 'in.csv',
        'inputs': {'shaft': ['u', 'v'], 'pitch': ['p']},
        'time': None,
        'rate_hz': 2.0,
        'where': {'a': 'x'},
    }


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('depth=a,b', r'expected 1 column\(s\), depth=COLUMN'),
        ('shaft=a,b,c,d,e', r'expected 1 to 4 column\(s\), shaft=COLUMN'),
        ('shaft=a,', r'expected 1 to 4 column\(s\)'),
        ('shaft=', r'expected 1 to 4 column\(s\)'),
        ('shaft', r'expected 1 to 4 column\(s\)'),
        ('shaft=n:hz', "no unit 'hz' here; units are rad/s, rev/s, rpm, rps"),
        ('pitch=p:rpm', "no unit 'rpm' here; units are %, deg, rad, ratio"),
        ('depth=d:kn', "no unit 'kn' here"),
        ('position=x:m,y:deg', 'both columns in deg'),
        ('position=x:deg,y:m', 'both columns in deg'),
        ('t:min', "no unit 'min' here; units are ms, ns, s, us"),
        ('', 'expected COLUMN'),
    ],
)
def test_maps_and_times_that_say_nothing(text: str, expected: str) -> None:
    with pytest.raises(ImportDataError, match=expected):
        (parse_time if text in ('t:min', '') else parse_input)(text)


@pytest.mark.parametrize(
    ('content', 'maps', 'options', 'expected'),
    [
        ('\n \n', ['shaft=1'], {'rate': 1}, 'is empty'),
        ('1,2\n', ['shaft=u'], {'rate': 1}, "no column 'u'; it has no header"),
        ('1,2\n', ['shaft=3'], {'rate': 1}, "no column '3'"),
        ('1,2\n', ['shaft=0'], {'rate': 1}, "no column '0'"),
        ('u,u\n1,2\n', ['shaft=u'], {'rate': 1}, "2 columns 'u'; write a number: 1 or 2"),
        ('1,2\n', ['shaft=1'], {}, 'give --time COLUMN.* or --rate'),
        ('1,2\n', ['shaft=1'], {'rate': 1, 'time': '2'}, 'both give the times'),
        ('1,2\n', ['shaft=1'], {'rate': 0.0}, '--rate 0.0: expected'),
        ('1,2\n', ['shaft=1'], {'rate': math.nan}, '--rate nan: expected'),
        ('1,2\n', [], {'rate': 1}, 'has no names of columns'),
        ('1,2\n', ['shaft=1', 'shaft=2'], {'rate': 1}, 'shaft=...: given 2 times'),
        ('1,2\n', ['pitch=1', 'pitch=2'], {'rate': 1}, 'pitch=...: given 2 times'),
        (
            't,u\na,1\nb,2\n',
            ['shaft=u'],
            {'rate': 1, 'where': [('t', 'c')]},
            '--where chooses none of them: the column holds a, b',
        ),
        ('1,"' + 'x' * 200_000, ['shaft=1'], {'rate': 1}, 'is no row of a table'),
    ],
)
def test_tables_that_cannot_be_used(import_text, tmp_path, content, maps, options, expected):
    with pytest.raises(ImportDataError, match=expected):
        import_text(content, *maps, **options)
    assert not (tmp_path / 'out.mcap').exists()


def test_a_source_that_is_not_there_and_a_bag_that_is(tmp_path: Path) -> None:
    shaft = columns(['shaft=1'], rate=1.0)
    with pytest.raises(ImportDataError, match='cannot be read: No such file'):
        into_bag(read_file, tmp_path / 'a.csv', tmp_path / 'a.mcap', shaft)
    with pytest.raises(ImportDataError, match='cannot be read: Is a directory'):
        into_bag(read_file, tmp_path, tmp_path / 'a.mcap', shaft)
    (tmp_path / 'a.csv').write_text('1\n')
    (tmp_path / 'a.mcap').write_text('precious')
    with pytest.raises(BagError, match='exists'):
        into_bag(read_file, tmp_path / 'a.csv', tmp_path / 'a.mcap', shaft)
    assert (tmp_path / 'a.mcap').read_text() == 'precious'


@pytest.mark.parametrize('content', [b'\x1f\x8b', b'\x1f\x8b\x08' + bytes(20)])
def test_a_packed_table_that_is_cut_is_an_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / 'a.csv').write_bytes(content)
    with pytest.raises(ImportDataError, match='cannot be unpacked'):
        LogTable(tmp_path / 'a.csv')


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    content=st.one_of(
        st.binary(max_size=200),
        st.text(alphabet='0123456789.,;\t\n\r"-+eE x', max_size=200).map(str.encode),
    ),
    by_time=st.booleans(),
)
def test_any_content(import_text: Import, content: bytes, by_time: bool) -> None:
    options: dict[str, Any] = {'time': '1'} if by_time else {'rate': 1.0}
    try:
        result, block = import_text(content, 'speed_through_water=1', **options)
    except ImportDataError as error:
        assert 'in.csv' in str(error)  # noqa: PT017
    else:
        rejected = sum(
            bad.count for reasons in result.rejected.values() for bad in reasons.values()
        )
        assert len(block) + rejected == result.rows - result.left_out
