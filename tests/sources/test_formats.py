# SPDX-License-Identifier: Apache-2.0
"""Every format gives the same minute of the same ship alike, and what it does not know is said."""

from __future__ import annotations

import gc
import gzip
import json
import math
import re
import shutil
import sqlite3
import struct
import subprocess
import sys
import zlib
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import zstandard

from shipdrag_ros.bags.mcap_file import is_bag
from shipdrag_ros.cli import main
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.sources import formats
from shipdrag_ros.sources.format import Job, best_of, head_of
from shipdrag_ros.sources.formats import n2k
from shipdrag_ros.sources.reading import (
    LogRun,
    format_of,
    read_any,
    read_joined,
)
from tests.sources import log_samples as made

BELOW = 'environment.depth.belowTransducer'
ROOT = Path(__file__).resolve().parents[2]
FORMAT_OF = {
    'csv': 'csv',
    'csv_commas': 'csv',
    'nmea': 'nmea',
    'candump': 'n2k',
    'actisense': 'n2k',
    'yacht_devices': 'n2k',
    'canboat': 'n2k',
    'slcan': 'n2k',
    'signalk': 'signalk',
    'gpx': 'gpx',
    'ardupilot': 'ardupilot',
    'ulog': 'ulog',
    'ros1': 'rosbag',
    'sqlite3': 'rosbag',
}


