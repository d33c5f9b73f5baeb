# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedBy,
    EndedCoastdown,
    NotCoastdown,
    Onset,
    State,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.sections import TableBaseline
from shipdrag_ros.simulation import (
    EngineOrder,
    GaussMarkov,
    Scenario,
    Sensor,
    Turn,
    sense,
    simulate,
)
from tests.coastdown.conftest import refuse

START_NS = 1_700_000_000_000_000_000
S = 1_000_000_000
LOG = int(Channel.SPEED_THROUGH_WATER)


def onsets(events):
    return [event for event in events if isinstance(event, Onset)]


def standing(events):
    return [event for event in events if isinstance(event, EndedCoastdown) and event.stands]


def dismissed(events):
    return [event for event in events if isinstance(event, NotCoastdown)]


def with_shaft(block: Block, stamp_ns, turning) -> Block:
    """Add a shaft speed [rad/s] to a record."""
    return in_arrival_order([block, Block.of(Channel.SHAFT, stamp_ns, turning)])


def following(block: Block, fraction: float):
    """A shaft that runs down to a fraction of its turns per way, and then follows the ship."""
    second = (block.stamp_ns - START_NS) / S - 900.0
    way = np.minimum(1.0, 1.0 / (1.0 + np.maximum(second, 0.0) / 410.0))
    low = fraction * way
    down = np.where(second < 0.0, 1.0, low + (1.0 - low) * np.exp(-np.maximum(second, 0.0) / 5.0))
    noise = 0.005 * np.random.default_rng(1).standard_normal(len(block))
    return block.stamp_ns, 11.0 * down * (1.0 + noise)


def after_s(ns: int, lead_in_s: float) -> float:
    return (ns - START_NS) / S - lead_in_s


def test_onset_from_speed_alone(watch, record) -> None:
    announced = []
    for lead_in_s in (90.0, 200.0, 900.0, 2400.0):
        for seed in range(3):
            (onset,) = onsets(watch(record(lead_in_s=lead_in_s, duration_s=400.0, seed=seed)))
            assert -5.0 <= after_s(onset.start_ns, lead_in_s) <= 15.0
            announced.append(after_s(onset.detected_ns, lead_in_s))
    # an announcement may wait until no lower level explains the speed
    assert np.quantile(announced, 0.9) <= 100.0
    assert max(announced) <= 300.0


def test_onset_with_the_shaft_is_sooner_and_sharper(watch, record, sensors) -> None:
    block = record(sensors=(sensors['log'], sensors['shaft']), duration_s=400.0)
    (onset,) = onsets(watch(block))
    assert -1.0 <= after_s(onset.start_ns, 900.0) <= 5.0
    assert after_s(onset.detected_ns, 900.0) <= 45.0


TWO_GLIDES = pytest.mark.xfail(
    strict=True, reason='by a clock that far off she glides, is driven again, and glides'
)


@pytest.mark.parametrize(
    ('slow_s', 'shaft'),
    [
        *((3, shaft) for shaft in (0.0, 0.2, 0.4)),
        *((50, shaft) for shaft in (0.0, 0.3)),
        pytest.param(50, 0.4, marks=TWO_GLIDES),
    ],
)
def test_a_shaft_that_is_ahead_of_a_slow_log_tells_the_onset(
    watch, record, sensors, slow_s: int, shaft: float
) -> None:
    block = record(
        sensors=(sensors['log'], sensors['shaft']),
        orders=(EngineOrder(0.0, shaft=shaft, thrust=0.0),),
        duration_s=600.0,
    )
    behind = np.where(block.channel == LOG, slow_s * S, 0)
    slow = replace(block, stamp_ns=block.stamp_ns - behind)
    events = watch(slow, Parameters(late_s=60.0))
    (onset,) = onsets(events)
    assert onset.start_ns < onset.detected_ns
    (coastdown,) = [event for event in events if isinstance(event, EndedCoastdown)]
    # by the clock of the log, or of the shaft
    assert -5.0 - slow_s <= after_s(coastdown.start_ns, 900.0) <= 15.0
    assert coastdown.ended_by is EndedBy.RECORD_END


