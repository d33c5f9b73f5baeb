# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.worlds.propulsion.cases import stops
from benchmarks.worlds.propulsion.score import SUITES, score
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import Dismissal, EndedBy, EndedCoastdown, NotCoastdown, Onset
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.simulation import EngineOrder, Turn
from tests.coastdown.conftest import bits, window_itself

START_NS = 1_700_000_000_000_000_000
S = 1_000_000_000
STOP = EngineOrder(0.0, shaft=0.0, thrust=0.0)


def ended(events) -> list[EndedCoastdown]:
    return [event for event in events if isinstance(event, EndedCoastdown)]


def the_coastdown(events) -> EndedCoastdown:
    (coastdown,) = ended(events)
    return coastdown


def start_s(coastdown: EndedCoastdown) -> float:
    return (coastdown.start_ns - START_NS) / S - 900.0


def end_s(coastdown: EndedCoastdown) -> float:
    return (coastdown.end_ns - START_NS) / S - 900.0


def test_the_minimum_speed_ends_it_and_froude_min_says_which_that_is(ship, watch, record) -> None:
    block = record(duration_s=2500.0)
    coastdown = the_coastdown(watch(block))
    assert coastdown.ended_by is EndedBy.SPEED
    at = np.argmin(np.abs(block.stamp_ns - coastdown.end_ns))
    mean = np.mean(block.value[at - 60 : at + 1, 0])
    np.testing.assert_allclose(mean, ship.speed(0.05), atol=0.1)
    early = the_coastdown(watch(block, Parameters(froude_min=0.1)))
    assert early.ended_by is EndedBy.SPEED
    assert end_s(early) < 0.6 * end_s(coastdown)


@pytest.mark.parametrize(
    ('kind', 'hull', 'seed'), [('declutched', 'tanker', 45), ('slow run-down', 'ferry', 95)]
)
def test_noise_of_positions_begins_no_other_of_a_ship_that_is_too_slow(
    monkeypatch, kind: str, hull: str, seed: int
) -> None:
    monkeypatch.setenv('SPANS', '1')  # no r(v) is estimated
    (case,) = [each for each in stops(seed) if (each.kind, each.hull) == (kind, hull)]
    (row,) = score(case, {'track': SUITES['track + shaft']})
    assert (row.found, row.why) == (True, '')


@pytest.mark.parametrize(
    ('second', 'rate_rad_s'), [('compass', 0.02), ('compass', -0.005), ('radar', 0.02)]
)
def test_a_turn_ends_it_where_it_begins(watch, record, sensors, second, rate_rad_s):
    block = record(
        sensors=(sensors['log'], sensors[second]), turns=(Turn(300.0, 200.0, rate_rad_s),)
    )
    coastdown, after = ended(watch(block))
    assert coastdown.ended_by is EndedBy.TURN
    # a course is the mean of half a minute
    assert 260.0 <= end_s(coastdown) <= 305.0 + (30.0 if second == 'radar' else 0.0)
    # she glides on, and that is a coastdown of its own
    assert 485.0 <= start_s(after) <= 505.0 + (70.0 if second == 'radar' else 20.0)


def on_another_mark(block: Block, at_s: float, seed: int = 0) -> Block:
    """Move all fixes from a time after the stop on by 150 m, to any side."""
    moved = (block.channel == Channel.POSITION) & (block.stamp_ns >= START_NS + (900 + at_s) * S)
    direction = np.random.default_rng(seed).uniform(-np.pi, np.pi)
    value = block.value.copy()
    value[moved] += 150.0 * np.array([np.cos(direction), np.sin(direction)])
    return replace(block, value=value)


def test_a_radar_that_takes_another_mark_is_no_turn(watch, record, sensors) -> None:
    both = record(sensors=(sensors['log'], sensors['radar']))
    start_ns = the_coastdown(watch(both)).start_ns
    for seed, at_s in enumerate((-30.0, 60.0, 300.0, 700.0)):
        coastdown = the_coastdown(watch(on_another_mark(both, at_s, seed)))
        assert coastdown.ended_by is EndedBy.RECORD_END, at_s
        assert abs(coastdown.start_ns - start_ns) <= 5 * S, at_s


