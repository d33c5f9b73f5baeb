# SPDX-License-Identifier: Apache-2.0
"""Further instruments of a kind: judged one by one, and there when the first one fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown, Event, Onset
from shipdrag_ros.coastdown.vouching import Craft, sound_probabilities
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import INPUTS, Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, Sensor, sense, simulate

LEAD_S, COAST_S = 900.0, 600.0
FIRST, SECOND = Channel.SPEED_THROUGH_WATER, Channel.SPEED_THROUGH_WATER_2


def sailed(ship: Ship, *sensors: Sensor) -> Block:
    scenario = Scenario(speed_m_s=6.0, lead_in_s=LEAD_S, duration_s=COAST_S)
    return sense(simulate(ship, scenario), sensors, seed=4)


def watched(ship: Ship, block: Block) -> tuple[Monitor, list[Event]]:
    monitor = Monitor(ship, Parameters(), estimate=None)
    return monitor, [*monitor.update(block), *monitor.finish()]


def test_numbers_of_channels_stay_as_bags_and_stores_have_them() -> None:
    assert [channel.name for channel in Channel][:16] == [
        *('SPEED_THROUGH_WATER', 'SPEED_OVER_GROUND', 'POSITION', 'POSITION_GEODETIC'),
        *('HEADING', 'SHAFT', 'RUDDER', 'WIND_APPARENT', 'DEPTH', 'SHAFT_2', 'SHAFT_3'),
        *('SHAFT_4', 'PITCH', 'PITCH_2', 'PITCH_3', 'PITCH_4'),
    ]


def test_each_instrument_is_judged_by_itself_and_told_where_it_was_heard(ship: Ship) -> None:
    monitor, _ = watched(ship, sailed(ship, Sensor(channel=FIRST, sd=0.03)))
    assert list(monitor.health()) == list(INPUTS)[:8]
    spiky = Sensor(channel=SECOND, sd=0.03, outlier_fraction=0.05, outlier_size=4.0)
    monitor, _ = watched(ship, sailed(ship, Sensor(channel=FIRST, sd=0.03), spiky))
    health = monitor.health()
    assert list(health) == [*list(INPUTS)[:8], 'speed_through_water_2']
    assert not health['speed_through_water'].rejected
    assert 50 < health['speed_through_water_2'].rejected['outlier'] < 100


@pytest.mark.parametrize(
    ('first', 'second'),
    [
        (FIRST, SECOND),
        (Channel.SPEED_OVER_GROUND, Channel.SPEED_OVER_GROUND_3),
        (Channel.POSITION, Channel.POSITION_2),
    ],
)
def test_the_second_one_carries_on_where_the_first_falls_silent(ship, first, second):
    sd = 3.0 if first is Channel.POSITION else 0.03
    silent = Sensor(channel=first, sd=sd, gaps_s=((LEAD_S + 200.0, 9999.0),))
    (*_, alone) = watched(ship, sailed(ship, silent))[1]
    (onset, ended) = watched(ship, sailed(ship, silent, Sensor(channel=second, sd=sd)))[1]
    assert isinstance(onset, Onset)
    assert isinstance(ended, EndedCoastdown)
    assert isinstance(alone, EndedCoastdown)
    assert ended.ended_by is EndedBy.RECORD_END
    assert (ended.end_ns - alone.end_ns) * 1e-9 == pytest.approx(COAST_S - 200.0, abs=2.0)


@pytest.mark.parametrize('off', [-0.05, 0.05])
def test_a_second_log_in_another_scale_makes_no_step_where_it_carries_on(ship, off):
    silent = Sensor(channel=FIRST, sd=0.03, gaps_s=((LEAD_S + 200.0, LEAD_S + 300.0),))
    block = sailed(ship, silent, Sensor(channel=SECOND, sd=0.03))
    other = (block.channel == SECOND)[:, None]
    block = replace(block, value=np.where(other, 1.0 + off, 1.0) * block.value)
    _, events = watched(ship, block)
    (ended,) = (event for event in events if isinstance(event, EndedCoastdown))
    assert ended.ended_by is EndedBy.RECORD_END


def test_the_second_one_alone_is_a_log_as_well(ship: Ship) -> None:
    (one,) = (e for e in watched(ship, sailed(ship, Sensor(channel=FIRST, sd=0.03)))[1][-1:])
    block = sailed(ship, Sensor(channel=FIRST, sd=0.03))
    moved = replace(block, channel=np.full(len(block), SECOND, np.uint8))
    (other,) = watched(ship, moved)[1][-1:]
    assert isinstance(one, EndedCoastdown)
    assert isinstance(other, EndedCoastdown)
    assert (one.start_ns, one.end_ns) == (other.start_ns, other.end_ns)


def test_the_cut_of_a_record_with_two_logs_changes_nothing(ship: Ship) -> None:
    block = sailed(
        ship,
        Sensor(channel=FIRST, sd=0.03, gaps_s=((LEAD_S + 100.0, LEAD_S + 300.0),)),
        Sensor(channel=SECOND, sd=0.05, rate_hz=2.0),
        Sensor(channel=Channel.POSITION_2, sd=3.0),
    )
    _, whole = watched(ship, block)
    monitor = Monitor(ship, Parameters(), estimate=None)
    pieces: list[Event] = []
    for start in range(0, len(block), 7):
        pieces += monitor.update(block[start : start + 7])
    pieces += monitor.finish()
    assert [repr(event) for event in pieces] == [repr(event) for event in whole]


def test_of_three_logs_the_one_that_disagrees_is_doubted() -> None:
    rng = np.random.default_rng(1)
    speeds = {
        log: 5.0 + 0.02 * rng.standard_normal(10)
        for log in (FIRST, SECOND, Channel.SPEED_THROUGH_WATER_3)
    }
    speeds[SECOND] = speeds[SECOND] - 3.0
    found = sound_probabilities({int(log): each for log, each in speeds.items()}, Craft(60, 1.2))
    assert found.wrong(SECOND) > 0.99
    assert found.wrong(FIRST) < 0.05


def test_two_logs_of_one_driver_in_a_wrong_unit_do_not_outvote_the_positions(ship: Ship) -> None:
    logs = [Sensor(channel=log, sd=0.03) for log in (FIRST, SECOND)]
    ground = [
        Sensor(channel=Channel.SPEED_OVER_GROUND, sd=0.03),
        Sensor(channel=Channel.POSITION, sd=3.0),
    ]
    block = sailed(ship, *logs, *ground)
    by_log = np.isin(block.channel, (FIRST, SECOND))[:, None]
    block = replace(block, value=np.where(by_log, 1.944, 1.0) * block.value)
    left_out = watched(ship, block)[0].left_out()
    assert {'speed_through_water', 'speed_through_water_2'} <= set(left_out)
    assert 'position' not in left_out


def test_noisy_positions_beside_a_quiet_speed_over_ground_are_no_contradiction(ship: Ship) -> None:
    block = sailed(
        ship,
        Sensor(channel=FIRST, sd=0.05),
        Sensor(channel=Channel.SPEED_OVER_GROUND, sd=0.1),
        Sensor(channel=Channel.POSITION, sd=10.0),
        Sensor(channel=Channel.POSITION_2, sd=10.0),
    )
    assert not watched(ship, block)[0].contradictions()
