# SPDX-License-Identifier: Apache-2.0
"""A window given by hand says what would have ended a coastdown that was watched."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros import __version__
from shipdrag_ros.bags import open_runs
from shipdrag_ros.coastdown.events import Dismissal, EndedBy, EndedCoastdown, Event
from shipdrag_ros.errors import BagError
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import Recorded, coast_windows, replay
from shipdrag_ros.replay.coasts import why_no_coastdown
from shipdrag_ros.samples import Block, Channel, concatenate, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship
from tests.runs import write_run

START_NS = 1_700_000_000_000_000_000
BOAT = Ship(length_m=10.0, displaced_volume_m3=5.0, added_mass=ConstantAddedMass(value=0.1))


@pytest.fixture(scope='module')
def plain(recording: tuple[Path, list[Event]]) -> EndedCoastdown:
    """A window of the voyage as it was recorded."""
    (run,) = open_runs([recording[0]])
    (coastdown,) = replay(run, window=(410.0, 1000.0)).coastdowns
    return coastdown


def coasted(path: Path, yaw_rad: np.ndarray, parameters: Parameters) -> EndedCoastdown:
    """Coast for 100 s with this heading, and after 100 s turn right round."""
    time_s = np.arange(200.0)
    stamps = START_NS + (time_s * 1e9).astype(np.int64)
    speed = 4.0 / (1.0 + time_s / 50.0) + np.random.default_rng(1).normal(0.0, 0.01, 200)
    yaw = np.concatenate([yaw_rad, np.linspace(yaw_rad[-1], yaw_rad[-1] + 3.0, 100)])
    yaw = np.arctan2(np.sin(yaw), np.cos(yaw))
    log = Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed)
    heading = Block.of(Channel.HEADING, stamps, yaw)
    (run,) = open_runs([write_run(path, in_arrival_order([log, heading]))])
    (coastdown,) = replay(run, ship=BOAT, parameters=parameters, window=(0.0, 99.0)).coastdowns
    assert coastdown.estimate is not None, coastdown.failure
    return coastdown


@pytest.mark.parametrize(
    ('swing_deg', 'turn_rad', 'told'),
    [(60.0, 0.35, True), (60.0, 1.2, False), (15.0, 0.35, False)],
)
def test_a_turn_at_the_end_of_the_window_is_cut(tmp_path, swing_deg, turn_rad, told):
    # across the cut at 180 degrees, where the reading jumps
    turned = np.radians(swing_deg) * np.clip((np.arange(100.0) - 70.0) / 30.0, 0.0, 1.0)
    coastdown = coasted(tmp_path / 'a.mcap', np.pi - 0.1 + turned, Parameters(turn_rad=turn_rad))
    assert ([cut.reason for cut in coastdown.cuts] == [Dismissal.TURN]) is told
    assert (coastdown.end_ns == START_NS + 99 * 10**9) is not told
    if told:
        assert 'she turns' in coastdown.cuts[0].text
        assert coastdown.end_ns == pytest.approx(START_NS + 70e9, abs=5e9)


def test_a_turn_all_the_time_is_told_and_not_cut(tmp_path: Path) -> None:
    coastdown = coasted(tmp_path / 'a.mcap', np.linspace(0.0, 3.0, 100), Parameters())
    assert coastdown.cuts == ()
    assert coastdown.estimate is not None
    assert any('she turns by 17' in note for note in coastdown.estimate.notes)


def test_a_window_is_estimated_without_an_onset(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    result = replay(run, window=(430.0, 1000.0))
    (coastdown,) = result.coastdowns
    assert coastdown.ended_by is EndedBy.GIVEN
    assert coastdown.onset_detected_ns is None
    assert coastdown.start_ns == START_NS + 430_000_000_000
    assert coastdown.end_ns == START_NS + 1_000_000_000_000
    assert coastdown.estimate is not None
    assert coastdown.heading_rad == pytest.approx(0.7, abs=0.005)
    assert coastdown.estimate.samples['speed_through_water'] == 571
    assert result.recorded == Recorded(0, 0, None, by=__version__)
    shorter = replay(run, window=(430.0, 700.0)).coastdowns[0].estimate
    assert shorter is not None
    assert shorter.curve.speed_m_s[0] > coastdown.estimate.curve.speed_m_s[0]


def test_the_heading_of_a_window_follows_the_convention(recording, parameters):
    (run,) = open_runs([recording[0]])
    compass = replace(parameters, heading_convention='compass')
    (coastdown,) = replay(run, parameters=compass, window=(0.0, 1000.0)).coastdowns
    assert coastdown.heading_rad == pytest.approx(pi / 2 - 0.7, abs=0.02)


def test_a_window_that_gives_nothing_says_why(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    (coastdown,) = replay(run, window=(10.0, 11.0)).coastdowns
    assert coastdown.estimate is None
    assert coastdown.failure


@pytest.mark.parametrize(
    'window', [(-1.0, 5.0), (5.0, 5.0), (6.0, 5.0), (2000.0, 3000.0), (0.0, np.nan), (0.0, np.inf)]
)
def test_a_window_outside_of_the_bag(recording, window):
    (run,) = open_runs([recording[0]])
    with pytest.raises(BagError, match=r'window .* s: expected 0 <= start < end inside of .*live'):
        replay(run, window=window)


def test_a_window_ends_with_the_bag_at_the_latest(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    (coastdown,) = replay(run, window=(410.0, 1e305)).coastdowns
    assert run.span_ns is not None
    assert 0 <= run.span_ns[1] - coastdown.end_ns < 10**8


def test_a_window_is_of_stamps_even_if_the_recorder_has_another_clock(
    tmp_path, ship, voyage, plain
):
    block = voyage()
    later = replace(block, receive_ns=block.receive_ns + 3600 * 10**9)
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', later, ship)])
    (coastdown,) = replay(run, window=(410.0, 1000.0)).coastdowns
    assert coastdown.start_ns == plain.start_ns
    np.testing.assert_array_equal(
        coastdown.estimate.curve.resistance_m_s2, plain.estimate.curve.resistance_m_s2
    )


def test_a_clock_set_in_a_window_is_no_estimate(tmp_path, ship, voyage):
    block = voyage()
    second = replace(block, receive_ns=block.receive_ns + 1200 * 10**9)
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', concatenate([block, second]), ship)])
    result = replay(run, window=(410.0, 2000.0))
    (coastdown,) = result.coastdowns
    assert coastdown.failure is not None
    assert 'a clock was set in the window, at 12' in coastdown.failure
    assert 'choose one that ends before or begins after it' in coastdown.failure
    # nor is it diagnosed
    assert coast_windows(result) == []
    assert 'a clock was set in the window' in why_no_coastdown(result)


def test_what_follows_a_clock_that_was_set_may_have_no_time_of_its_own(tmp_path, ship, voyage):
    block = voyage()
    at_once = np.full(len(block), block.receive_ns[-1])
    both = concatenate([block, replace(block, receive_ns=at_once)])
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', both, ship)])
    (coastdown,) = replay(run, window=(410.0, 2000.0)).coastdowns
    assert coastdown.failure is not None
    assert 'choose one that ends before it' in coastdown.failure
    assert 'import the table again' in coastdown.failure


def test_a_window_behind_a_clock_that_was_set_is_estimated_from_the_record_after_it(
    tmp_path: Path, ship: Ship, voyage: Callable[..., Block], plain: EndedCoastdown
) -> None:
    block = voyage()
    span_ns = int(block.receive_ns[-1] - block.receive_ns[0])
    # the clock is set back by all that was recorded, and the same voyage comes once more
    second = replace(block, receive_ns=block.receive_ns + span_ns + 10**9)
    path = write_run(tmp_path / 'a.mcap', concatenate([block, second]), ship)
    later_s = 1.0 + span_ns * 1e-9
    (run,) = open_runs([path])
    result = replay(run, window=(later_s + 410.0, later_s + 1000.0))
    (coastdown,) = result.coastdowns
    assert coastdown.estimate is not None, coastdown.failure
    ((_, window),) = coast_windows(result)
    assert len(window.speed_through_water) == 591
    assert window.end_ns == coastdown.end_ns
    assert plain.estimate is not None
    np.testing.assert_array_equal(
        coastdown.estimate.curve.resistance_m_s2, plain.estimate.curve.resistance_m_s2
    )
