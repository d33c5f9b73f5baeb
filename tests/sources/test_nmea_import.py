# SPDX-License-Identifier: Apache-2.0
"""Logs of NMEA 0183 come in whole, at the right time, and what does not is told."""

from __future__ import annotations

import cmath
import gzip
import math
import os
import random
import tempfile
import time
from datetime import UTC, date, datetime
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.bags import open_runs
from shipdrag_ros.errors import BagError, ImportDataError
from shipdrag_ros.samples import PITCHES, SHAFTS, Block, Channel
from shipdrag_ros.sources.format import Job
from shipdrag_ros.sources.formats.nmea import NmeaResult, read_nmea
from shipdrag_ros.sources.log import Log
from shipdrag_ros.sources.reading import read_any

from .conftest import into_bag
from .log_samples import sentence

KNOT = 1852 / 3600
START = datetime(2024, 2, 28, 12, 0, 0, tzinfo=UTC)
START_NS = int(START.timestamp()) * 10**9
SECOND = 10**9
REAL = 'psaros_lake_geneva.nmea.gz'


def rmc(second: float, *, day: str = '280224', status: str = 'A', more: str = '') -> str:
    """One RMC so many seconds after noon; the position tells the second."""
    hours, rest = divmod(second, 3600)
    minutes, seconds = divmod(rest, 60)
    clock = f'{12 + int(hours):02d}{int(minutes):02d}{seconds:05.2f}'
    return sentence(
        f'GPRMC,{clock},{status},4612.909,N,00610.158,E,05.0,003,{day},,{more or ",A"}'
    )


def run(log: str | bytes, **options: Any) -> tuple[NmeaResult, Block]:
    """Import a log and read the bag."""
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder, 'in.nmea'), Path(folder, 'out.mcap')
        source.write_bytes(log if isinstance(log, bytes) else log.encode())
        try:
            result = into_bag(lambda log, to: read_nmea(Job(log, options), to), source, out)
        except ImportDataError:
            assert not out.exists()
            raise
        (bag,) = open_runs([out])
        assert bag.warnings == ()
        about = yaml.safe_load(bag.attachments['import.yaml'])
        assert about['source'] == 'in.nmea'
        assert about['written'] == result.written
        assert ('log.nmea' in bag.attachments) == result.log_attached
        block = bag.inputs().block()
    assert sum(result.written.values()) == len(block)
    return result, block


def lines(*texts: str) -> str:
    return '\n'.join(texts) + '\n'


def of(block: Block, channel: Channel) -> Block:
    return block[block.channel == channel]


def seconds(block: Block, channel: Channel) -> list[float]:
    """Stamps after the start [s]."""
    return [(stamp - START_NS) / SECOND for stamp in of(block, channel).stamp_ns.tolist()]


def count(result: NmeaResult, name: str) -> dict[str, int]:
    return {reason: each.count for reason, each in result.rejected.get(name, {}).items()}


tenths = st.integers(0, 400)
angles = st.integers(0, 3599)
signed = st.integers(-350, 350)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(tenths, tenths, tenths, angles, angles, signed, signed, signed, signed),
    st.tuples(st.integers(0, 9999), st.integers(0, 99)),
    st.tuples(st.integers(-90 * 60_000, 90 * 60_000), st.integers(-180 * 60_000, 180 * 60_000)),
    st.sampled_from('NKM'),
)
def test_values_are_those_written(case, below, at, unit):
    water, ground, wind, wind_from, heading, variation, deviation, rpm, rudder = case
    (depth, offset), (latitude, longitude) = below, at

    def coordinate(thousandths: int, width: int, sides: str) -> str:
        degrees, minutes = divmod(abs(thousandths), 60_000)
        side = sides[thousandths < 0]
        return f'{degrees:0{width}d}{minutes // 1000:02d}.{minutes % 1000:03d},{side}'

    def easterly(tenths_deg: int) -> str:
        return f'{abs(tenths_deg) / 10:.1f},{"EW"[tenths_deg < 0]}'

    where = f'{coordinate(latitude, 2, "NS")},{coordinate(longitude, 3, "EW")}'
    _, block = run(
        lines(
            sentence(f'GPRMC,120000,A,{where},{ground / 10:05.1f},084.4,280224,003.1,W,A'),
            sentence(f'VWVHW,245.1,T,245.1,M,{water / 10:05.1f},N,,K'),
            sentence(f'WIMWV,{wind_from / 10:05.1f},R,{wind / 10:.1f},{unit},A'),
            sentence(f'HCHDG,{heading / 10},{easterly(deviation)},{easterly(variation)}'),
            sentence(f'ERRPM,S,1,{rpm / 10},100.0,A'),
            sentence(f'AGRSA,{rudder / 10},A,,V'),
            sentence(f'SDDPT,{depth / 10},{offset / 10},'),
        )
    )
    value = {Channel(code): row for code, row in zip(block.channel, block.value, strict=True)}
    exact = {'rtol': 1e-12, 'atol': 1e-12}
    knot = Fraction(1852, 3600)
    speed = {'N': knot, 'K': Fraction(1000, 3600), 'M': 1}[unit] * Fraction(wind, 10)
    air = -float(speed) * cmath.exp(-1j * math.radians(wind_from / 10))  # to port is +y
    true = (heading + deviation + variation) / 10
    yaw = value[Channel.HEADING][0]
    np.testing.assert_allclose(
        value[Channel.SPEED_THROUGH_WATER], [float(knot * water / 10), 0], **exact
    )
    np.testing.assert_allclose(
        value[Channel.SPEED_OVER_GROUND], [float(knot * ground / 10), 0], **exact
    )
    np.testing.assert_allclose(value[Channel.WIND_APPARENT], [air.real, air.imag], **exact)
    # the bow points sin(heading) east and cos(heading) north; yaw is from the east
    np.testing.assert_allclose(
        [math.cos(yaw), math.sin(yaw)],
        [math.sin(math.radians(true)), math.cos(math.radians(true))],
        rtol=0,
        atol=1e-9,
    )
    np.testing.assert_allclose(value[Channel.SHAFT], [rpm / 10 * 2 * math.pi / 60, 0], **exact)
    np.testing.assert_allclose(value[Channel.PITCH], [1.0, 0], **exact)
    np.testing.assert_allclose(value[Channel.RUDDER], [math.radians(rudder / 10), 0], **exact)
    np.testing.assert_allclose(
        value[Channel.DEPTH], [(depth + offset) / 10, 0], rtol=1e-7, atol=1e-7
    )
    np.testing.assert_allclose(
        value[Channel.POSITION_GEODETIC], [latitude / 60_000, longitude / 60_000], **exact
    )
    assert block.stamp_ns.tolist() == [START_NS] * len(block)


