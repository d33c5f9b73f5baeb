# SPDX-License-Identifier: Apache-2.0
"""A stop that a person tells dates a coastdown, and makes none where there is none."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.bags import StopMark, open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.coastdown.events import EndedCoastdown, Event
from shipdrag_ros.errors import BagError
from shipdrag_ros.estimation import estimate_final
from shipdrag_ros.estimation.run_down import RunDown
from shipdrag_ros.messages import EventKind, EventNote, encode, event_message
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import coast_windows, replay
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from tests.runs import write_run

START_NS = 1_700_000_000_000_000_000
STOP_S = 400.0


@pytest.mark.parametrize('clock_s', [0.0, 3600.0])
def test_a_stop_is_of_the_clock_of_the_bag(
    tmp_path: Path, ship: Ship, voyage: Callable[..., Block], clock_s: float
) -> None:
    block = voyage()
    log = block[block.channel == Channel.SPEED_THROUGH_WATER]
    log = replace(log, receive_ns=log.receive_ns + round(clock_s * 1e9))
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', log, ship)])
    assert run.span_ns is not None
    day = datetime.fromtimestamp(run.span_ns[0] * 1e-9 + STOP_S, UTC)
    starts = [
        replay(run, stop=stop, compare=False).coastdowns[0].start_ns for stop in (STOP_S, day)
    ]
    assert starts[0] == pytest.approx(START_NS + STOP_S * 1e9, abs=15e9)
    assert starts[0] == starts[1]


@pytest.mark.parametrize('stop', [-1.0, 1e6, 1e305, datetime(2001, 1, 1, tzinfo=UTC)])
def test_a_stop_outside_of_the_bag_is_an_error(
    recording: tuple[Path, list[Event]], stop: float | datetime
) -> None:
    (run,) = open_runs([recording[0]])
    said = '2001-01-01T00:00:00' if isinstance(stop, datetime) else f'{stop} s'
    with pytest.raises(BagError, match=r'stop at .*expected inside of .* s long') as error:
        replay(run, stop=stop)
    assert f'stop at {said}' in str(error.value)
    assert 'begins at 2023-11-14' in str(error.value)


def test_a_stop_before_any_speed_is_an_error(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    with pytest.raises(BagError, match='no speed was read before the stop'):
        replay(run, stop=0.0)


@pytest.mark.parametrize('text', ['noon', '2026-06-01T08:05:00', '-3', 'nan'])
def test_a_stop_that_is_no_time_is_refused(
    recording: tuple[Path, list[Event]], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(['replay', str(recording[0]), f'--stop={text}'])
    assert ended.value.code == 2
    assert 'expected s from the start of the bag, or a time of day' in capsys.readouterr().err


@pytest.mark.parametrize(('own', 'more'), [('', ['--window', '1', '900']), ('@1:900', [])])
def test_a_window_beside_a_stop_is_refused(
    recording: tuple[Path, list[Event]],
    capsys: pytest.CaptureFixture[str],
    own: str,
    more: list[str],
) -> None:
    assert main(['replay', f'{recording[0]}{own}', '--stop', '400', *more]) == 1
    assert 'a window and a stop are given; give one of them' in capsys.readouterr().err


def test_what_a_bag_holds_is_not_denied_with_a_stop(
    tmp_path: Path, recording: tuple[Path, list[Event]], capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'told.json'
    assert main(['replay', str(recording[0]), '--stop', '400', '--json', str(path)]) == 0
    told = capsys.readouterr()
    assert 'or was replayed with another ship file' in told.out
    words = ' is weighed by the regime filter; coastdowns begin at: '
    assert words in told.err
    assert words in told.out
    assert any(words in each['warning'] for each in json.loads(path.read_text())['warnings'])


def test_a_stop_that_is_told_on_board_is_replayed_to_the_bit(
    tmp_path: Path, ship: Ship, voyage: Callable[..., Block], live: type[Any]
) -> None:
    block = voyage()
    messages = list(encode(block[block.channel != Channel.SHAFT]))
    at = next(i for i, each in enumerate(messages) if each.log_ns > START_NS + 405e9)
    session = live(ship, Parameters(update_s=30.0))
    session.start(tmp_path / 'a.mcap')
    for message in messages[:at]:
        session.receive(message)
    now_ns = messages[at - 1].log_ns
    told = EventNote(EventKind.ENGINE_STOPPED, now_ns, 'the engine was stopped')
    session.write_output(event_message(told), now_ns)
    assert session.monitor.engine_stopped(now_ns) == ''
    for message in messages[at:]:
        session.receive(message)
    session.stop(messages[-1].log_ns)
    (run,) = open_runs([tmp_path / 'a.mcap'])
    assert StopMark(now_ns) in list(run.inputs())
    result = replay(run)
    assert result.recorded.compared == result.recorded.identical > 10
    (told,) = result.coastdowns
    assert told.onset_detected_ns is not None
    assert told.onset_detected_ns < now_ns + 40e9  # 15 s later without it
    # and the fit of the whole of it has the time, on board and in replay
    (ended,) = (each for each in session.events if isinstance(each, EndedCoastdown))
    windows = [session.monitor.ended_window(ended), *(each for _, each in coast_windows(result))]
    said = [RunDown.of(each, ship) for each in windows]
    assert said[0] == said[1]
    assert said[0].stop_ns == pytest.approx(now_ns, abs=6e9)
    assert said[0].stop_sd_s < 6.0
    found = [estimate_final(each, ship, Parameters(update_s=30.0)) for each in windows]
    assert np.array_equal(found[0].calm.resistance_m_s2, found[1].calm.resistance_m_s2)
    assert np.array_equal(found[0].calm.sigma_m_s2, found[1].calm.sigma_m_s2)


@pytest.mark.parametrize('verb', ['forecast', 'diagnose'])
def test_other_verbs_take_a_stop(
    recording: tuple[Path, list[Event]], capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    assert main([verb, str(recording[0]), '--stop', '1e6']) == 1
    assert 'stop at 1000000.0 s: expected inside of' in capsys.readouterr().err