def test_single_fixes_far_off_are_no_turn(watch, record, sensors) -> None:
    radar = replace(sensors['radar'], rate_hz=1.0 / 3.0)
    block = record(sensors=(sensors['log'], radar))
    rng = np.random.default_rng(0)
    off = (block.channel == Channel.POSITION) & (rng.random(len(block)) < 0.005)
    value = block.value.copy()
    value[off] += rng.uniform(-300.0, 300.0, (np.count_nonzero(off), 2))
    assert the_coastdown(watch(replace(block, value=value))).ended_by is EndedBy.RECORD_END


def test_a_turn_on_another_mark_ends_it_still(watch, record, sensors) -> None:
    both = record(sensors=(sensors['log'], sensors['radar']), turns=(Turn(500.0, 60.0, 0.02),))
    coastdown = ended(watch(on_another_mark(both, 300.0)))[0]
    assert coastdown.ended_by is EndedBy.TURN
    assert 490.0 <= end_s(coastdown) <= 545.0


def test_fixes_on_another_mark_are_kept_and_live_is_as_replay(ship, record, sensors) -> None:
    block = on_another_mark(
        record(sensors=(sensors['log'], sensors['radar']), duration_s=440.0), 300.0
    )

    def watched(blocks) -> list:
        monitor = Monitor(ship, Parameters(), estimate=window_itself, final=window_itself)
        return [event for part in blocks for event in monitor.update(part)] + monitor.finish()

    events = watched([block])
    window = the_coastdown(events).estimate
    inside = (block.stamp_ns >= window.start_ns) & (block.stamp_ns <= window.end_ns)
    fixes = block.value[inside & (block.channel == Channel.POSITION)]
    # the first few on the other mark wait for those after them
    assert np.array_equal(fixes, window.position.value)
    assert bits(watched([block[i : i + 1] for i in range(len(block))])) == bits(events)


def test_a_hard_turn_shows_in_the_speed_alone(watch, record) -> None:
    turn = Turn(400.0, 180.0, 0.014, drag_area_m2=14.0)
    shown = 0
    for seed in range(3):
        coastdown, *_, after = ended(watch(record(turns=(turn,), seed=seed)))
        # not the water, whatever it was, and little more
        shown += coastdown.ended_by in (EndedBy.TURN, EndedBy.BRAKE) and (
            370.0 <= end_s(coastdown) <= 420.0 and 550.0 <= start_s(after) <= 590.0
        )
    # less power before, and an engine that stops when the turn begins, explain the speed alone
    # about as well
    assert shown >= 2


@pytest.mark.parametrize('thrust', [1.0, 0.5])
def test_an_engaged_engine_shows_in_the_speed(watch, record, thrust: float) -> None:
    orders = (STOP, EngineOrder(400.0, shaft=0.8, thrust=thrust))
    block = record(orders=orders, duration_s=700.0)
    coastdown = the_coastdown(watch(block))
    assert coastdown.ended_by is EndedBy.ENGINE
    assert coastdown.failure != 'withdrawn'
    assert 360.0 <= end_s(coastdown) <= 405.0


@pytest.mark.parametrize(
    ('shaft', 'thrust', 'by'),
    [(1.0, 1.0, EndedBy.ENGINE), (0.3, 0.1, EndedBy.ENGINE), (-0.8, 0.1, EndedBy.ASTERN)],
)
def test_an_engaged_engine_shows_in_the_shaft_at_once(watch, record, sensors, shaft, thrust, by):
    block = record(
        sensors=(sensors['log'], sensors['shaft']),
        orders=(STOP, EngineOrder(400.0, shaft=shaft, thrust=thrust)),
        duration_s=440.0,
    )
    coastdown = the_coastdown(watch(block))
    assert coastdown.ended_by is by
    assert 395.0 <= end_s(coastdown) <= 410.0