@pytest.mark.parametrize(
    ('body', 'channel', 'value'),
    [
        ('VWVHW,,,,,,,18.0,K', Channel.SPEED_THROUGH_WATER, 5.0),
        ('VDVBW,-3.6,0.1,A,3.0,4.0,A,,V,,V', Channel.SPEED_THROUGH_WATER, -3.6 * KNOT),
        ('VDVBW,,,V,3.0,-4.0,A', Channel.SPEED_OVER_GROUND, 5.0 * KNOT),
        ('GPVTG,084.4,T,,M,022.4,N,041.5,K,A', Channel.SPEED_OVER_GROUND, 22.4 * KNOT),
        ('GPVTG,,T,,M,,N,36.0,K', Channel.SPEED_OVER_GROUND, 10.0),
        ('HEHDT,090.0,T', Channel.HEADING, 0.0),
        ('HEHDT,270.0,T', Channel.HEADING, math.pi),
        ('HCHDG,010.0,,,80.0,E', Channel.HEADING, 0.0),
        ('HCHDG,010.0,10.0,W,90.0,E', Channel.HEADING, 0.0),
        ('SDDBT,33.0,f,10.1,M,5.5,F', Channel.DEPTH, 12.6),
        ('SDDBT,10.0,f,,M,,F', Channel.DEPTH, 3.048 + 2.5),
        ('SDDBT,,f,,M,2.0,F', Channel.DEPTH, 3.6576 + 2.5),
        ('SDDPT,10.0,-3.0', Channel.DEPTH, 12.5),
        ('SDDPT,10.0,', Channel.DEPTH, 12.5),
        ('SDDPT,10.0,0.5', Channel.DEPTH, 10.5),
        ('AGRSA,,V,-5.0,A', Channel.RUDDER, -math.radians(5.0)),
        ('WIMWV,0.0,R,10.0,M,A', Channel.WIND_APPARENT, -10.0),
        ('WIMWV,180.0,R,10.0,S,A', Channel.WIND_APPARENT, 4.4704),
    ],
)
def test_every_form(body: str, channel: Channel, value: float) -> None:
    clock = sentence('GPZDA,120000.00,28,02,2024,00,00')
    result, block = run(lines(clock, sentence(body)), transducer=2.5)
    found = of(block, channel)
    assert len(found) == 1
    assert abs(found.value[0, 0]) == pytest.approx(abs(value), rel=1e-7, abs=1e-12)
    if abs(value) < math.pi - 1e-9:
        assert found.value[0, 0] == pytest.approx(value, rel=1e-7, abs=1e-12)
    assert found.stamp_ns.tolist() == [START_NS]
    assert result.magnetic_heading is False