@pytest.mark.parametrize('fraction', [0.35, 0.5, 0.65, 0.8])
def test_a_windmilling_shaft_dates_the_stop(watch, record, sensors, fraction: float) -> None:
    block = record(sensors=(sensors['log'],))
    stamps, turning = following(block, fraction)
    (onset,) = onsets(watch(with_shaft(block, stamps, turning)))
    # with the revs of a lower level it is announced once she is slower than at that level
    assert -2.0 <= after_s(onset.start_ns, 900.0) <= 15.0
    assert after_s(onset.detected_ns, 900.0) <= (80.0 if fraction <= 0.5 else 300.0)


def test_an_even_run_down_is_dated_where_the_thrust_is_gone(watch, record, sensors) -> None:
    # over a minute down to a third; two thirds of the turns give no thrust any more
    block = record(sensors=(sensors['log'],))
    stamps, turning = following(block, 0.5)
    second = (stamps - START_NS) / S - 900.0
    ramp = 11.0 * np.clip(1.0 - 0.7 * (second + 30.0) / 60.0, 0.3, 1.0)
    turning = np.where(second < 10.0, ramp, np.minimum(turning, ramp.clip(0.5 * 11.0)))
    (onset,) = onsets(watch(with_shaft(block, stamps, turning)))
    assert -8.0 <= after_s(onset.start_ns, 900.0) <= 5.0


@pytest.mark.parametrize('shaft', [0.9, 1.0])
def test_a_shaft_that_turns_on_has_no_veto(watch, record, sensors, shaft: float) -> None:
    # a controllable propeller at zero pitch that nobody tells of: as with the speed alone
    block = record(
        sensors=(sensors['log'], sensors['shaft']),
        orders=(EngineOrder(0.0, shaft=shaft, thrust=0.0),),
    )
    (onset,) = onsets(watch(block))
    (alone,) = onsets(watch(block[block.channel == LOG]))
    assert abs(onset.start_ns - alone.start_ns) <= 6 * S
    assert after_s(onset.detected_ns, 900.0) <= 260.0


def test_a_stuck_shaft_loses_nothing(watch, record) -> None:
    block = record()
    alone = watch(block)
    for value in (0.0, 11.0, -11.0):
        stuck = watch(with_shaft(block, block.stamp_ns, np.full(len(block), value)))
        (found,), (expected,) = standing(stuck), standing(alone)
        assert abs(found.start_ns - expected.start_ns) <= 15 * S
        assert found.end_ns == expected.end_ns


def test_pitch_to_zero_dates_the_stop(watch, record) -> None:
    block = record()
    second = (block.stamp_ns - START_NS) / S - 900.0
    noise = 0.003 * np.random.default_rng(2).standard_normal(len(block))
    turning = 11.0 * (1.0 + noise)
    pitch = 0.8 * np.clip(1.0 - second / 12.0, 0.0, 1.0) + noise
    both = with_shaft(block, block.stamp_ns, turning)
    both = in_arrival_order([both, Block.of(Channel.PITCH, block.stamp_ns, pitch)])
    (onset,) = onsets(watch(both))
    assert -1.0 <= after_s(onset.start_ns, 900.0) <= 5.0
    assert after_s(onset.detected_ns, 900.0) <= 45.0


@pytest.mark.parametrize('apart_s', [20.0, 90.0, 300.0])
def test_of_several_shafts_the_last_that_stops_counts(watch, record, apart_s: float) -> None:
    orders = (EngineOrder(0.0, shaft=1.0, thrust=0.5), EngineOrder(apart_s, shaft=0.0, thrust=0.0))
    block = record(orders=orders, duration_s=1200.0)
    second = (block.stamp_ns - START_NS) / S - 900.0
    rng = np.random.default_rng(4)
    turning = [
        11.0 * np.where(second < stop, 1.0, np.exp(-np.maximum(second - stop, 0.0) / 8.0))
        * (1.0 + 0.003 * rng.standard_normal(len(block)))
        for stop in (0.0, apart_s)
    ]  # fmt: skip
    both = in_arrival_order(
        [
            block,
            Block.of(Channel.SHAFT, block.stamp_ns, turning[0]),
            Block.of(Channel.SHAFT_2, block.stamp_ns, turning[1]),
        ]
    )
    (onset,) = onsets(watch(both))
    assert -1.0 <= after_s(onset.start_ns, 900.0) - apart_s <= 5.0
    # while the second drives on, nothing is announced
    assert after_s(onset.detected_ns, 900.0) >= apart_s