@pytest.fixture(scope='module')
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file of each format."""
    folder = tmp_path_factory.mktemp('logs')
    found = {}
    for kind, (name, data) in made.samples(folder).items():
        found[kind] = folder / name
        found[kind].write_bytes(data)
    return found


def block_of(*paths: Path, **options: object) -> Block:
    """Read the samples of logs as one run."""
    if is_bag(paths[0]):
        (run,) = read_any(paths)
        return run.inputs().block()
    chosen = [(format_of(path, options), path) for path in paths]
    log, *_ = read_joined([(each, Job(path, options)) for each, path in chosen])
    run = LogRun(log, paths)
    return run.inputs().block()


def values(block: Block, channel: Channel) -> np.ndarray:
    return block.value[block.channel == channel]


def told(path: Path) -> list[str]:
    """Return what is said of a log."""
    said: list[str] = []
    read_any([path], show=said.extend)
    return said


def needs(kind: str) -> None:
    library = {'ardupilot': 'pymavlink', 'ulog': 'pyulog'}.get(kind)
    if library is not None:
        pytest.importorskip(library)


def test_every_format_has_a_sample() -> None:
    assert set(FORMAT_OF.values()) == {each.name for each in formats.found()}


@pytest.mark.parametrize('kind', FORMAT_OF)
def test_a_format_is_known_by_its_content(files: dict[str, Path], kind: str) -> None:
    bare = files[kind].with_name('log')
    bare.write_bytes(files[kind].read_bytes())
    assert best_of(formats.found(), head_of(bare)).name == FORMAT_OF[kind]


@pytest.mark.parametrize('kind', FORMAT_OF)
def test_values_and_times_are_those_measured(files: dict[str, Path], kind: str) -> None:
    needs(kind)
    block = block_of(files[kind])
    rows = range(made.ROWS)
    stamps = np.array([made.epoch_ns(k) for k in rows])
    expected = {
        Channel.SPEED_THROUGH_WATER: [made.stw(k) for k in rows],
        Channel.SPEED_OVER_GROUND: [made.sog(k) for k in rows],
        Channel.POSITION_GEODETIC: [made.latitude(k) for k in rows],
        Channel.HEADING: [
            math.remainder(math.radians(90 - made.compass(k)), 2 * math.pi) for k in rows
        ],
    }
    tolerance = {Channel.POSITION_GEODETIC: 2e-6}
    seen = 0
    for channel, numbers in expected.items():
        found = values(block, channel)
        if not len(found):
            continue
        seen += 1
        assert found[:, 0] == pytest.approx(numbers, abs=tolerance.get(channel, 6e-3))
        assert block.stamp_ns[block.channel == channel] == pytest.approx(stamps, abs=2000)
    assert seen >= (1 if FORMAT_OF[kind] == 'rosbag' else 2)


@pytest.mark.parametrize(
    ('kind', 'written'),
    [
        *((kind, gzip.compress) for kind in ('csv', 'csv_commas', 'candump', 'signalk', 'nmea')),
        ('gpx', gzip.compress),
        ('gpx', lambda raw: raw.replace(b'<trkpt', b'<trkpt self="1" point="2"')),
        ('nmea', lambda raw: b'\0\0\0' + raw),  # a serial line that is plugged
        ('slcan', lambda raw: raw.replace(b'\n', b'\r')),
    ],
)
def test_a_log_written_in_another_way_is_the_log(files, tmp_path, kind, written):
    path = tmp_path / 'log'
    path.write_bytes(written(files[kind].read_bytes()))
    plain, other = block_of(files[kind]), block_of(path)
    assert np.array_equal(plain.value, other.value)
    assert np.array_equal(plain.stamp_ns, other.stamp_ns)


def test_lines_may_be_led_by_the_time_of_their_day(files: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / 'led.log'
    per_row = len(made.n2k_messages(0))
    bare = [line.split('R ')[1] for line in files['yacht_devices'].read_text().splitlines()]
    path.write_text(
        '\n'.join(
            f'({made.when(k // per_row):%Y-%m-%d %H:%M:%S.%f})  can0  '
            f'{line.split()[0]}   [8]  {" ".join(line.split()[1:])}'
            for k, line in enumerate(bare)
        )
    )
    led, plain = block_of(path), block_of(files['yacht_devices'])
    assert np.array_equal(led.stamp_ns, plain.stamp_ns)
    assert np.array_equal(led.value, plain.value)


def test_a_serial_adapter_need_not_give_milliseconds(files: dict[str, Path], tmp_path) -> None:
    path, plain = tmp_path / 'plain.log', files['slcan']
    path.write_text('\n'.join(line[:-4] for line in plain.read_text().splitlines()))
    found, whole = block_of(path, rate=10.0), block_of(plain)
    assert np.array_equal(found.channel, whole.channel)
    assert np.array_equal(found.value, whole.value)


def test_a_packed_track_with_damaged_bytes_is_read_as_far_as_it_goes(tmp_path) -> None:
    point = '<trkpt lat="50.0" lon="5.0"><time>2024-01-01T{:02d}:{:02d}:00Z</time></trkpt>'
    points = ''.join(point.format(n // 60, n % 60) for n in range(1440))
    packer = zlib.compressobj(wbits=31)
    packed = packer.compress(f'<gpx><trk><trkseg>{points}'.encode())
    path = tmp_path / 'track.gpx.gz'
    path.write_bytes(packed + packer.flush(zlib.Z_FULL_FLUSH) + b'\x07')  # no kind of block
    assert set(block_of(path).channel) == {Channel.POSITION_GEODETIC}
    assert any('The file is damaged, ' in line for line in told(path))


@pytest.mark.parametrize('length', '01234567')
def test_a_damaged_length_of_a_frame_makes_no_value_of_its_milliseconds(files, tmp_path, length):
    """Each line of 8 bytes in turn says that it has fewer; its clock is no byte, nor bytes it."""
    lines = files['slcan'].read_text().splitlines()
    whole = {tuple(row) for row in block_of(files['slcan']).value.tolist()}
    path = tmp_path / 'damaged.log'
    for place in range(20, 30):
        damaged = [*lines]
        damaged[place] = damaged[place][:9] + length + damaged[place][10:]
        path.write_text('\n'.join(damaged))
        assert {tuple(row) for row in block_of(path).value.tolist()} <= whole


def test_a_coordinate_may_have_thirty_decimals(tmp_path: Path) -> None:
    path = tmp_path / 'track.gpx'
    points = (
        f'<trkpt lat="{54.5 + k * 5e-5:.28f}" lon="10.2519999991953372955322265625">'
        f'<time>{made.when(k):%Y-%m-%dT%H:%M:%S.000Z}</time></trkpt>'
        for k in range(20)
    )
    path.write_text(f'<gpx><trk><trkseg>{"".join(points)}</trkseg></trk></gpx>')
    assert values(block_of(path), Channel.POSITION_GEODETIC)[:, 1] == pytest.approx(10.252)


def test_a_log_that_begins_before_midnight_is_of_the_day_before(tmp_path: Path) -> None:
    """The first message with a date comes after midnight."""
    day = (made.START.date() - made.datetime(1970, 1, 1).date()).days
    speed = '00F401FFFF00FFFF'
    lines = [f'A2359{k}.000 23FF2 1F503 {speed}' for k in (57, 58, 59)]
    lines += [f'A0000{k:02d}.000 23FF2 1F503 {speed}' for k in range(5)]
    dated = made.struct.pack('<BBHI', 0, 0xF0, day, 20_000).hex()
    path = tmp_path / 'log.txt'
    path.write_text('\n'.join([*lines[:5], f'A000002.000 23FF2 1F010 {dated}', *lines[5:]]))
    stamps = block_of(path).stamp_ns
    assert stamps.tolist() == [(86_400 * day + k) * 10**9 for k in range(-3, 5)]


def test_a_rate_next_to_nothing_gives_one_frame_a_date(files: dict[str, Path]) -> None:
    assert len(block_of(files['candump'], rate=1e-300)) == 1


@pytest.mark.parametrize('kind', ['slcan', 'candump'])
def test_times_that_are_no_dates_take_the_one_of_a_frame_or_the_one_given(
    tmp_path: Path, capsys, kind: str
) -> None:
    path = tmp_path / 'log'  # that of candump as -tz writes it, from its first frame on
    since = lambda at: f'{int(at[0]) - made.epoch_ns(0) // 10**9:03d}'  # noqa: E731
    text = re.sub(r'(?<=\()\d+', since, getattr(made, kind)().decode())
    dated = f'{made._can_id(126992):08X}'
    bare = '\n'.join(line for line in text.splitlines() if dated not in line)
    said = []
    for number, (log, *more) in enumerate([(text,), (bare, '--date', '2025-03-02'), (bare,)]):
        path.write_text(log)
        assert main(['import', str(path), '-o', str(tmp_path / f'{number}.mcap'), *more]) == 0
        said.append(capsys.readouterr().out)
    dates = [f'{made.START:%Y-%m-%d}', '2025-03-02', '2000-01-01']
    assert [[date in each for date in dates] for each in said] == np.eye(3).tolist()
    assert 'No frame states the date' in said[2]


@pytest.mark.filterwarnings('error')
def test_a_damaged_number_of_an_ulog_is_no_warning(files: dict[str, Path], tmp_path: Path) -> None:
    needs('ulog')
    path, speed = tmp_path / 'log.ulg', made.struct.pack('<f', made.sog(3))
    path.write_bytes(files['ulog'].read_bytes().replace(speed, b'\1\0\x80\x7f'))
    assert len(values(block_of(path), Channel.SPEED_OVER_GROUND)) == made.ROWS - 1


def test_a_bag_is_closed(files: dict[str, Path], recwarn: pytest.WarningsRecorder) -> None:
    read_any([files['ros1']])
    gc.collect()
    assert not [each for each in recwarn if each.category is ResourceWarning]


def test_engine_revolutions_are_the_shaft_only_with_a_gear(files: dict[str, Path]) -> None:
    assert not len(values(block_of(files['candump']), Channel.SHAFT))
    found = values(block_of(files['candump'], gear=2.5), Channel.SHAFT)
    assert found[:, 0] == pytest.approx(1500 / 2.5 * math.pi / 30)


def test_the_first_line_is_shown(files: dict[str, Path]) -> None:
    lines = told(files['csv'])
    assert "  speed_through_water <- 'STW [kn]' [kn], first 6 m/s" in lines
    assert any(
        "'Heading [deg]' is taken as degrees clockwise from north" in line for line in lines
    )


def test_files_of_one_instrument_each_are_one_run(files: dict[str, Path], tmp_path: Path) -> None:
    bag = tmp_path / 'all.mcap'
    log, track = files['csv'], files['gpx']
    water = tmp_path / 'water.csv'
    water.write_text(
        'time,speed_through_water\n'
        + '\n'.join(f'{made.epoch_ns(k) // 10**9 + 0.5},{made.stw(k)}' for k in range(60))
    )
    line = ['import', str(track), str(water), '-o', str(bag)]
    assert main(line) == 0
    (run,) = read_any([bag])
    block = run.inputs().block()
    assert len(values(block, Channel.POSITION_GEODETIC)) == 60
    assert len(values(block, Channel.SPEED_THROUGH_WATER)) == 60
    assert (np.diff(block.receive_ns) >= 0).all()
    both = block_of(track, log)  # of an input that both hold, the first file's
    assert len(values(both, Channel.POSITION_GEODETIC)) == 60
    assert len(values(both, Channel.SPEED_THROUGH_WATER)) == 60


def test_replay_of_a_log_is_replay_of_its_bag(files: dict[str, Path], tmp_path, capsys) -> None:
    ship = str(ROOT / 'config' / 'vitus_bering.yaml')
    bag = tmp_path / 'log.mcap'
    assert main(['import', str(files['csv']), '-o', str(bag)]) == 0
    found = []
    for source in (bag, files['csv']):
        capsys.readouterr()
        assert main(['replay', str(source), '--ship', ship, '--window', '0', '59', '--json']) == 0
        document = json.loads(capsys.readouterr().out)
        for coastdown in document['coastdowns']:
            assert coastdown.pop('bag') == str(source)
        document.pop('bags', None)
        found.append(json.dumps(document).replace(str(source), 'SOURCE'))
    assert found[0] == found[1]
    assert json.loads(found[0])['coastdowns'][0]['resistance_m_s2']


@pytest.mark.parametrize('kind', FORMAT_OF)
def test_a_log_read_directly_gives_the_bits_of_its_bag(files, tmp_path, kind):
    needs(kind)
    bag = tmp_path / 'log.mcap'
    assert main(['import', str(files[kind]), '-o', str(bag)]) == 0
    from_bag, direct = block_of(bag), block_of(files[kind])
    assert len(direct) >= made.ROWS
    for name in ('channel', 'stamp_ns', 'receive_ns', 'value', 'variance'):
        one, other = getattr(from_bag, name), getattr(direct, name)
        assert one.tobytes() == other.tobytes(), name


def test_nothing_is_written_while_a_log_is_read(files, tmp_path, monkeypatch):
    empty = tmp_path / 'tmp'
    empty.mkdir()
    monkeypatch.setattr('tempfile.tempdir', str(empty))
    monkeypatch.setattr('tempfile.mkdtemp', None)
    assert len(block_of(files['csv'], files['gpx']))
    assert not any(empty.iterdir())


def test_a_library_that_is_not_there_is_named(files, tmp_path, monkeypatch):
    for kind, library in (('ardupilot', 'pymavlink'), ('ulog', 'pyulog')):
        monkeypatch.setitem(sys.modules, library, None)
        monkeypatch.setitem(sys.modules, f'{library}.DFReader', None)
        with pytest.raises(ImportDataError, match=r"pip install 'shipdrag_ros\[logs\]'"):
            read_any([files[kind]])


@pytest.mark.parametrize(
    ('name', 'content', 'why'),
    [
        (
            'bomb.gpx',
            '<?xml version="1.0"?><!DOCTYPE g [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>'
            '<gpx>&b;</gpx>',
            'declares XML entities',
        ),
        ('far.gpx', '<!DOCTYPE gpx SYSTEM "http://example.org/x"><gpx></gpx>', 'declares XML'),
        ('nope.gpx', '<?xml version="1.0" encoding="nope"?><gpx></gpx>', 'unknown encoding'),
        ('sjis.gpx', '<?xml version="1.0" encoding="shift_jis"?><gpx></gpx>', 'encodings are not'),
        (
            'plan.gpx',
            '<gpx><trk><trkseg><trkpt lat="1" lon="2"/></trkseg></trk></gpx>',
            'no time of the point: export the recorded track with its times, or its points as CSV',
        ),
        ('way.gpx', '<gpx><rte><rtept/></rte></gpx>', 'no point of a track: export the recorded'),
        ('deep.gpx', '<gpx>' + '<a>' * 5000, 'more than 32 deep'),
        ('deep.jsonl', '{"updates":' + '[' * 100_000, 'too long for a delta'),
        ('cut.bag', '#ROSBAG V2.0\n', 'holds no message'),
        ('cut.db3', 'SQLite format 3\0' + 'x' * 100, 'holds no message'),
        ('spreadsheet.csv', 'PK\x03\x04', 'of no format known here'),
        ('wide.csv', 'a,' * 2_000_000, 'of no format known here'),
    ],
)
def test_hostile_files_are_refused(tmp_path: Path, name: str, content: str, why: str) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(ImportDataError, match=why):
        read_any([path])


def test_what_a_killed_recorder_left_in_the_log_of_sqlite3_is_read(files, tmp_path):
    path = tmp_path / 'grows.db3'
    shutil.copy(files['sqlite3'], path)
    with closing(sqlite3.connect(path)) as database:
        database.execute('pragma journal_mode = wal')
        database.execute(
            'insert into messages (topic_id, timestamp, data)'
            ' select topic_id, timestamp + 3600000000000, data from messages'
        )
        database.commit()
        bag = tmp_path / 'bag'
        bag.mkdir()
        left = [shutil.copy(f'{path}{end}', bag) for end in ('', '-wal')]
    assert len(block_of(Path(left[0]))) == 2 * len(block_of(files['sqlite3']))
    assert sorted(map(str, bag.iterdir())) == left


@pytest.mark.parametrize('packed', ['file', 'message'])
def test_what_rosbag2_packs_in_sqlite3_is_read(files, tmp_path, packed: str):
    plain = tmp_path / 'bag' / 'bag.db3'
    plain.parent.mkdir()
    shutil.copy(files['sqlite3'], plain)
    (plain.parent / 'metadata.yaml').write_text('rosbag2_bagfile_information: {}')
    pack = zstandard.ZstdCompressor().compress
    if packed == 'file':
        plain.with_name('bag.db3.zstd').write_bytes(pack(plain.read_bytes()))
        plain.unlink()
    else:
        with closing(sqlite3.connect(plain)) as database:
            database.create_function('pack', 1, pack)
            database.execute('update messages set data = pack(data)')
            database.commit()
    whole = block_of(files['sqlite3'])
    for source in (plain.parent, plain.with_name('metadata.yaml')):
        np.testing.assert_array_equal(block_of(source).value, whole.value)
    (run,) = read_any([plain.parent])
    assert run.paths == tuple(plain.parent.glob('bag.db3*'))


def test_a_heading_without_end_costs_no_other_value_of_a_log_of_ardupilot(files, tmp_path):
    needs('ardupilot')
    path = tmp_path / 'log.bin'
    about = struct.pack('<BB4s16s64s', 132, 15, b'ATT', b'Qf', b'TimeUS,Yaw')
    endless = struct.pack('<Qf', 79_000_000, math.inf)
    start = b'\xa3\x95'
    raw = files['ardupilot'].read_bytes() + start + b'\x80' + about + start + b'\x84' + endless
    path.write_bytes(raw)
    assert any('no possible value' in line for line in told(path))
    found, whole = (
        values(block_of(each), Channel.POSITION_GEODETIC) for each in (path, files['ardupilot'])
    )
    np.testing.assert_array_equal(found, whole)


def test_frames_of_senders_that_have_names_are_never_mixed() -> None:
    packets = n2k._Packets()

    def push(data: bytes) -> list[bytes | None]:
        frames = (n2k.N2kFrame(0, 0, 129029, f'{k:016X}', data, False) for k in range(60))
        return [packets.whole(frame) for frame in frames]

    assert push(bytes([0x20, 13, *range(6)])) == [None] * 60
    assert push(bytes([0x21, *range(6, 13)])) == [bytes(range(13))] * 60


def test_a_line_of_deep_brackets_is_counted(tmp_path: Path) -> None:
    path = tmp_path / 'log.jsonl'
    deep = '{"updates":' + '[' * 30_000
    path.write_bytes(made.signalk() + b'\n' + deep.encode())
    assert any('more than 12 brackets deep' in line for line in told(path))


def test_a_depth_below_the_transducer_of_signal_k_is_taken_with_its_depth(tmp_path: Path) -> None:
    path = tmp_path / 'log.jsonl'
    path.write_bytes(made.signalk().replace(b'environment.wind.speedApparent', BELOW.encode()))
    assert any(f'{BELOW} (--transducer M makes it the depth)' in line for line in told(path))
    depth = values(block_of(path, transducer=2.5), Channel.DEPTH)[:, 0]
    assert depth == pytest.approx([8.12 + 2.5] * made.ROWS)


def test_a_packed_bomb_ends_in_an_error(tmp_path: Path) -> None:
    path = tmp_path / 'bomb.csv.gz'
    with gzip.open(path, 'wb', compresslevel=9) as file:
        file.write(b'time,speed_through_water\n')
        for _ in range(80):
            file.write(b'1,7\n' * (1 << 18))
    with pytest.raises(ImportDataError, match='unpacks to more than 200 times its size'):
        read_any([path])


def test_times_that_jump_away_and_back_are_left_out(tmp_path: Path) -> None:
    lines = made.candump().decode().splitlines()
    lines[70] = lines[70].replace('(17', '(18', 1)
    lines[140] = lines[140].replace('(17', '(16', 1)
    path = tmp_path / 'log.txt'
    path.write_text('\n'.join(lines))
    assert np.ptp(block_of(path).stamp_ns) == (made.ROWS - 1) * 10**9
    assert any('time: 2 rejected, jumps away and back' in line for line in told(path))


def test_the_formats_load_no_library_before_it_is_needed() -> None:
    code = (
        'from shipdrag_ros.sources import formats; formats.found(); import sys; '
        'print(*{"nmea2000", "pymavlink", "pyulog"} & set(sys.modules))'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ''
