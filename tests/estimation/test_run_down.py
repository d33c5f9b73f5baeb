# SPDX-License-Identifier: Apache-2.0
"""The engine stop as the shaft shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.estimation import estimate_final
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.run_down import RunDown
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, sense, simulate

SHIP = Ship.from_yaml(
    'length_m: 150.0\ndisplaced_volume_m3: 20200.0\npropulsion: {run_down_s: 10.0, sd: 5.0}\n',
    subject='ship',
)
STOP_S = 600.0


@pytest.mark.parametrize('turned', [0.0, 0.4, 0.7])
def test_a_propeller_that_the_water_turns_does_not_hide_the_run_down(turned: float) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 2100.0)
    after = np.maximum(time - STOP_S, 0.0)
    # the ship slows down to a third, and the water turns the propeller with it
    by_water = turned / (1.0 + after / 700.0)
    shaft = by_water + (1.0 - by_water) * np.exp(-after / 10.0)
    shaft[time < STOP_S] = 1.0
    values = 12.0 * shaft + rng.normal(0.0, 0.02, len(time))
    block = Block.of(Channel.SHAFT, (time * 1e9).astype(np.int64), values)
    onset_s = STOP_S + 15.0
    window = Window.from_block(block, round(onset_s * 1e9), round(2100 * 1e9), before_ns=0)
    found = RunDown.of(window, SHIP)
    assert found.shaft_s == pytest.approx(10.0, rel=0.1)
    assert found.shaft_sd_s < 1.0
    assert found.stop_ns * 1e-9 == pytest.approx(STOP_S, abs=1.0)
    # what a shaft shows does not depend on what the ship file states
    assert RunDown.of(window, replace(SHIP, propulsion=None)) == found


def cut(
    *blocks: Block, start_s: float = STOP_S, end_s: float = 2100.0, before: bool = True
) -> Window:
    """Cut a window that starts where it is told."""
    return Window.from_block(
        in_arrival_order(list(blocks)),
        round(start_s * 1e9),
        round(end_s * 1e9),
        before_ns=0 if before else None,
    )


def series(channel: Channel, time: Float64, value: Float64) -> Block:
    rng = np.random.default_rng(2)
    noisy = value + rng.normal(0.0, 0.02, len(time))
    return Block.of(channel, (time * 1e9).astype(np.int64), noisy)


def falling(time: Float64, stop_s: float) -> Float64:
    return np.where(time < stop_s, 12.0, 12.0 * np.exp(-(time - stop_s) / 8.0))


TIME = np.arange(0.0, 2100.0)
SPEED = 8.0 / (1.0 + np.maximum(TIME - STOP_S, 0.0) / 700.0)


def test_of_several_shafts_the_last_stop_counts() -> None:
    window = cut(
        series(Channel.SHAFT, TIME, falling(TIME, STOP_S)),
        series(Channel.SHAFT_2, TIME, falling(TIME, STOP_S + 90.0)),
    )
    found = RunDown.of(window, SHIP)
    assert found.stop_ns * 1e-9 == pytest.approx(STOP_S + 90.0, abs=1.0)
    assert 'propeller 2 shows the stop' in found.notes[0]


READ_LATE = TIME > STOP_S + 50.0


@pytest.mark.parametrize(
    ('shafts', 'stands'),
    [
        ([(TIME, falling(TIME, STOP_S))], True),
        ([(TIME, falling(TIME, STOP_S)), (TIME, np.full(len(TIME), 12.0))], False),
        ([(TIME, np.where(TIME < STOP_S, 12.0, 7.0)), (TIME, falling(TIME, STOP_S + 20))], False),
        ([(TIME, falling(TIME, STOP_S)), (TIME, np.zeros(len(TIME)))], True),
        ([(TIME, np.zeros(len(TIME)))], False),
        ([(TIME[READ_LATE], np.zeros(READ_LATE.sum()))], True),
    ],
    ids=['one', 'one drives on', 'one drives at part', 'one dead', 'dead', 'read late'],
)
def test_no_thrust_is_left_where_all_shafts_that_are_read_stand(shafts, stands) -> None:
    channels = Channel.SHAFT, Channel.SHAFT_2
    of_shafts = [series(channel, *each) for channel, each in zip(channels, shafts)]
    window = cut(*of_shafts, series(Channel.SPEED_THROUGH_WATER, TIME, SPEED))
    assert RunDown.of(window, SHIP).stands is stands


def test_the_pitch_of_a_propeller_dates_the_stop_where_the_shaft_goes_on() -> None:
    pitch = np.clip(1.0 - (TIME - STOP_S) / 12.0, 0.0, 1.0)
    window = cut(
        series(Channel.SHAFT, TIME, np.full(len(TIME), 12.0)), series(Channel.PITCH, TIME, pitch)
    )
    found = RunDown.of(window, SHIP)
    assert found.stop_ns * 1e-9 == pytest.approx(STOP_S, abs=6.0)
    assert found.stop_sd_s < 5.0
    assert 'the pitch shows the stop' in found.notes[0]


@pytest.mark.parametrize(
    ('shaft', 'says'),
    [
        (np.zeros(len(TIME)), 'the shaft stands whenever it is received in the window'),
        (np.where(TIME < 900.0, 30.0, 29.0), 'if it drives the ship, r may be off by its thrust'),
        (0.6 * SPEED / 8.0 * 12.0, 'as the water turns it'),
    ],
)
def test_without_a_record_before_it_the_window_tells_what_the_shaft_shows(shaft, says):
    window = cut(
        series(Channel.SHAFT, TIME, shaft),
        series(Channel.SPEED_THROUGH_WATER, TIME, SPEED),
        before=False,
    )
    found = RunDown.of(window, SHIP)
    assert found.shaft_s == 0.0
    assert len(found.notes) == 1
    assert says in found.notes[0]


def test_a_shaft_that_goes_on_at_part_of_its_speed_is_said() -> None:
    speed = series(Channel.SPEED_THROUGH_WATER, TIME, SPEED)
    slower = np.where(TIME < 900.0, 46.0, 29.0)
    by_water = np.where(TIME < STOP_S, 12.0, 0.6 * SPEED / 8.0 * 12.0)
    for shaft, says in ((slower, 'off by its thrust'), (by_water, 'as the water turns it')):
        found = RunDown.of(cut(series(Channel.SHAFT, TIME, shaft), speed), SHIP)
        assert 'the shaft shows' in found.notes[0]
        assert says in found.notes[-1]
        assert 'begins after the shaft has stopped' not in found.notes[-1]  # as it never does


def test_a_log_that_reads_nothing_at_the_end_says_nothing_of_the_shaft() -> None:
    # a dead band: from some speed on it reads 0
    log = Block.of(
        Channel.SPEED_THROUGH_WATER,
        (TIME * 1e9).astype(np.int64),
        np.where(TIME < 1500.0, SPEED, 0.0),
    )
    found = RunDown.of(cut(series(Channel.SHAFT, TIME, np.full(len(TIME), 6.0)), log), SHIP)
    assert 'off by its thrust' in found.notes[-1]


def test_a_shaft_that_runs_down_in_the_window_is_seen_without_a_record_before_it() -> None:
    window = cut(series(Channel.SHAFT, TIME, falling(TIME, STOP_S)), before=False)
    found = RunDown.of(window, SHIP)
    assert found.shaft_s == pytest.approx(8.0, rel=0.1)
    assert found.stop_ns * 1e-9 == pytest.approx(STOP_S, abs=1.0)


def test_a_stop_inside_a_window_without_a_record_before_it_is_said() -> None:
    window = cut(series(Channel.SHAFT, TIME, falling(TIME, STOP_S + 300.0)), before=False)
    found = RunDown.of(window, SHIP)
    assert found.shaft_s == 0.0
    assert 'an engine stop 300 s after the start of the window' in found.notes[0]


def test_without_any_shaft_the_thrust_is_taken_to_have_ended() -> None:
    window = cut(series(Channel.SPEED_THROUGH_WATER, TIME, SPEED), before=False)
    found = RunDown.of(window, SHIP)
    assert found.notes == ('the thrust is taken to have ended before the window',)


def test_what_a_person_tells_dates_a_stop_that_no_shaft_shows() -> None:
    window = cut(series(Channel.SPEED_THROUGH_WATER, TIME, SPEED), start_s=STOP_S + 20.0)
    for ship in (SHIP, replace(SHIP, propulsion=None)):
        found = RunDown.of(replace(window, told_ns=round(STOP_S * 1e9)), ship)
        assert found.stop_ns * 1e-9 == pytest.approx(STOP_S, abs=6.0)
        assert found.stop_sd_s < 6.0
        assert not found.by_shaft


@pytest.mark.parametrize('off_s', [-3600.0, -200.0, 200.0, 86400.0])
def test_what_a_person_tells_is_not_believed_where_nothing_begins(off_s: float) -> None:
    window = cut(series(Channel.SPEED_THROUGH_WATER, TIME, SPEED))
    told = replace(window, told_ns=round((STOP_S + off_s) * 1e9))
    of_both = [RunDown.of(each, SHIP) for each in (window, told)]
    assert of_both[1].stop_ns * 1e-9 == pytest.approx(STOP_S, abs=1e-3)
    assert of_both[1].stop_sd_s == pytest.approx(of_both[0].stop_sd_s, rel=1e-3)


def test_a_shaft_dates_the_stop_better_than_a_person() -> None:
    window = cut(
        series(Channel.SHAFT, TIME, falling(TIME, STOP_S)),
        series(Channel.SPEED_THROUGH_WATER, TIME, SPEED),
    )
    found = RunDown.of(window, SHIP)
    assert found.by_shaft
    assert RunDown.of(replace(window, told_ns=round((STOP_S + 9.0) * 1e9)), SHIP) == found


BARE = Ship.from_yaml(
    'name: bare\nlength_m: 150.0\ndisplaced_volume_m3: 20200.0\n', subject='bare ship'
)
DRAG_1_M, LEAD_S, COAST_S = 3e-4, 1800, 1200


def final(shaft_rad_s: Float64 | None, seed: int = 0) -> Estimate:
    """Estimate from a log of 0.05 m/s after half an hour at 8 m/s, with a shaft or without."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(LEAD_S + COAST_S) - LEAD_S
    stamps = (np.arange(len(time_s)) * 10**9) + 10**15
    log = speed(time_s) + rng.normal(0.0, 0.05, len(time_s))
    blocks = [Block.of(Channel.SPEED_THROUGH_WATER, stamps, log)]
    if shaft_rad_s is not None:
        read = shaft_rad_s + rng.normal(0.0, 0.02, len(time_s))
        blocks.append(Block.of(Channel.SHAFT, stamps, read))
    start_ns = int(stamps[LEAD_S])
    window = Window.from_block(
        in_arrival_order(blocks), start_ns, int(stamps[-1]), before_ns=int(stamps[0])
    )
    return estimate_final(window, BARE, Parameters())