def test_what_pushes_while_the_shaft_is_seen_to_stand_is_no_glide(watch, record, sensors) -> None:
    pushed = (STOP, EngineOrder(400.0, shaft=0.0, thrust=0.5))
    with_shaft = (sensors['log'], sensors['shaft'])
    coastdown = ended(watch(record(sensors=with_shaft, orders=pushed, duration_s=700.0)))[0]
    assert coastdown.ended_by is EndedBy.ENGINE
    assert 340.0 <= end_s(coastdown) <= 405.0
    coastdown = the_coastdown(watch(record(orders=pushed, duration_s=700.0)))
    assert coastdown.ended_by is EndedBy.ENGINE


def test_a_slow_down_that_passed_for_a_coastdown_is_withdrawn(watch, record, sensors) -> None:
    # stopped for 45 s only: confirmed by the shaft, and over before it has cost 5 % of the speed
    block = record(
        sensors=(sensors['log'], sensors['shaft']),
        orders=(STOP, EngineOrder(25.0, shaft=1.0, thrust=1.0)),
    )
    events = watch(block, Parameters(slope_window_s=20.0))
    assert all(event.ended_by is EndedBy.ENGINE for event in ended(events))
    assert all(event.withdrawn or end_s(event) <= 45.0 for event in ended(events))


@pytest.mark.parametrize('left', [0.3, 0.5])
def test_a_slow_down_that_passed_for_a_coastdown_is_withdrawn_when_it_settles(watch, record, left):
    order = EngineOrder(0.0, shaft=left**0.5, thrust=left)
    events = watch(record(orders=(order,), duration_s=2400.0))
    assert all(event.withdrawn for event in ended(events))
    dismissed = [event for event in events if isinstance(event, NotCoastdown)]
    assert dismissed
    assert {event.reason for event in dismissed} <= {Dismissal.THRUST, Dismissal.SETTLED}


def test_a_coastdown_that_ends_with_the_engine_is_not_withdrawn(watch, record) -> None:
    # engaged at the thrust of the speed that she then has: the speed settles at once
    orders = (STOP, EngineOrder(300.0, shaft=0.6, thrust=0.4))
    coastdown = the_coastdown(watch(record(orders=orders, duration_s=1500.0)))
    assert coastdown.ended_by is EndedBy.ENGINE
    assert not coastdown.withdrawn
    assert 260.0 <= end_s(coastdown) <= 310.0


def test_what_stops_a_ship_on_a_straight_course_is_a_brake(watch, record, sensors) -> None:
    brake = EngineOrder(400.0, shaft=0.0, thrust=-1.5)
    block = record(sensors=(sensors['log'], sensors['compass']), orders=(STOP, brake))
    coastdown = the_coastdown(watch(block))
    assert coastdown.ended_by is EndedBy.BRAKE
    assert 380.0 <= end_s(coastdown) <= 405.0


@pytest.mark.parametrize('told', [('log',), ('log', 'shaft')])
def test_a_brake_from_the_stop_on_is_no_coastdown(watch, record, sensors, told) -> None:
    brake = EngineOrder(0.0, shaft=0.0, thrust=-4.0)
    let_go = EngineOrder(90.0, shaft=0.0, thrust=0.0)
    events = watch(record(sensors=tuple(map(sensors.get, told)), orders=(brake, let_go)))
    assert all(event.withdrawn for event in events if isinstance(event, EndedCoastdown))
    assert any(isinstance(event, NotCoastdown) for event in events)


def test_several_coastdowns_in_one_record(watch, record) -> None:
    full = EngineOrder(700.0, shaft=1.0, thrust=1.0)
    orders = (STOP, full, EngineOrder(2000.0, shaft=0.0, thrust=0.0))
    events = watch(record(orders=orders, duration_s=3000.0))
    onsets = [event for event in events if isinstance(event, Onset)]
    starts = [(onset.start_ns - START_NS) / S - 900.0 for onset in onsets]
    np.testing.assert_allclose(starts, [6.0, 2006.0], atol=12.0)
    ends = [event.ended_by for event in events if isinstance(event, EndedCoastdown)]
    assert ends == [EndedBy.ENGINE, EndedBy.RECORD_END]
