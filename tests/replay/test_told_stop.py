# SPDX-License-Identifier: Apache-2.0
"""A stop that a person tells dates a coastdown, and makes none where there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.coastdown.events import Event
from shipdrag_ros.errors import BagError
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship

WriteRun = Callable[..., Path]
START_NS = 1_700_000_000_000_000_000
STOP_S = 400.0


@pytest.mark.parametrize('clock_s', [0.0, 3600.0])
def test_a_stop_is_of_the_clock_of_the_bag(
    tmp_path: Path, ship: Ship, voyage: Callable[..., Block], write_run: WriteRun, clock_s: float
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


@pytest.mark.parametrize('stop', [-1.0, 1e6, datetime(2001, 1, 1, tzinfo=UTC)])
def test_a_stop_outside_of_the_bag_is_an_error(
    recording: tuple[Path, list[Event]], stop: float | datetime
) -> None:
    (run,) = open_runs([recording[0]])
    with pytest.raises(BagError, match=r'stop at .* s: expected inside of .* s long'):
        replay(run, stop=stop)


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


def test_a_window_beside_a_stop_is_refused(
    recording: tuple[Path, list[Event]], capsys: pytest.CaptureFixture[str]
) -> None:
    given = ['replay', str(recording[0]), '--stop', '400', '--window', '1', '900']
    assert main(given) != 0
    assert '--window and --stop: give one of them' in capsys.readouterr().err