def speed(time_s: Float64) -> Float64:
    return np.asarray(1.0 / (1.0 / 8.0 + DRAG_1_M * np.maximum(time_s, 0.0)))


@pytest.mark.parametrize('part', [0.35, 0.5, 0.8])
def test_the_water_turns_it_on(part: float) -> None:
    time_s = np.arange(LEAD_S + COAST_S) - LEAD_S
    run_down = 10.0 * np.exp(-np.maximum(time_s, 0.0) / 8.0)
    shaft = np.maximum(run_down, part * 10.0 * speed(time_s) / 8.0)
    with_shaft = final(shaft)
    assert any('as the water turns it' in note for note in with_shaft.notes)
    for at in (4.0, 5.0, 6.0, 7.0):
        expected = (1.0 + float(BARE.n_r(at))) * DRAG_1_M * at**2
        curve = with_shaft.curve
        r = float(np.interp(at, curve.speed_m_s, curve.resistance_m_s2))
        sigma = float(np.interp(at, curve.speed_m_s, curve.sigma_m_s2))
        assert abs(r - expected) < 3.0 * sigma < 0.2 * expected
        alone = final(None).curve
        without = float(np.interp(at, alone.speed_m_s, alone.resistance_m_s2))
        assert abs(r - without) < 0.03 * expected


