# SPDX-License-Identifier: Apache-2.0
"""`import` makes a bag that `replay` reads, and tells what it left out."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main

ROOT = Path(__file__).resolve().parents[2]

KNOT = 1852.0 / 3600.0


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A coast of v = 8 / (1 + t / 300), 600 s at 2 Hz, twice: run a and run b."""
    time = np.arange(0.0, 600.0, 0.5)
    speed = 8.0 / (1.0 + time / 300.0)
    x = 2400.0 * np.log1p(time / 300.0)
    lines = ['run,t,v,x,y']
    for run in 'ab':
        lines += [
            f'{run},{t:.1f},{v / KNOT:.9f},{x_i:.6f},0'
            for t, v, x_i in zip(time, speed, x, strict=True)
        ]
    path = tmp_path / 'trial.csv'
    path.write_text('\n'.join(lines))
    return path


def convert(
    capsys: pytest.CaptureFixture[str], table: Path, *arguments: str
) -> tuple[Path, dict[str, Any]]:
    """Import run a and return the bag and the JSON."""
    bag = table.with_name(f'{len(list(table.parent.iterdir()))}.mcap')
    capsys.readouterr()
    assert main(['import', str(table), '-o', str(bag), *arguments, '--json']) == 0
    return bag, json.loads(capsys.readouterr().out)


def test_a_table_becomes_a_curve(table: Path, ship_file: Path, capsys) -> None:
    bag, said = convert(
        capsys,
        table,
        *('--time', 't', '--map', 'speed_through_water=v:kn', '--map', 'position=x,y'),
        *('--where', 'run=a', '--ship', str(ship_file)),
    )
    assert said['bag'] == str(bag)
    assert (said['rows'], said['left_out']) == (2400, 1200)
    assert said['written'] == {'speed_through_water': 1200, 'position': 1200}
    assert main(['replay', str(bag), '--window', '0', '600', '--json']) == 0
    (coastdown,) = json.loads(capsys.readouterr().out)['coastdowns']
    assert coastdown['estimator'] == 'one'
    # -dv/dt = v^2 / 2400, and r = (1 + n_r) times that with n_r of 0.055 to 0.10
    slowing = np.array(coastdown['speed_m_s']) ** 2 / 2400
    ratio = np.array(coastdown['conditions_resistance_m_s2']) / slowing
    assert np.all((ratio > 1.05) & (ratio < 1.11))