def test_one_shaft_of_two_is_no_coastdown(watch, record) -> None:
    block = record(orders=(EngineOrder(0.0, shaft=1.0, thrust=0.5),), duration_s=1800.0)
    second = (block.stamp_ns - START_NS) / S - 900.0
    rng = np.random.default_rng(4)
    noise = 1.0 + 0.003 * rng.standard_normal((2, len(block)))
    stopped = 11.0 * np.where(second < 0.0, 1.0, np.exp(-np.maximum(second, 0.0) / 8.0))
    both = in_arrival_order(
        [
            block,
            Block.of(Channel.SHAFT, block.stamp_ns, stopped * noise[0]),
            Block.of(Channel.SHAFT_2, block.stamp_ns, 11.0 * noise[1]),
        ]
    )
    events = watch(both)
    assert onsets(events) == []
    assert {Dismissal.SETTLED} == {one.reason for one in dismissed(events)}


@pytest.mark.parametrize('wait_s', [0.0, 30.0])
def test_of_a_crash_stop_only_the_glide_after_it_is_a_coastdown(watch, record, sensors, wait_s):
    orders = (
        EngineOrder(0.0, shaft=0.0, thrust=0.0),
        EngineOrder(wait_s + 1.0, shaft=-0.6, thrust=-0.6),
        EngineOrder(wait_s + 150.0, shaft=0.0, thrust=0.0),
    )
    events = watch(record(sensors=(sensors['log'], sensors['shaft']), orders=orders))
    (after,) = standing(events)
    # the screw stands again from then on
    assert wait_s + 150.0 <= after_s(after.start_ns, 900.0) <= wait_s + 175.0


def test_what_is_dismissed_is_told_with_figures(watch, record, sensors) -> None:
    (one, *_) = dismissed(watch(record(orders=(EngineOrder(0.0, shaft=0.7, thrust=0.49),))))
    assert one.reason is Dismissal.SETTLED
    assert -60.0 <= after_s(one.start_ns, 900.0) <= 60.0
    assert 'P(gliding) was 0.' in one.text
    turn = record(
        sensors=(sensors['log'], sensors['compass']),
        orders=(),
        turns=(Turn(0.0, 150.0, 0.015, drag_area_m2=12.0),),
    )
    events = watch(turn)
    assert Dismissal.TURN in {one.reason for one in dismissed(events)}
    assert onsets(events) == []
    short = dismissed(watch(record(duration_s=35.0)))
    assert [one.reason for one in short] == [Dismissal.GAP]


def test_a_turn_that_a_radar_shows_is_no_coastdown(watch, record, sensors) -> None:
    block = record(
        sensors=(sensors['log'], sensors['radar']),
        orders=(),
        turns=(Turn(0.0, 150.0, 0.015, drag_area_m2=12.0),),
    )
    assert onsets(watch(block)) == []


def test_false_alarms_per_day_sets_what_is_noticed(ship, record) -> None:

    block = record(duration_s=100.0)

    def noticed_s(parameters: Parameters) -> int:
        monitor = Monitor(ship, parameters)
        for i in range(900, len(block)):
            monitor.update(block[i : i + 1] if i > 900 else block[: i + 1])
            if monitor.state is State.CANDIDATE:
                return i - 900
        raise AssertionError('nothing was noticed')

    eager = noticed_s(Parameters(false_alarms_per_day=100.0))
    assert eager + 2 < noticed_s(Parameters(false_alarms_per_day=0.001))