@pytest.mark.parametrize(
    ('body', 'name', 'reason'),
    [
        ('VWVHW,,,,,,,,', 'speed_through_water', 'VWVHW: empty'),
        ('VWVHW,,,,,nan,N,,', 'speed_through_water', 'VWVHW: not a number'),
        ('VWVHW,,,,,1_0,N,,', 'speed_through_water', 'VWVHW: not a number'),
        ('VWVHW', 'speed_through_water', 'VWVHW: empty'),
        ('VDVBW,3.0,0,V,3.0,4.0,A', 'speed_through_water', 'VDVBW: status V'),
        ('VDVBW,3.0,0,OK,3.0,4.0,A', 'speed_through_water', 'VDVBW: status not known'),
        ('VDVBW,3.0,0,A,3.0,,A', 'speed_over_ground', 'VDVBW: empty'),
        ('GPVTG,,T,,M,1.0,N,,K,N', 'speed_over_ground', 'GPVTG: mode N: no fix'),
        ('GPVTG,,T,,M,1.0,N,,K,E', 'speed_over_ground', 'GPVTG: mode E: dead reckoning'),
        ('GPGLL,4612.9,N,00610.1,E,120000,V,N', 'position', 'GPGLL: status V'),
        ('GPGLL,4612.9,N,00610.1,E,120000,A,S', 'position', 'GPGLL: mode S: simulated'),
        ('GPGLL,4612.9,N,00610.1,E,120000,', 'position', 'GPGLL: status empty'),
        ('GPGLL,4660.0,N,00610.1,E,120000,A', 'position', 'GPGLL: no latitude and longitude'),
        ('GPGLL,9100.0,N,00610.1,E,120000,A', 'position', 'GPGLL: no latitude and longitude'),
        ('GPGLL,4612.9,X,00610.1,E,120000,A', 'position', 'GPGLL: no latitude and longitude'),
        ('GPGLL,,,,,120000,A', 'position', 'GPGLL: empty'),
        ('GPGGA,120000,4612.9,N,00610.1,E,0,00,,,M,,M,,', 'position', 'GPGGA: quality 0: no fix'),
        ('GPGGA,120000,4612.9,N,00610.1,E,,00', 'position', 'GPGGA: quality empty'),
        ('HCHDG,10.0,1.0,,,', 'heading', 'HCHDG: deviation neither E nor W'),
        ('ERRPM,E,1,90.0,,A', 'shaft', 'ERRPM: not of a shaft'),
        ('ERRPM,S,1,90.0,,V', 'shaft', 'ERRPM: status V'),
        ('ERRPM,S,5,90.0,,A', 'shaft', 'ERRPM: no number of a shaft from 0 to 4'),
        ('ERRPM,S,-1,90.0,,A', 'shaft', 'ERRPM: no number of a shaft from 0 to 4'),
        ('ERRPM,S,1,90.0,x,A', 'shaft', 'ERRPM: not a number'),
        ('AGRSA,5.0,V,,', 'rudder', 'AGRSA: status V'),
        ('WIMWV,10,T,5,N,A', 'wind_apparent', 'WIMWV: true wind, computed and not measured'),
        ('WIMWV,10,R,5,N,V', 'wind_apparent', 'WIMWV: status V'),
        ('WIMWV,10,R,5,,A', 'wind_apparent', 'WIMWV: no unit'),
        ('SDDBT,,f,10.0,M,,F', 'depth', 'SDDBT: state the depth of the transducer'),
        ('SDDPT,10.0,-3.0', 'depth', 'SDDPT: state the depth of the transducer'),
        ('GPGGA,1260,4612.9,N,00610.1,E,1,00', 'time', 'GPGGA: no time of day'),
        ('GPGLL,4612.9,N,00610.1,E,246000,A', 'time', 'GPGLL: no time of day'),
        ('GPRMC,120000,A,4612.9,N,00610.1,E,1,1,310224', 'time', 'GPRMC: no possible date'),
        ('GPZDA,120000,31,06,2024', 'time', 'GPZDA: no possible date'),
    ],
)
def test_what_a_sentence_does_not_hold_is_counted(body: str, name: str, reason: str) -> None:
    result, block = run(lines(rmc(0), sentence(body), rmc(1)))
    assert count(result, name) == {reason: 1}
    assert (
        result.rejected[name][reason].first[0].startswith(f'line 2: {sentence(body)[1:20]!r}'[:-1])
    )
    assert seconds(block, Channel.POSITION_GEODETIC) == [0.0, 1.0]


def test_a_heading_without_variation_is_marked() -> None:
    magnetic = sentence('HCHDG,090.0,,,,')
    result, _ = run(lines(rmc(0), magnetic))
    assert result.magnetic_heading
    assert result.sources['heading'] == 'HCHDG magnetic'
    # a true one is taken instead, never both
    result, block = run(lines(rmc(0), magnetic, sentence('HEHDT,180.0,T')))
    assert not result.magnetic_heading
    assert result.sources['heading'] == 'HEHDT'
    assert result.not_taken['heading'] == {'HCHDG magnetic': 1}
    assert of(block, Channel.HEADING).value[:, 0] == pytest.approx([-math.pi / 2], rel=1e-12)


# sources