def test_a_sensor_that_always_reads_zero_is_called_dead() -> None:
    notes = ' '.join(final(np.zeros(LEAD_S + COAST_S)).notes)
    assert 'stood before the stop too: it shows nothing, or its sensor is dead' in notes
    assert 'stands whenever it is received' not in notes


CRAFT = Ship.from_yaml(
    """
name: small craft
length_m: 24.5
displaced_volume_m3: 178.6
breadth_m: 6.5
draught_m: 2.5
added_mass: {model: constant, value: 0.12, sd: 0.02}
propulsion: {run_down_s: 2.0, sd: 0.5}
baseline:
  source: trials
  speed_m_s: [0, 1, 2, 3, 4, 5]
  resistance_n: [0, 650, 2300, 6300, 14600, 28000]
  relative_sd: 0.02
""",
    subject='small craft',
)
SPEED_M_S = 4.3


@pytest.mark.parametrize(
    'sensor',
    [
        Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.02),
        Sensor(channel=Channel.POSITION, sd=0.3),
    ],
    ids=['log', 'fixes'],
)
def test_what_is_lost_before_the_onset_is_read(sensor: Sensor) -> None:
    scenario = Scenario(speed_m_s=SPEED_M_S, lead_in_s=900.0, duration_s=180.0)
    block = sense(simulate(CRAFT, scenario), (sensor,), seed=3)
    stop_ns = START_NS + 900 * SECOND_NS
    window = Window.from_block(
        block, stop_ns + 25 * SECOND_NS, stop_ns + 180 * SECOND_NS, before_ns=START_NS
    )
    curve = estimate_final(window, CRAFT, Parameters()).valid_curve
    true = CRAFT.resistance_n(curve.speed_m_s) / CRAFT.mass_kg
    assert curve.speed_m_s[-1] > 0.98 * SPEED_M_S  # a quarter of it is lost by the onset
    assert np.abs(curve.resistance_m_s2 - true).max() < 0.03 * true.max()