def test_a_rate_takes_the_place_of_a_time(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, said = convert(capsys, table, '--rate', '4', '--map', 'speed_through_water=v')
    assert said['end_ns'] - said['start_ns'] == 2399 * 250_000_000


def test_the_words_tell_what_was_left_out(table: Path, tmp_path, capsys) -> None:
    with table.open('a') as file:
        file.write('\na,700,fast,1,2\n')
    line = ['import', str(table), '-o', str(tmp_path / 'a.mcap'), '--time', 't']
    assert main([*line, '--map', 'speed_through_water=v:kn', '--where', 'run=a']) == 0
    captured = capsys.readouterr().out
    assert '1200 messages of 1201 rows' in captured
    assert 'The times count from a start; it was put at 2000-01-01' in captured
    assert '1200 rows were not chosen by --where.' in captured
    assert "speed_through_water: 1 rejected, not a number: line 2402: 'fast'" in captured


def test_what_follows_a_clock_that_was_set_back_has_times_of_its_own(tmp_path: Path) -> None:
    stamps = [*range(8000, 8400), 8399.5, *range(1200, 2400), *range(1000, 1100)]
    rows = [f'{t},{6.0 + 0.01 * (i % 7)}' for i, t in enumerate(stamps)]
    path = tmp_path / 'set.csv'
    path.write_text('\n'.join(['t,u', *rows, '']))
    line = ['import', str(path), '-o', str(tmp_path / 'a.mcap'), '--time', 't']
    assert main([*line, '--map', 'speed_through_water=u']) == 0
    (run,) = open_runs([tmp_path / 'a.mcap'])
    block = run.inputs().block()
    arrived_s = (block.receive_ns - block.receive_ns[0]) / 1e9
    assert arrived_s[:400].tolist() == list(range(400))
    assert arrived_s[401:1601].tolist() == [399.5 + i for i in range(1200)]
    assert arrived_s[1601:].tolist() == [1598.5 + i for i in range(100)]


@pytest.mark.parametrize(
    ('arguments', 'status', 'said'),
    [
        (('--map', 'depth=v', '--time', 't:year'), 2, "no unit 'year'"),
        (('--map', 'depth=v', '--time', 't', '--ship', 'no.yaml'), 1, 'no.yaml: 1 problem'),
        (('--map', 'depth=v', '--time', 't', '--rate', '1'), 2, 'not allowed with'),
        (('--map', 'depth=v', '--rate', '0'), 2, 'expected a number above 0'),
        (('--map', 'depth=v', '--time', 't', '--where', 'run'), 2, 'expected COLUMN=VALUE'),
        (('--format', 'nmea', '--time', 't'), 2, 'argument --time: of a CSV file, and this is'),
        (('--speed-unit', 'furlong'), 2, 'expected one of m/s, kn'),
        (('--date-order', 'my'), 2, 'expected one of ymd, dmy, mdy'),
        (('--zone', 'Mars'), 2, "'Mars' is no time zone"),
        (('--map', 'depth=v', '--rate', '1', '--transducer', '2'), 2, 'and this is a CSV file'),
        (('--map', 'depth=v', '--rate', '1', '--no-checksum'), 2, 'of an NMEA 0183 log'),
        (('--map', 'depth=v', '--rate', '1', '--date', '2026-01-01'), 2, 'and this is a CSV file'),
        (('--date', '1.1.2026'), 2, 'expected YYYY-MM-DD'),
        (('--format', 'nmea'), 1, 'holds no sentence of NMEA 0183 in 2401 line(s)'),
        (('--format', 'gpx'), 1, 'read as a GPX track for --format: without it the content'),
        ((), 1, "'x', 'y': unit not known; --map position=x,y:m"),
    ],
)
def test_a_mistake_is_told_and_leaves_no_bag(table, tmp_path, capsys, arguments, status, said):
    line = ['import', str(table), '-o', str(tmp_path / 'a.mcap'), *arguments]
    if status == 2:
        with pytest.raises(SystemExit) as end:
            main(line)
        assert end.value.code == 2
    else:
        assert main(line) == status
    assert said in capsys.readouterr().err
    assert not (tmp_path / 'a.mcap').exists()


LOG = (
    '$GPRMC,235959,A,5430.00,N,01000.00,E,10.0,090.0,311223,,,A*4A',
    '$VWVHW,,,095.0,M,09.5,N,,*7B',
    '$HCHDG,095.0,,,,*4E',
    '$SDDBT,,f,12.0,M,,F*35',
    '$XXMTW,10.0,C*12',
    '$GPRMC,000000,A,5430.00,N,01000.01,E,10.0,090.0,010124,,,A*4C',
    '$VWVHW,,,095.0,M,09.4,N,,*00',
)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log over New Year; one checksum in it is wrong."""
    path = tmp_path / 'log.nmea'
    path.write_text('\n'.join(LOG))
    return path


def test_a_log_becomes_a_bag(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, said = convert(capsys, log, '--transducer', '1.5')
    assert said['written'] == {
        'speed_through_water': 1,
        'speed_over_ground': 2,
        'position': 2,
        'heading': 1,
        'depth': 1,
    }
    assert said['end_ns'] - said['start_ns'] == 10**9
    assert said['rejected'] == {
        'line': {'wrong checksum': {'count': 1, 'first': [f'line 7: {LOG[-1][1:]!r}']}}
    }
    assert said['not_used'] == {'XXMTW': 1}
    assert said['unknown_talkers'] == {'XX': 1}
    assert (said['magnetic_heading'], said['log_attached']) == (True, True)


def test_the_words_tell_what_of_a_log_was_not_used(log: Path, tmp_path, capsys) -> None:
    assert main(['import', str(log), '-o', str(tmp_path / 'a.mcap')]) == 0
    said = capsys.readouterr().out
    assert '6 messages of 6 sentences in 7 lines, 1 s' in said
    assert 'from 2023-12-31 23:59:59 UTC' in said
    assert 'The heading is MAGNETIC' in said
    assert '; the log is attached' in said
    assert re.search(r'speed_over_ground +GPRMC +2\n', said)
    assert 'depth: 1 rejected, SDDBT: state the depth of the transducer: line 4' in said
    assert 'line: 1 rejected, wrong checksum: line 7' in said
    assert 'Sentences not used: XXMTW 1' in said
    assert 'Talkers that NMEA 0183 does not know: XX 1' in said


def test_dates_and_checksums_that_a_log_lacks_are_given(log: Path, capsys) -> None:
    log.write_text('$GPGLL,5430.00,N,01000.00,E,120000,A\n')
    _, said = convert(capsys, log, '--date', '2024-02-29', '--no-checksum')
    assert said['start_ns'] == 1_709_208_000 * 10**9
    assert main(['import', str(log), '-o', str(log.with_name('b.mcap')), '--no-checksum']) == 1
    assert '--date YYYY-MM-DD' in capsys.readouterr().err


def test_a_bag_needs_no_import(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, bag = tmp_path / 'a.csv', tmp_path / 'a.mcap'
    table.write_text('time,speed_through_water\n0,8\n1,8\n')
    assert main(['import', str(table), '-o', str(bag)]) == 0
    for source in (bag, tmp_path):
        assert main(['import', str(source), '-o', str(tmp_path / 'b.mcap')]) == 1
        assert 'is a bag already: `shipdrag replay` takes it' in capsys.readouterr().err


@pytest.mark.parametrize('option', [('--format', 'signalk'), ('--map', 'depth=v', '--rate', '1')])
def test_no_option_lets_a_pipe_or_a_bag_in(tmp_path, capsys, option: tuple[str, ...]) -> None:
    folder, bag = tmp_path / 'folder', tmp_path / 'a.mcap'
    folder.mkdir()
    pipe = folder / 'a.db3.zstd'
    os.mkfifo(pipe)  # without a writer, one that reads it waits for ever
    bag.write_bytes(b'\x89MCAP0\r\n')
    refused = {bag: 'is a bag already', pipe: 'is no regular file', folder: "folder'"}
    for source, why in refused.items():
        assert main(['import', str(source), '-o', str(tmp_path / 'b.mcap'), *option]) == 1
        assert why in capsys.readouterr().err


def test_of_several_files_what_went_into_the_bag_is_counted(tmp_path, capsys) -> None:
    first, second = tmp_path / 'a.csv', tmp_path / 'b.csv'
    first.write_text('time,speed_through_water\n1e9,8\n1000000001,8\n')
    second.write_text('time,speed_through_water,heading\n1e9,7,1\n1000000002,7,1\n')
    line = ['import', str(first), str(second), '-o', str(tmp_path / 'c.mcap'), '--json']
    assert main(line) == 0
    shown = capsys.readouterr()
    files = json.loads(shown.out)['files']
    assert [each['written'] for each in files] == [
        {'speed_through_water': 2},
        {'speed_through_water': 1, 'heading': 2},
    ]
    assert 'c.mcap: 3 messages of 2 rows' in shown.err
    assert 'b.csv: speed_through_water not taken for the time' in shown.err


def test_a_format_of_another_package_is_found_by_its_entry_point(tmp_path, monkeypatch, capsys):
    """One more format, of lines `> seconds speed`, without a word of it anywhere else."""
    (tmp_path / 'arrows.py').write_text(
        'from shipdrag_ros.sources.format import CERTAIN, NO, Format, Option\n'
        'from shipdrag_ros.sources.stream import Origin, Reading, read_stream\n'
        'from shipdrag_ros.samples import SECOND_NS, Channel\n'
        'def write(job, log):\n'
        '    epoch = job.options.get("epoch", 1e9)\n'
        '    def read(tally):\n'
        '        for line in job.source.open():\n'
        '            tally.records += 1\n'
        '            t, v = map(float, line[2:].split())\n'
        '            stamp_ns = int((epoch + t) * SECOND_NS)\n'
        '            origin = Origin(0, "arrow")\n'
        '            yield Reading(Channel.SPEED_THROUGH_WATER, origin, stamp_ns, v)\n'
        '    return read_stream(job, log, "arrows", read)\n'
        'FORMAT = Format("arrows", "a log of arrows", "", lambda head: CERTAIN if '
        'head.lines[:1] and head.lines[0].startswith("> ") else NO, write,\n'
        '    (Option("--epoch", "S", "of time 0", float),))\n'
    )
    about = tmp_path / 'arrows-1.0.dist-info'
    about.mkdir()
    (about / 'METADATA').write_text('Metadata-Version: 2.1\nName: arrows\nVersion: 1.0\n')
    (about / 'entry_points.txt').write_text('[shipdrag.formats]\narrows = arrows:FORMAT\n')
    monkeypatch.syspath_prepend(str(tmp_path))
    source, bag = tmp_path / 'a.log', tmp_path / 'a.mcap'
    source.write_text('> 0 8.0\n> 1 7.9\n> 2 7.8\n')
    assert main(['import', str(source), '-o', str(bag), '--epoch', '2e9']) == 0
    captured = capsys.readouterr()
    assert 'speed_through_water <- arrow, first 8 m/s' in captured.err
    assert '3 messages of 3 records, 2 s' in captured.out
    (run,) = open_runs([bag])
    (block,) = run.inputs()
    assert [float(v) for v in block.value[:, 0]] == [8.0, 7.9, 7.8]
    other = tmp_path / 'b.csv'
    other.write_text('time,speed_through_water\n0,8\n')
    with pytest.raises(SystemExit):
        main(['import', str(other), '-o', str(tmp_path / 'b.mcap'), '--epoch', '1e9'])
    assert 'argument --epoch: of a log of arrows, and this is a CSV' in capsys.readouterr().err