def test_every_shaft_has_a_place_of_its_own() -> None:
    log = []
    for k in range(4):
        log.append(rmc(k))
        log += [
            sentence(f'ERRPM,S,{number},{60 * (number + 1)},{20 * number},A')
            for number in range(4)
        ]
        log.append(sentence('IIRPM,S,2,77,,A'))  # another account of one of them
    result, block = run(lines(*log))
    for number, shaft, pitch in zip((1, 2, 3, 0), SHAFTS, PITCHES, strict=True):
        turns = of(block, shaft).value[:, 0] / (2 * math.pi)
        np.testing.assert_allclose(turns, np.full(4, number + 1), rtol=1e-12)
        np.testing.assert_allclose(of(block, pitch).value[:, 0], np.full(4, 0.2 * number))
    assert result.sources['shaft'] == ', '.join(f'ERRPM shaft {number}' for number in (1, 2, 3, 0))
    assert result.not_taken['shaft'] == {'IIRPM shaft 2': 4}
    assert result.written['shaft'] == 32


def test_an_input_has_one_source() -> None:
    gga = 'GGA,1200{:02d},4612.9,N,00610.1,E,1,08,1,,M,,M,,'
    log = []
    for k in range(8):
        log += [rmc(k), sentence('GN' + gga.format(k)), sentence(f'ERRPM,S,2,{k},,A')]
        if k < 4:
            log += [sentence('VDVBW,5.0,,A'), sentence(f'ERRPM,S,1,{k},,A')]
        log += [sentence('VWVHW,,,,,4.0,N,,')]
        if k < 3:
            log += [sentence('HEHDT,1.0,T')]
        log += [sentence('HCHDG,1.0,,,2.0,E'), sentence('XXVTG,,,,,1.0,N')]
    result, block = run(lines(*log))
    assert result.sources == {
        'speed_through_water': 'VDVBW',  # half as many, and the better
        'speed_over_ground': 'GPRMC',
        'position': 'GPRMC',
        'heading': 'HCHDG',  # HDT has less than half as many
        'shaft': 'ERRPM shaft 1, ERRPM shaft 2',
    }
    assert result.not_taken['position'] == {'GNGGA': 8}
    assert 'shaft' not in result.not_taken  # two shafts are no two accounts of one
    assert result.unknown_talkers == {'XX': 8}
    assert len(of(block, Channel.POSITION_GEODETIC)) == 8


def test_sentences_that_are_not_used_are_counted() -> None:
    others = ['IIMTW,17.5,C', 'IIMTW,17.5,C', 'PVHW,,,,,9.9,N,,', 'GPTXT,01,01,02,Z\xfcrich']
    text = lines(rmc(0), *map(sentence, others), sentence('AIVDM,1,1,,B,177K,0').replace('$', '!'))
    result, _ = run(text.encode('latin-1'))
    assert result.not_used == {'IIMTW': 2, 'PVHW': 1, 'GPTXT': 1, 'AIVDM': 1}
    assert result.unknown_talkers == {}
    assert (result.sentences, result.lines) == (6, 6)
    assert not result.log_attached  # no UTF-8


# time


def vhw(speed: float) -> str:
    return sentence(f'VWVHW,,,,,{speed:.2f},N,,')


def test_the_time_is_that_of_the_last_fix_spread_until_the_next() -> None:
    log = lines(vhw(9), rmc(0), vhw(1), rmc(1), vhw(2), vhw(3), rmc(1), vhw(4), vhw(5), rmc(3))
    result, block = run(log + lines(vhw(6), vhw(7)))
    assert seconds(block, Channel.SPEED_THROUGH_WATER) == [0.0, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0]
    assert count(result, 'speed_through_water') == {'before the first time': 1}
    assert result.repeated == 2  # position and speed of the third RMC
    assert np.all(np.diff(block.receive_ns) >= 0)
    assert np.all(block.receive_ns >= block.stamp_ns)


def test_in_a_gap_only_the_first_has_a_time() -> None:
    result, block = run(lines(rmc(0), vhw(1), vhw(2), vhw(3), rmc(60), vhw(4), vhw(5)))
    assert seconds(block, Channel.SPEED_THROUGH_WATER) == [0.0, 60.0]
    assert count(result, 'speed_through_water') == {'in a gap of the time': 3}


def test_many_samples_of_a_step_are_spread_and_those_of_a_gap_are_not() -> None:
    result, block = run(lines(rmc(0), *[vhw(1)] * 20_000, rmc(7)))
    assert result.written['speed_through_water'] == 20_000
    steps = np.diff(seconds(block, Channel.SPEED_THROUGH_WATER))
    assert steps == pytest.approx(7 / 20_000, abs=1e-9)
    result, _ = run(lines(rmc(0), *[vhw(1)] * 20_000, rmc(70)))
    assert result.written['speed_through_water'] == 1
    assert count(result, 'speed_through_water') == {'in a gap of the time': 19_999}


