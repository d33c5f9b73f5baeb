# SPDX-License-Identifier: Apache-2.0
"""Replay gives what the node gave, bit for bit, or tells where not; a window given by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros import __version__
from shipdrag_ros.bags import BagWriter, StopMark, open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedBy,
    EndedCoastdown,
    Event,
    InputCounts,
    Onset,
    Update,
)
from shipdrag_ros.errors import BagError, SimulationError
from shipdrag_ros.estimation import estimate_final
from shipdrag_ros.estimation.run_down import RunDown
from shipdrag_ros.messages import (
    EncodedMessage,
    EventKind,
    EventNote,
    encode,
    event_message,
    types,
)
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import Recorded, ReplayResult, coast_windows, replay
from shipdrag_ros.replay.coasts import why_no_coastdown
from shipdrag_ros.replay.playback import told_beside
from shipdrag_ros.samples import Block, Channel, concatenate, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship, StatedEffect
from tests.runs import write_run

START_NS = 1_700_000_000_000_000_000
STOP_S = 400.0


def replayed(path: Path) -> ReplayResult:
    (run,) = open_runs([path])
    assert run.warnings == ()
    return replay(run)


def test_replay_gives_the_live_figures_bit_for_bit(recording, ship, parameters):
    path, events = recording
    result = replayed(path)
    updates = [event for event in events if isinstance(event, Update)]
    assert len(updates) > 10
    # speed, resistance, curve, forecast and path of each; the last three once more at the end
    count = 5 * len(updates) + 3
    assert result.recorded == Recorded(count, count, None, by=__version__, beside=count)
    assert result.parameters == parameters
    assert result.ship == ship
    (coastdown,) = result.coastdowns
    assert coastdown.ended_by is EndedBy.RECORD_END
    assert coastdown.estimate is not None
    curve = coastdown.estimate.valid_curve
    np.testing.assert_allclose(
        curve.resistance_m_s2[5:-5], curve.speed_m_s[5:-5] ** 2 / 3000.0, rtol=0.2
    )
    assert [type(event) for event in result.events] == [Onset, EndedCoastdown]
    assert result.inputs['shaft'].messages == result.inputs['shaft'].used == 1100
    assert list(result.inputs) == ['speed_through_water', 'position', 'heading', 'shaft']


def test_further_instruments_are_recorded_in_their_order_and_replayed_bit_for_bit(
    voyage: Callable[..., Block], live: Any, ship: Ship, tmp_path: Path
) -> None:
    block = voyage()
    both = []
    for channel in (Channel.SPEED_THROUGH_WATER, Channel.POSITION):
        part = block[block.channel == channel]
        code = np.full(len(part), Channel[f'{channel.name}_2'], np.uint8)
        noise = np.random.default_rng(3).normal(0.0, 0.02, part.value.shape)
        both.append(replace(part, channel=code, value=part.value + noise))
    block = in_arrival_order([block, *both])
    live(ship).record(tmp_path / 'live.mcap', block)
    result = replayed(tmp_path / 'live.mcap')
    assert result.recorded is not None
    assert result.recorded.identical == result.recorded.compared > 50
    assert result.inputs['speed_through_water_2'] == InputCounts(1100, 1100, {})
    assert result.inputs['position_2'].used == 1100
    (run,) = open_runs([tmp_path / 'live.mcap'])
    heard = run.inputs().block()
    assert heard.channel.tolist() == block.channel.tolist()


def test_what_is_not_compared_is_left_out_and_the_final_figure_is_the_same(recording):
    path, events = recording
    (run,) = open_runs([path])
    result = replay(run, compare=False)
    assert result.recorded == Recorded(0, 0, None, by=__version__)
    (found,) = result.coastdowns
    (live,) = (event for event in events if isinstance(event, EndedCoastdown))
    assert (found.start_ns, found.end_ns) == (live.start_ns, live.end_ns)
    assert found.estimate is not None
    assert live.estimate is not None
    assert found.estimate.curve.resistance_m_s2.tobytes() == (
        live.estimate.curve.resistance_m_s2.tobytes()
    )


@pytest.mark.parametrize(
    ('name', 'key', 'says'),
    [
        ('foulng', 'friction_factor', "effects: 'foulng' is not known; known are added_mass"),
        ('fouling', 'friction', "effects: fouling: parameter 'friction' is not known"),
    ],
)
def test_a_misspelt_effect_of_a_ship_file_is_named(recording, ship, name, key, says) -> None:
    (run,) = open_runs([recording[0]])
    stated = StatedEffect(name, {key: Parameter(0.3, 0.1)})
    with pytest.raises(SimulationError, match=says):
        replay(run, ship=replace(ship, effects=(stated,)))


def test_a_bag_with_a_misspelt_effect_is_replayed_with_another_ship_file(
    recording: tuple[Path, list[Event]], ship: Ship
) -> None:
    (run,) = open_runs([recording[0]])
    stated = StatedEffect('foulng', {'friction_factor': Parameter(0.3, 0.1)})
    run.attachments['ship.yaml'] = replace(ship, effects=(stated,)).to_yaml()
    assert len(replay(run, ship=ship).coastdowns) == 1
    with pytest.raises(SimulationError, match='foulng'):
        replay(run)


def test_another_ship_or_parameters_are_used_and_not_compared(recording, ship, parameters):
    path, _ = recording
    (run,) = open_runs([path])
    own = replay(run)
    larger = replay(run, ship=replace(ship, length_m=170.0))
    assert larger.recorded == Recorded(0, 0, None, by=__version__)
    assert larger.ship.length_m == 170.0
    assert own.coastdowns[0].estimate is not None
    assert larger.coastdowns[0].estimate is not None
    assert (
        larger.coastdowns[0].estimate.curve.froude[-1]
        < own.coastdowns[0].estimate.curve.froude[-1]
    )
    speed_only = replay(run, parameters=replace(parameters, estimator='s1_speed'))
    assert speed_only.recorded == Recorded(0, 0, None, by=__version__)
    assert speed_only.coastdowns[0].estimate is not None
    assert speed_only.coastdowns[0].estimate.estimator == 's1_speed'
    # the same as its own, given explicitly, is compared
    assert replay(run, ship=ship, parameters=parameters).recorded == own.recorded


def test_progress_is_told_and_ends_at_the_total(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    told: list[tuple[int, int]] = []
    replay(run, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (4400, 4400)
    assert len(told) > 1


def test_rejected_samples_are_counted_in_a_window_and_in_a_replay(tmp_path, ship, voyage):
    block = voyage(steady_s=60.0, coast_s=60.0)
    value = block.value.copy()
    log = np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)
    value[log[10], 0] = np.nan
    value[log[20], 0] = 99.0
    (run,) = open_runs([write_run(tmp_path / 'a.mcap', replace(block, value=value), ship)])
    counts = replay(run).inputs['speed_through_water']
    assert (counts.used, counts.rejected) == (counts.messages - 2, {'nan': 1, 'absurd': 1})
    # what is read before a window, to judge what is in it by, is none of its messages
    counts = replay(run, window=(15.0, 100.0)).inputs['speed_through_water']
    assert (counts.messages, counts.used, counts.rejected) == (86, 85, {'absurd': 1})


def test_of_several_joints_a_message_each_reading_is_counted(tmp_path: Path, ship: Ship) -> None:
    joints = ['shaft_port', 'pitch_port', *(f'shaft_{letter}' for letter in 'abcd')]
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for i in range(1, 11):
            message = types.make(
                types.JOINT_STATE,
                header=types.header(i * 10**9, ''),
                name=joints,
                position=np.full(6, 0.5),
                velocity=np.full(6, np.nan if i == 4 else 7.0),
                effort=np.empty(0),
            )
            payload = types.serialize(types.JOINT_STATE, message)
            bag.put(EncodedMessage('/shaft', types.JOINT_STATE, payload, i * 10**9, i * 10**9))
    (run,) = open_runs([tmp_path / 'a.mcap'])
    counts = replay(run, ship=ship).inputs['shaft']
    assert counts == InputCounts(10, 9 * 4 + 10, {'surplus_joint': 10, 'nan': 4})


@pytest.mark.parametrize('clock_s', [0.0, 3600.0])
def test_a_stop_is_of_the_clock_of_the_bag(tmp_path, ship, voyage, clock_s):
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
def test_a_stop_outside_of_the_bag_is_an_error(recording, stop):
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


def test_a_date_without_a_zone_is_no_stop(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    with pytest.raises(BagError, match='expected a date with its zone'):
        replay(run, stop=datetime(2023, 11, 14, 22, 20))


@pytest.mark.parametrize('text', ['noon', '2026-06-01T08:05:00', '-3', 'nan'])
def test_a_stop_that_is_no_time_is_refused(recording, text, capsys):
    with pytest.raises(SystemExit) as ended:
        main(['replay', str(recording[0]), f'--stop={text}'])
    assert ended.value.code == 2
    assert 'expected s from the start of the bag, or a time of day' in capsys.readouterr().err


@pytest.mark.parametrize(('own', 'more'), [('', ['--window', '1', '900']), ('@1:900', [])])
def test_a_window_beside_a_stop_is_refused(recording, capsys, own, more):
    assert main(['replay', f'{recording[0]}{own}', '--stop', '400', *more]) == 1
    assert 'a window and a stop are given; give one of them' in capsys.readouterr().err


def test_what_a_bag_holds_is_not_denied_with_a_stop(tmp_path, recording, capsys):
    path = tmp_path / 'told.json'
    assert main(['replay', str(recording[0]), '--stop', '400', '--json', str(path)]) == 0
    told = capsys.readouterr()
    assert 'or was replayed with another ship file' in told.out
    words = ' is weighed by the regime filter; coastdowns begin at: '
    assert words in told.err
    assert words in told.out
    assert any(words in each['warning'] for each in json.loads(path.read_text())['warnings'])


@pytest.mark.parametrize(('stop', 'denied'), [(405.0, False), (600.0, True), (800.0, False)])
def test_a_stop_that_one_coastdown_has_is_not_denied(recording, stop, denied):
    (run,), (_, events) = open_runs([recording[0]]), recording
    (first,) = (each for each in events if isinstance(each, EndedCoastdown))
    second = replace(first, start_ns=first.start_ns + 400_000_000_000, stop_ns=None)
    said = told_beside(run, stop, [first, second])
    assert ('; none of them is of that stop: check its time and zone' in said) == denied


def test_a_stop_that_is_told_on_board_is_replayed_to_the_bit(tmp_path, ship, voyage, live):
    block = voyage()
    messages = list(encode(block[block.channel != Channel.SHAFT]))
    at = next(i for i, each in enumerate(messages) if each.log_ns > START_NS + 405e9)
    session = live(ship, Parameters(update_s=30.0))
    session.start(tmp_path / 'a.mcap')
    for message in messages[:at]:
        session.receive(message)
    now_ns = messages[at - 1].log_ns
    told = EventNote(EventKind.ENGINE_STOPPED, now_ns, 'the engine was stopped')
    session.write(event_message(told), now_ns, now_ns)
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
    assert all(each.found for each in windows)
    said = [RunDown.of(each, ship) for each in windows]
    assert said[0] == said[1]
    assert said[0].stop_ns == pytest.approx(now_ns, abs=6e9)
    assert said[0].stop_sd_s < 6.0
    found = [estimate_final(each, ship, Parameters(update_s=30.0)) for each in windows]
    assert np.array_equal(found[0].calm.resistance_m_s2, found[1].calm.resistance_m_s2)
    assert np.array_equal(found[0].calm.sigma_m_s2, found[1].calm.sigma_m_s2)


def test_the_ship_file_beside_a_bag_counts_where_none_is_attached(tmp_path, ship, voyage, capsys):
    bare = write_run(tmp_path / 'a.mcap', voyage(coast_s=60.0))
    assert open_runs([bare])[0].ship is None
    beside = replace(ship, name='beside')
    (tmp_path / 'ship.yaml').write_text(beside.to_yaml())
    assert open_runs([bare])[0].ship == beside
    (run,) = open_runs([bare])
    known = run.ship
    (tmp_path / 'ship.yaml').unlink()  # it is read once, so that no run is of two ships
    assert run.ship is known
    (tmp_path / 'ship.yaml').write_text(beside.to_yaml())
    own = write_run(tmp_path / 'b.mcap', voyage(coast_s=60.0), ship)
    assert open_runs([own])[0].ship == ship
    for verb in ('replay', 'forecast'):
        assert main([verb, str(bare)]) == 0
        assert f'{tmp_path / "ship.yaml"} holds for this run' in ''.join(capsys.readouterr())
    about = {'storage_identifier': 'mcap', 'relative_file_paths': ['a.mcap']}
    (tmp_path / 'bag').mkdir()
    bare.rename(tmp_path / 'bag' / 'a.mcap')
    (tmp_path / 'bag/metadata.yaml').write_text(f'rosbag2_bagfile_information: {about}')
    assert open_runs([tmp_path / 'bag'])[0].ship == beside


@pytest.mark.parametrize('verb', ['forecast', 'diagnose'])
def test_other_verbs_take_a_stop(recording: tuple[Path, list[Event]], capsys, verb: str) -> None:
    assert main([verb, str(recording[0]), '--stop', '1e6']) == 1
    assert 'stop at 1000000.0 s: expected inside of' in capsys.readouterr().err


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