def test_a_tanker_is_found_in_a_moderate_sea() -> None:
    # 320 m, 312 000 m^3: 5 mm/s^2 at 8 m/s, less than a third of the cargo ship's
    tanker = Ship.from_yaml(
        'length_m: 320.0\n'
        'displaced_volume_m3: 312600.0\n'
        'added_mass: {model: constant, value: 0.08, sd: 0.02}\n'
        'baseline: {speed_m_s: [0.0, 2.0, 4.0, 6.0, 8.0, 9.0],\n'
        '  resistance_n: [0.0, 1.13e5, 4.3e5, 9.4e5, 1.65e6, 2.1e6], relative_sd: 0.05}\n',
        subject='tanker',
    )

    found = 0
    for seed in range(10):
        scenario = Scenario(
            speed_m_s=8.0,
            lead_in_s=1200.0,
            duration_s=700.0,
            water_speed=GaussMarkov(0.03, 60.0),
            seed=seed,
        )
        log = Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.05)
        block = sense(simulate(tanker, scenario), (log,), seed=seed, start_ns=START_NS)
        found += len(
            onsets(Monitor(tanker, Parameters(), estimate=refuse, final=refuse).update(block))
        )
    # of 10, seeds 0..9; each is found with a chance of more than 0.9: 7 or fewer once in 70
    assert found >= 8


def test_a_ship_without_a_baseline_is_judged_by_its_size(record) -> None:

    bare = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    events = Monitor(bare, Parameters(), estimate=refuse, final=refuse).update(record())
    assert len(onsets(events)) == 1


def test_a_yacht_needs_no_parameters_of_her_own() -> None:
    # 10 m: half of her speed is lost in 20 s, mostly to waves
    bare = Ship(length_m=10.4, displaced_volume_m3=6.9)
    speed = np.linspace(0.0, 3.2, 17)
    r = 0.0095 * speed**2 * (1.0 + (speed / 3.5) ** 4)
    table = TableBaseline(tuple(speed.tolist()), tuple((bare.mass_kg * r).tolist()), 0.05)
    yacht = replace(bare, baseline=table)
    scenario = Scenario(speed_m_s=3.0, lead_in_s=480.0, duration_s=180.0)
    log = Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.03)
    for seed in (1, 2):
        block = sense(simulate(yacht, scenario), (log,), seed=seed, start_ns=START_NS)
        monitor = Monitor(bare, Parameters(), estimate=refuse, final=refuse)
        (ended,) = standing([*monitor.update(block), *monitor.finish()])
        assert abs(after_s(ended.start_ns, 480.0)) <= 2.0
        assert after_s(ended.end_ns, 480.0) >= 150.0


def test_what_slows_a_boat_quickly_is_no_power_reduced() -> None:
    # 20 m, r with the square of the speed, and instruments that hardly err
    boat = Ship(length_m=20.0, displaced_volume_m3=40.0)
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 1000.0)
    after = np.maximum(time - 600.0, 0.0)
    speed, way = 4.2 / (1.0 + 0.0147 * after), 4.2 * np.minimum(time, 600.0)
    way += np.log1p(0.0147 * after) / 0.0035
    stamps = START_NS + np.round(time * 1e9).astype(np.int64)
    log, ground, along, across = rng.standard_normal((4, len(time)))
    block = in_arrival_order(
        [
            Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed + 0.026 * log),
            Block.of(Channel.SPEED_OVER_GROUND, stamps, speed + 0.026 * ground),
            Block.of(Channel.POSITION, stamps, np.stack([way + along, across], axis=1)),
        ]
    )
    monitor = Monitor(boat, Parameters(), estimate=refuse, final=refuse)
    events = [*monitor.update(block), *monitor.finish()]
    (ended,) = standing(events)
    assert {each.reason for each in dismissed(events)} <= {Dismissal.PLATEAU}
    assert abs(after_s(ended.start_ns, 600.0)) <= 5.0