def test_times_a_little_out_of_order_do_not_set_the_clock_back() -> None:
    gll = sentence('GPGLL,4612.9,N,00610.1,E,120000.50,A,A')
    result, block = run(lines(rmc(0), rmc(1), gll, vhw(1), rmc(2)))
    assert seconds(block, Channel.SPEED_THROUGH_WATER) == [1.0]
    assert result.backward == 0
    result, block = run(lines(rmc(100), vhw(1), rmc(20), vhw(2), rmc(21)))
    assert seconds(block, Channel.SPEED_THROUGH_WATER) == [100.0, 20.0]
    assert result.backward == 5  # all but those of the first RMC and speed
    assert np.all(np.diff(block.receive_ns) >= 0)


def gga(clock: str, quality: int = 1) -> str:
    return sentence(f'GPGGA,{clock},4612.9,N,00610.1,E,{quality},08,1.0,,M,,M,,')


def stamps(block: Block) -> list[str]:
    return [
        datetime.fromtimestamp(ns / 1e9, UTC).strftime('%Y-%m-%d %H:%M:%S.%f')[:-5]
        for ns in of(block, Channel.POSITION_GEODETIC).stamp_ns.tolist()
    ]


def test_midnight_without_a_date() -> None:
    log = lines(gga('235959.50'), gga('000000.00'), gga('000000.50'), gga('113000'), gga('2200'))
    log = log.replace(gga('2200'), gga('220000'))
    _, block = run(log, date=date(2023, 12, 31))
    assert stamps(block) == [
        '2023-12-31 23:59:59.5',
        '2024-01-01 00:00:00.0',
        '2024-01-01 00:00:00.5',
        '2024-01-01 11:30:00.0',
        '2024-01-01 22:00:00.0',
    ]
    for clock in ('000000.00', '120000', '235959.99'):
        _, block = run(lines(gga(clock)), date=date(2023, 12, 31))
        assert stamps(block)[0].startswith('2023-12-31')


def test_a_missing_date_is_asked_for() -> None:
    with pytest.raises(ImportDataError, match=r'times of day, but no date.*--date YYYY-MM-DD'):
        run(lines(gga('235959'), vhw(1)))
    no_fix = sentence('GPRMC,000001,V,,,,,,,060180,,,N')
    with pytest.raises(ImportDataError, match='--date YYYY-MM-DD'):
        run(lines(no_fix, gga('235959')))


def test_times_of_day_before_the_first_date_are_of_the_day_before_midnight() -> None:
    first = sentence('GPZDA,000001.00,01,03,2024,00,00')
    _, block = run(lines(gga('235959'), gga('000000'), first, gga('000002')))
    assert stamps(block) == [
        '2024-02-29 23:59:59.0',
        '2024-03-01 00:00:00.0',
        '2024-03-01 00:00:02.0',
    ]


@pytest.mark.parametrize('day', [date.min, date.max])
def test_a_date_beyond_all_stamps_is_refused(day: date) -> None:
    log = sentence('GPGGA,120000,5430.000,N,01030.000,E,1,8,1.0,0,M,0,M,,')
    with pytest.raises(ImportDataError, match='no possible date'):
        run(log, date=day)


def test_times_without_a_fix_alone_are_times_of_day() -> None:
    with pytest.raises(ImportDataError, match='has times of day, but no date'):
        run(sentence('GPGGA,120000,5430.0,N,01030.0,E,0,8,1,0,M,0,M,,'))


def test_a_sentence_without_a_time_is_counted_once() -> None:
    result, block = run(lines(rmc(0), sentence('GPGLL,4612.9,N,00610.1,E,246000,A'), rmc(1)))
    assert list(result.rejected) == ['time']
    assert result.not_taken == {}
    assert len(block) == 4


def test_the_first_receipt_dates_what_stands_before_it() -> None:
    bodies = [f'GPGGA,12000{k},5430.0,N,01030.0,E,1,8,1,0,M,0,M,,' for k in range(3)]
    first, *others = map(sentence, bodies)
    received = [f'{START_NS // SECOND + k} {each}' for k, each in enumerate(others, 1)]
    _, block = run('\n'.join([first, *received]))
    assert (block.stamp_ns - START_NS).tolist() == [0, SECOND, 2 * SECOND]


def test_times_of_day_that_count_beyond_all_stamps_are_rejected() -> None:
    bodies = (
        f'GPGGA,{11 * k % 24:02d}0000,5430.000,N,01030.000,E,1,8,1.0,0,M,0,M,,' for k in range(9)
    )
    result, block = run('\n'.join(map(sentence, bodies)), date=date(2038, 1, 18))
    assert 0 < len(block) < 9
    assert result.rejected['position']['no possible date'].count == 9 - len(block)


def test_a_leap_second_is_the_midnight_after_it() -> None:
    _, block = run(lines(gga('235959'), gga('235960'), gga('000000')), date=date(2016, 12, 31))
    assert stamps(block) == [
        '2016-12-31 23:59:59.0',
        '2017-01-01 00:00:00.0',
        '2017-01-01 00:00:00.0',
    ]


