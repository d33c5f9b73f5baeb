# SPDX-License-Identifier: Apache-2.0
"""Lines heard live to messages: values, choice of the source, counts."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipdrag_ros.messages import Source, decode
from shipdrag_ros.nmea.interpreter import BEHIND_NS, SETTLE_NS, SILENT_NS, Interpreter, raw_message
from shipdrag_ros.samples import Channel
from tests.sources.log_samples import sentence

START_NS = 1_700_000_000 * 10**9
LINE = 'udp://127.0.0.1:10110'
KNOT_M_S = 1852.0 / 3600.0


def settled(*contents: str) -> tuple[Interpreter, dict[Channel, tuple[float, float]]]:
    """Hear sentences until their sources are chosen, and once more; return what that gives."""
    interpreter = Interpreter()
    found = {}
    for stamp_ns in (START_NS, START_NS + SETTLE_NS):
        for content in contents:
            for message in interpreter.messages(sentence(content), LINE, stamp_ns):
                source = Source(message.topic.lstrip('/'), message.type)
                block = decode(source, [message.payload], [stamp_ns]).block
                for channel, stamp, value in zip(block.channel, block.stamp_ns, block.value):
                    assert stamp == stamp_ns
                    found[Channel(channel)] = (float(value[0]), float(value[1]))
    return interpreter, found


@pytest.mark.parametrize(
    ('content', 'channel', 'value'),
    [
        ('IIVHW,,T,,M,10.0,N,18.5,K', Channel.SPEED_THROUGH_WATER, (10 * KNOT_M_S, 0)),
        ('VWVBW,5.0,0.0,A,3.0,4.0,A', Channel.SPEED_OVER_GROUND, (5 * KNOT_M_S, 0)),
        ('GPVTG,90.0,T,,M,6.0,N,11.1,K,A', Channel.SPEED_OVER_GROUND, (6 * KNOT_M_S, 0)),
        (
            'GPRMC,120000,A,5430.000,N,01030.000,E,7.0,90.0,010123,,,A',
            Channel.POSITION_GEODETIC,
            (54.5, 10.5),
        ),
        (
            'GPGGA,120000,5430.000,S,01030.000,W,1,8,1.0,0,M,0,M,,',
            Channel.POSITION_GEODETIC,
            (-54.5, -10.5),
        ),
        ('HEHDT,90.0,T', Channel.HEADING, (0, 0)),
        ('HETHS,0.0,A', Channel.HEADING, (math.pi / 2, 0)),
        ('IIRPM,S,2,60.0,,A', Channel.SHAFT_2, (2 * math.pi, 0)),
        ('WIMWV,0.0,R,10.0,M,A', Channel.WIND_APPARENT, (-10, 0)),
        ('SDDPT,20.0,5.0', Channel.DEPTH, (25, 0)),
        ('IIRSA,10.0,A,,V', Channel.RUDDER, (math.radians(10), 0)),
        ('PUHAW,UVH,3.0,4.0,0.0', Channel.SPEED_THROUGH_WATER, (4 * KNOT_M_S, 0)),
    ],
)
def test_each_sentence(content: str, channel: Channel, value: tuple[float, float]) -> None:
    _, found = settled(content)
    np.testing.assert_allclose(found[channel], value, atol=1e-9)


def test_a_depth_says_what_makes_it_one_from_the_surface() -> None:
    own, _ = settled('SDDPT,20.0,5.0')
    assert own.feeding(LINE) == {'depth': 'SDDPT with its own offset'}
    none, found = settled('SDDPT,20.0,')
    assert none.feeding(LINE) == found == {}
    assert none.no_value == {'depth DPT: state the depth of the transducer': 2}
    stated = Interpreter(3.0)
    for stamp_ns in (START_NS, START_NS + SETTLE_NS):
        (*_, message) = [None, *stated.messages(sentence('SDDPT,20.0,-1.0'), LINE, stamp_ns)]
    assert message is not None
    block = decode(Source('depth', message.type), [message.payload], [0]).block
    assert block.value[0, 0] == 23.0
    assert stated.feeding(LINE) == {'depth': 'SDDPT with the stated depth of the transducer'}


def test_a_heading_that_is_not_measured_is_not_used() -> None:
    interpreter, found = settled('HETHS,0.0,M')
    assert found == {}
    assert interpreter.no_value == {'heading THS: mode M: manual': 2}


def test_two_instruments_are_never_mixed() -> None:
    """The better sentence is chosen after the first seconds, and kept until it is silent."""
    interpreter = Interpreter()
    dual, single = sentence('VWVBW,5.0,0.0,A,,,V'), sentence('IIVHW,,T,,M,9.0,N,,K')
    for step in range(3):
        assert interpreter.messages(single, LINE, START_NS + step) == []
        assert interpreter.messages(dual, LINE, START_NS + step) == []
    now_ns = START_NS + SETTLE_NS
    assert interpreter.messages(single, LINE, now_ns) == []
    assert len(interpreter.messages(dual, LINE, now_ns)) == 1
    assert interpreter.feeding(LINE) == {'speed_through_water': 'VWVBW'}
    assert interpreter.not_taken[LINE]['speed_through_water'] == 7

    later_ns = now_ns + SILENT_NS + 1
    assert interpreter.messages(single, LINE, later_ns) == []
    assert len(interpreter.messages(single, LINE, later_ns + SETTLE_NS)) == 1
    assert interpreter.feeding(LINE) == {'speed_through_water': 'IIVHW'}


def test_a_source_whose_line_is_gone_gives_way_at_once_and_that_is_said() -> None:
    interpreter = Interpreter()
    text = sentence('HEHDT,90.0,T')
    for address in ('tcp://a:1', 'tcp://b:1'):
        interpreter.messages(text, address, START_NS)
    now_ns = START_NS + SETTLE_NS
    assert len(interpreter.messages(text, 'tcp://a:1', now_ns)) == 1
    assert [interpreter.feeding(f'tcp://{each}:1') for each in 'ab'] == [{'heading': 'HEHDT'}, {}]
    interpreter.lose('tcp://b:1')  # feeds nothing
    assert interpreter.messages(text, 'tcp://b:1', now_ns + 1) == []
    interpreter.lose('tcp://a:1')
    assert interpreter.messages(text, 'tcp://b:1', now_ns + 2) == []
    assert len(interpreter.messages(text, 'tcp://b:1', now_ns + 2 + SETTLE_NS)) == 1
    assert interpreter.changes == [
        'heading: now from HEHDT on tcp://b:1, no longer from HEHDT on tcp://a:1'
    ]


def test_a_clock_set_back_makes_no_source_wait() -> None:
    interpreter = Interpreter()
    text = sentence('HEHDT,90.0,T')
    interpreter.messages(text, LINE, START_NS)
    earlier_ns = START_NS - 3600 * 10**9
    interpreter.messages(text, LINE, earlier_ns)
    assert len(interpreter.messages(text, LINE, earlier_ns + SETTLE_NS)) == 1


def test_what_gives_nothing_is_counted() -> None:
    interpreter = Interpreter()
    good = sentence('HEHDT,90.0,T')
    for text in (
        good[:-2] + '00',
        good[:-3],
        'hello',
        sentence('GPXYZ,1'),
        sentence('PRDID,1'),
        sentence('HEHDT,,T'),
        sentence('HEHDT,nan,T'),
        good + good,
    ):
        assert interpreter.messages(text, LINE, START_NS) == []
    assert interpreter.rejected == {
        LINE: {'wrong checksum': 1, 'without checksum': 1, 'no sentence': 1}
    }
    assert interpreter.unknown == {'GPXYZ': 1, 'PRDID': 1}
    assert interpreter.no_value == {'heading HDT: empty': 1, 'heading HDT: not a number': 1}
    assert interpreter.sentences == {LINE: 6}


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        ('HEHDT,1e9999,T', 'heading HDT: not a number'),
        ('WIMWV,1e9999,R,5.0,N,A', 'wind_apparent MWV: not a number'),
    ],
)
def test_a_number_without_end_is_counted(content: str, reason: str) -> None:
    interpreter = Interpreter()
    assert interpreter.messages(sentence(content), LINE, START_NS) == []
    assert interpreter.no_value == {reason: 1}


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=120))
def test_no_text_is_an_error(content: str) -> None:
    interpreter = Interpreter()
    for text in (content, f'${content}', sentence(content)):
        interpreter.messages(text, LINE, START_NS)
    assert raw_message(content, receive_ns=START_NS).payload


def _line_of(k: int) -> list[str]:
    clock = f'12{k // 60:02d}{k % 60:02d}'
    fix = f'GPRMC,{clock},A,5430.000,N,01030.000,E,7.0,90.0,010123,,,A'
    return [sentence(fix), sentence(f'VWVHW,,,,,{10.0 - 0.01 * k:.2f},N,,K')]


def _stamps(times: dict[int, float], lines: Callable[[int], list[str]]) -> list[float]:
    """Return the stamps of the speeds through water [s], of lines read at given times [s]."""
    interpreter, found = Interpreter(), []
    for k, read_s in times.items():
        for line in lines(k):
            read_ns = START_NS + round(read_s * 1e9)
            for message in interpreter.messages(line, LINE, read_ns):
                assert read_ns - 2 * BEHIND_NS < message.log_ns <= read_ns  # of its own receipt
                if message.topic == '/speed_through_water':
                    found.append((message.publish_ns - START_NS) / 1e9)
    return found


def test_a_backlog_after_a_stall_has_its_own_times() -> None:
    # read a second apart with a delay of up to 0.3 s, but 20 s of them together
    times = {k: k + 0.3 * (k % 2) for k in range(100)}
    stalled = times | dict.fromkeys(range(40, 60), 59.95)
    flowing, waited = _stamps(times, _line_of), _stamps(stalled, _line_of)
    assert len(waited) == len(flowing) > 90
    assert np.diff(waited).min() > 0.0  # none is rejected as a repetition
    assert waited == pytest.approx(flowing, abs=1.0)
    assert waited[-30:] == flowing[-30:]  # what flows is stamped with its receipt


@pytest.mark.parametrize(
    'stated', ['GPZDA,{},01,01,2023,00,00', 'GPGGA,{},5430.000,N,01030.000,E,1,8,1.0,0,M,0,M,,']
)
def test_lines_of_a_backlog_before_the_first_that_states_the_time_have_theirs(stated: str) -> None:
    """A log at 10 Hz, a time each second behind it; the wire stands still for 20 s."""

    def lines(k: int) -> list[str]:
        found = [sentence(f'VWVHW,,,,,{10.0 - 0.001 * k:.3f},N,,K')]
        second = k // 10
        clock = f'12{second // 60:02d}{second % 60:02d}.00'
        return found if k % 10 else [*found, sentence(stated.format(clock))]

    times = {k: 0.1 * k for k in range(1000)}
    stalled = times | dict.fromkeys(range(405, 605), 60.45)
    flowing, waited = _stamps(times, lines), _stamps(stalled, lines)
    assert len(waited) == len(flowing) > 950
    assert np.diff(waited).min() > 0.0
    assert waited == pytest.approx(flowing, abs=0.25)
    assert waited[-350:] == flowing[-350:]


def test_a_silence_of_the_log_is_no_backlog() -> None:
    """It speaks every 1.5 s, and from the 45th on no receiver states a time any more."""
    fix = 'GPRMC,12{:02d}{:02d},A,5430.000,N,01030.000,E,7.0,90.0,010123,,,A'

    def lines(k: int) -> list[str]:
        found = [sentence(fix.format(k // 40, 3 * k // 2 % 60))] if k < 30 and not k % 2 else []
        return [*found, sentence(f'VWVHW,,,,,{10.0 - 0.01 * k:.2f},N,,K')]

    times = {k: 1.5 * k for k in range(60)}
    stamps = _stamps(times, lines)
    assert stamps == pytest.approx(list(times.values())[-len(stamps) :])
    assert len(stamps) >= 57


def test_a_receiver_whose_clock_stands_still_delays_nothing() -> None:
    times = {k: float(k) for k in range(50)}
    stamps = _stamps(times, lambda k: [_line_of(0)[0], _line_of(k)[1]])
    assert np.diff(stamps) == pytest.approx(1.0)


def test_a_clock_of_the_node_that_is_set_forward_is_known_after_two_minutes() -> None:
    times = {k: k + 20.0 * (k >= 30) for k in range(300)}
    stamps = _stamps(times, _line_of)
    assert stamps[-1] == times[299]


def test_each_address_is_judged_by_its_own_lines() -> None:
    interpreter = Interpreter()
    other = 'serial:/dev/ttyUSB0:4800'
    speed = sentence('IIVHW,,T,,M,10.0,N,,K')
    interpreter.messages('noise', other, START_NS)
    assert interpreter.rejected[LINE] == {}
    assert interpreter.rejected[other] == {'no sentence': 1}
    for stamp_ns in (START_NS, START_NS + SETTLE_NS):
        interpreter.messages(speed, LINE, stamp_ns)
    assert interpreter.gives_way_to(other) == ''  # which gave no reading yet
    assert interpreter.messages(speed, other, START_NS + SETTLE_NS) == []
    assert interpreter.sentences == {LINE: 2, other: 1}
    assert interpreter.gives_way_to(other) == LINE
    assert interpreter.gives_way_to(LINE) == ''