@pytest.mark.parametrize('factor', [0.3, 0.6, 1.3])
def test_a_log_alone_that_is_wrong_for_a_minute_hides_no_stop(ship, factor) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 1900.0)
    speed = 8.0 / (1.0 + 0.0019 * np.maximum(time - 900.0, 0.0))
    read = (speed + 0.05 * rng.standard_normal(len(time))) * np.where(
        (time >= 400.0) & (time < 460.0), factor, 1.0
    )
    stamps = START_NS + np.round(time * 1e9).astype(np.int64)
    monitor = Monitor(ship, Parameters(), estimate=refuse, final=refuse)
    events = monitor.update(Block.of(Channel.SPEED_THROUGH_WATER, stamps, read))
    (ended,) = standing([*events, *monitor.finish()])
    assert abs(after_s(ended.start_ns, 900.0)) <= 20.0
    assert ended.ended_by is EndedBy.RECORD_END


def test_a_small_craft_with_short_windows() -> None:
    # 1.2 m, 20 Hz, coasting for 27 s: the record of a towing tank
    model = Ship.from_yaml(
        'length_m: 1.2\n'
        'displaced_volume_m3: 0.015\n'
        'added_mass: {model: constant, value: 0.06, sd: 0.02}\n',
        subject='model',
    )

    parameters = Parameters(slope_window_s=5.0, steady_s=60.0, window_s=60.0, data_stop_s=5.0)
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 87.0, 0.05)
    coasting = np.maximum(0.0, time - 60.0)

    block = Block.of(
        Channel.SPEED_THROUGH_WATER,
        START_NS + np.round(time * 1e9).astype(np.int64),
        0.8 / (1 + coasting * 0.045 / 0.8) + 0.01 * rng.standard_normal(len(time)),
    )
    monitor = Monitor(model, parameters, estimate=refuse, final=refuse)
    events = monitor.update(block) + monitor.finish()
    (onset,) = onsets(events)
    assert abs(after_s(onset.start_ns, 60.0)) <= 3.0
    assert after_s(onset.detected_ns, 60.0) <= 20.0
    (coastdown,) = [event for event in events if isinstance(event, EndedCoastdown)]
    assert coastdown.ended_by is EndedBy.RECORD_END


def test_nothing_starts_below_the_minimum_speed(watch, record) -> None:
    slow = record(speed_m_s=2.3)
    assert onsets(watch(slow, Parameters(froude_min=0.07))) == []
    fast = record(speed_m_s=4.0)
    assert len(onsets(watch(fast, Parameters(froude_min=0.02)))) == 1


def test_outliers_do_not_hide_an_onset(watch, record, sensors) -> None:
    spiky = replace(sensors['log'], outlier_fraction=0.01, outlier_size=2.0)
    found = [
        len(onsets(watch(record(sensors=(spiky,), duration_s=400.0, seed=seed))))
        for seed in range(6)
    ]
    assert sum(found) >= 5


@pytest.mark.parametrize('phase', [0, 1])
def test_a_log_that_reads_every_other_second_is_armed_again(watch, record, phase: int) -> None:
    # a slow-down is dismissed, then the engine stops
    orders = (EngineOrder(0.0, shaft=0.9, thrust=0.8), EngineOrder(1500.0, shaft=0.0, thrust=0.0))
    block = record(orders=orders, lead_in_s=1200.0, duration_s=2400.0)
    second = (block.stamp_ns - START_NS) // S
    (onset,) = onsets(watch(block[second % 2 == phase]))
    assert abs(after_s(onset.start_ns, 1200.0) - 1500.0) <= 15.0


@pytest.mark.parametrize('sd', [4.0, 10.0])
@pytest.mark.parametrize('lead_in_s', [200.0, 450.0])
def test_a_stop_soon_after_the_record_begins_is_found_by_a_radar(
    watch, record, sensors, sd, lead_in_s
) -> None:
    # errors of places are white: those of speeds from them cancel in a slope
    block = record(sensors=(replace(sensors['radar'], sd=sd),), lead_in_s=lead_in_s)
    onset = next(each for each in watch(block) if isinstance(each, Onset))
    assert abs((onset.start_ns - START_NS) * 1e-9 - lead_in_s) < 30.0