@pytest.mark.parametrize('late', ['280224', '290224'])
def test_a_date_that_changes_late_at_midnight(late: str) -> None:
    def at(clock: str, day: str) -> str:
        return sentence(f'GPRMC,{clock},A,4612.9,N,00610.1,E,5.0,3,{day},,,A')

    log = lines(at('235959', '280224'), at('000000', late), at('000001', '290224'))
    result, block = run(log)
    assert stamps(block)[1] == '2024-02-29 00:00:00.0'
    assert result.dates_put_right == (late == '280224')


def test_two_digits_of_the_year() -> None:
    for digits, year in (('79', 2079), ('80', 1980), ('99', 1999), ('00', 2000)):
        log = lines(sentence(f'GPRMC,120000,A,4612.9,N,00610.1,E,5.0,3,0102{digits},,,A'))
        if year > 2037:
            with pytest.raises(ImportDataError, match='no possible date'):
                run(log, date=date(2024, 2, 28))
        else:
            assert stamps(run(log)[1])[0].startswith(f'{year}-02-01')


def test_the_week_rollover_of_an_old_receiver() -> None:
    true = date(2024, 2, 28)
    early = date.fromordinal(true.toordinal() - 7168)
    log = lines(rmc(0, day=early.strftime('%d%m%y')), vhw(1), rmc(1, day=early.strftime('%d%m%y')))
    result, block = run(log, date=true)
    assert result.shift_days == 7168
    assert seconds(block, Channel.POSITION_GEODETIC) == [0.0, 1.0]
    assert run(log)[0].shift_days == 0
    with pytest.raises(ImportDataError, match=r'begins on 2004-07-14.*leave --date out'):
        run(log, date=date(2024, 2, 27))


def test_a_time_without_a_fix_counts_only_where_it_goes_on() -> None:
    no_fix = rmc(1, status='V')
    result, block = run(lines(rmc(0), no_fix, vhw(1), rmc(2)))
    assert seconds(block, Channel.SPEED_THROUGH_WATER) == [1.0]
    assert count(result, 'position') == {'GPRMC: status V': 1}
    result, block = run(lines(rmc(0), rmc(0, day='060180', status='V'), vhw(1), rmc(2)))
    assert seconds(block, Channel.SPEED_THROUGH_WATER) == [0.0]
    assert count(result, 'time') == {'GPRMC: without a fix, and not going on from the last': 1}


# times of receipt


@pytest.mark.parametrize(
    'prefix',
    [
        lambda t: f'{t:.3f} ',
        lambda t: f'{round(t * 1000)},',
        lambda t: f'[{t:.3f}] ',
        lambda t: datetime.fromtimestamp(t, UTC).strftime('%Y-%m-%dT%H:%M:%S.%fZ '),
        lambda t: datetime.fromtimestamp(t + 7200, UTC).strftime('%Y-%m-%d %H:%M:%S.%f+02:00;'),
        lambda t: '\\' + sentence(f's:GP,c:{round(t * 1000)}')[1:] + '\\',
    ],
)
@pytest.mark.parametrize('offset_s', [0.0, 40.0])
def test_the_time_since_the_last_fix_is_measured_by_the_logger(prefix, offset_s):
    at = START.timestamp() + offset_s  # the logger's clock need not be right
    log = lines(
        f'{prefix(at + 0.125)}{rmc(0)}',
        f'{prefix(at + 0.375)}{vhw(1)}',
        f'{prefix(at + 1.0)}{vhw(2)}',
        f'{prefix(at + 30.125)}{vhw(2)}',
    )
    result, block = run(log)
    assert result.rejected == {}
    expected = [0.25, 0.875, 30.0]
    assert seconds(block, Channel.SPEED_THROUGH_WATER) == pytest.approx(expected, abs=1e-6)


def test_times_of_receipt_are_enough() -> None:
    log = lines(*(f'{START.timestamp() + 0.1 * k:.3f} {vhw(k)}' for k in range(3)))
    _, block = run(log)
    assert seconds(block, Channel.SPEED_THROUGH_WATER) == pytest.approx([0, 0.1, 0.2], abs=1e-6)
    # and tell the day of a time without a date
    _, block = run(lines(f'{START.timestamp():.3f} {gga("120000")}'))
    assert seconds(block, Channel.POSITION_GEODETIC) == [0.0]
    with pytest.raises(ImportDataError, match='states no time'):
        run(lines(vhw(1)))


def test_a_prefix_that_is_no_time_is_counted_and_its_sentence_taken() -> None:
    result, block = run(
        lines(rmc(0), f'port 3: {vhw(1)}', f'2024-13-01T00:00:00Z {vhw(2)}', rmc(1))
    )
    assert count(result, 'line') == {'prefix not understood': 2}
    assert len(of(block, Channel.SPEED_THROUGH_WATER)) == 2
    result, _ = run(lines(rmc(0), f'\\c:1700000000*00\\{vhw(1)}', f'9999999999 {vhw(1)}'))
    assert count(result, 'line') == {
        'wrong checksum of a TAG block': 1,
        'no possible date before it': 1,
    }


def test_a_long_prefix_costs_no_more_than_its_length() -> None:
    log = lines(rmc(0), *(f'2024-{" " * 3900}x{vhw(1)}' for _ in range(20)))
    begin = time.process_time()
    result, _ = run(log)
    assert time.process_time() - begin < 0.5
    assert count(result, 'line') == {'prefix not understood': 20}


# broken lines and files


def test_checksums() -> None:
    good = vhw(5)
    bare = good.split('*')[0]
    wrong = f'{bare}*{(int(good[-2:], 16) ^ 1):02X}'
    log = lines(rmc(0), good, good.lower().replace('vwvhw', 'VWVHW').replace(',n', ',N'), bare)
    log += lines(wrong, f'{bare}*', f'{bare}*G1', f'{good}0', 'noise', '', '$', '$*00', rmc(1))
    result, block = run(log)
    assert len(of(block, Channel.SPEED_THROUGH_WATER)) == 2
    assert count(result, 'line') == {
        'without checksum': 2,
        'wrong checksum': 4,
        'no sentence': 1,
        'no address': 1,
    }
    result, block = run(log, no_checksum=True)
    assert len(of(block, Channel.SPEED_THROUGH_WATER)) == 3
    with pytest.raises(ImportDataError, match=r'without checksum 1 times.*--no-checksum'):
        run(lines(bare))


@settings(max_examples=60, deadline=None)
@given(place=st.integers(1, 30), byte=st.integers(0, 255))
def test_a_damaged_byte_never_becomes_a_value(place: int, byte: int) -> None:
    text = bytearray(vhw(12.34).encode())
    changed = text[place % len(text)] != byte
    text[place % len(text)] = byte
    _, block = run(lines(rmc(0)).encode() + bytes(text) + b'\n' + lines(rmc(1)).encode())
    found = of(block, Channel.SPEED_THROUGH_WATER)
    if changed and len(found):  # a checksum in small letters is the same
        assert chr(byte).upper() == vhw(12.34)[place % len(text)].upper()
    assert found.value[:, 0] == pytest.approx([12.34 * KNOT] * len(found), rel=1e-12)
    assert len(of(block, Channel.POSITION_GEODETIC)) == 2


@settings(max_examples=40, deadline=None)
@given(st.binary(max_size=600))
def test_any_bytes_in_between_are_counted_or_nothing(noise: bytes) -> None:
    log = lines(rmc(0)).encode() + noise + b'\n' + lines(rmc(1)).encode()
    _, block = run(log, no_checksum=False)
    assert seconds(block, Channel.POSITION_GEODETIC)[0] == 0.0
    assert seconds(block, Channel.POSITION_GEODETIC)[-1] == 1.0


def test_line_ends_marks_and_lost_line_ends() -> None:
    plain = lines(rmc(0), vhw(1), rmc(1))
    expected = run(plain)[1].value.tolist()
    for end in ('\r\n', '\r', '\n\n', '  \n'):
        assert run(plain.replace('\n', end))[1].value.tolist() == expected
    assert run(plain.rstrip())[1].value.tolist() == expected
    assert run('\ufeff' + plain)[1].value.tolist() == expected
    assert run(plain.replace('\n', ''))[1].value.tolist() == expected
    cut = run(plain.replace('\n', '').replace(vhw(1), vhw(1)[:-6]))
    assert count(cut[0], 'line') == {'without checksum': 1}
    with pytest.raises(ImportDataError, match='UTF-16'):
        run(plain.encode('utf-16'))


def test_files_that_are_no_log() -> None:
    for nothing in (b'', gzip.compress(b'')):
        with pytest.raises(ImportDataError, match='is empty'):
            run(nothing)
    for other in (random.Random(1).randbytes(20_000), b'\0' * 9999, b'time,speed\n1,2\n', b'\n\n'):
        with pytest.raises(ImportDataError, match='holds no sentence of NMEA 0183'):
            run(other)
    with pytest.raises(ImportDataError, match='cannot be read'):
        run(b'\x1f\x8bno gzip')
    with pytest.raises(ImportDataError, match=r'gave no sample.*give a log with any of'):
        run(lines(sentence('GPZDA,120000.00,28,02,2024,00,00')))
    with pytest.raises(ImportDataError, match='does not exist'):
        read_nmea(Job(Path('no.nmea')), Log())


def test_a_huge_line_is_counted_once() -> None:
    result, block = run(lines(rmc(0), 'x' * 5_000_000 + rmc(5), 'y' * 4096, rmc(1)))
    assert count(result, 'line') == {'longer than 4096 characters': 2}
    assert seconds(block, Channel.POSITION_GEODETIC) == [0.0, 1.0]
    assert result.lines == 4


def test_a_compressed_log_and_a_cut_one() -> None:
    log = lines(*(line for k in range(2000) for line in (rmc(k), vhw(k % 7)))).encode()
    whole, block = run(gzip.compress(log))
    assert whole.damage == ''
    assert whole.written['position'] == len(block) / 3 == 2000
    assert whole.log_attached
    cut, _ = run(gzip.compress(log)[:-2000])
    assert cut.damage.startswith('after line ')
    assert 0 < cut.written['position'] < 2000
    assert not cut.log_attached
    packed = bytearray(gzip.compress(log))
    packed[len(packed) // 2] ^= 0xFF
    flipped, _ = run(bytes(packed))
    assert flipped.damage != ''
    assert flipped.written['position'] <= 2000


def test_a_long_log_is_not_attached(monkeypatch: pytest.MonkeyPatch) -> None:
    log = lines(rmc(0), rmc(1))
    monkeypatch.setattr('shipdrag_ros.sources.formats.nmea.LOG_LIMIT_BYTES', len(log) - 1)
    assert not run(log)[0].log_attached
    monkeypatch.setattr('shipdrag_ros.sources.formats.nmea.LOG_LIMIT_BYTES', len(log))
    assert run(log)[0].log_attached


def test_the_log_attached_is_the_log(tmp_path: Path) -> None:
    source, out = tmp_path / 'a.log', tmp_path / 'a.mcap'
    source.write_bytes(lines(rmc(0), 'Zürich', vhw(1)).replace('\n', '\r\n').encode())
    into_bag(lambda log, to: read_nmea(Job(log), to), source, out)
    (bag,) = open_runs([out])
    assert bag.attachments['log.nmea'].encode() == source.read_bytes()
    with pytest.raises(BagError, match='exists'):
        into_bag(lambda log, to: read_nmea(Job(log), to), source, out)
    assert out.exists()


def test_cost_is_linear() -> None:
    def cost(n: int) -> float:
        log = lines(*(line for k in range(n) for line in (rmc(k % 3000), vhw(1), vhw(2))))
        times = []
        for _ in range(2):
            begin = time.process_time()
            run(log)
            times.append(time.process_time() - begin)
        return min(times)

    cost(10)
    small, large = cost(250), cost(2000)
    assert large < 16 * small, 'eight times the lines'


@pytest.mark.skipif('SHIPDRAG_DATA' not in os.environ, reason='needs SHIPDRAG_DATA')
def test_a_measured_log_imports_whole() -> None:
    result, block = run(Path(os.environ['SHIPDRAG_DATA'], REAL).read_bytes())
    text = gzip.decompress(Path(os.environ['SHIPDRAG_DATA'], REAL).read_bytes()).decode().split()
    assert result.lines == result.sentences == len(text) == 110931
    assert 'line' not in result.rejected
    assert result.damage == ''
    # every sentence is a message, or counted
    rejected = sum(each.count for by in result.rejected.values() for each in by.values())
    others = sum(result.not_used.values()) + sum(result.not_taken['position'].values())
    both = result.written['position']  # RMC gives two
    assert sum(result.written.values()) - both + rejected + others == len(text)
    speeds = [float(line.split(',')[5]) for line in text if 'VHW' in line and ',N,' in line]
    np.testing.assert_allclose(
        of(block, Channel.SPEED_THROUGH_WATER).value[:, 0], np.array(speeds) * KNOT, rtol=1e-12
    )
    # the log reads 5 % low, and wind comes from ahead of a boat that sails
    water = of(block, Channel.SPEED_THROUGH_WATER).value[:, 0]
    ground = of(block, Channel.SPEED_OVER_GROUND).value[:, 0]
    assert 0.92 < np.median(water[water > 2.0]) / np.median(ground[ground > 2.0]) < 0.97


@pytest.mark.parametrize('written', ['{:%Y-%m-%dT%H:%M:%S.250} ', '{:%Y-%m-%d %H:%M:%S,250},'])
def test_a_time_of_receipt_may_state_no_zone(written: str) -> None:
    lines = [
        f'{written.format(datetime.fromtimestamp(START_NS // SECOND + k, UTC))}{rmc(k)}'
        for k in range(5)
    ]
    result, _ = run('\n'.join(lines))
    assert 'line' not in result.rejected
    assert not result.days_early


def test_dates_before_a_rollover_are_said_where_receipts_are_of_today(tmp_path: Path) -> None:
    lines = [
        f'{datetime.fromtimestamp(START_NS // SECOND + k, UTC):%Y-%m-%dT%H:%M:%SZ} '
        f'{rmc(k, day="140704")}'
        for k in range(5)
    ]
    result, _ = run('\n'.join(lines))
    assert result.days_early == 7168
    assert any('give --date 2024-02-28' in line for line in result.summary(Path('x')))
    log, said = tmp_path / 'log.nmea', list[str]()
    log.write_text('\n'.join(lines))
    read_any([log], show=said.extend)
    (line,) = (line for line in said if '--date 2024-02-28' in line)
    assert '`shipdrag import`, which takes these' in line
    mended, block = run('\n'.join(lines), date=date(2024, 2, 28))
    assert mended.start_ns == int(block.stamp_ns[0]) == START_NS
    assert not any('--date' in line for line in mended.summary(Path('x')))
