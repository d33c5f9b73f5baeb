# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.worlds.propulsion.cases import stops
from benchmarks.worlds.propulsion.score import SUITES, score
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedBy,
    EndedCoastdown,
    InputCounts,
    NoEstimate,
    NotCoastdown,
    Onset,
    Reset,
    State,
    Update,
)
from shipdrag_ros.estimation import estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, concatenate, in_arrival_order
from shipdrag_ros.simulation import EngineOrder, GaussMarkov, Sensor, Turn
from tests.coastdown.conftest import bits, refuse, window_itself

START_NS = 1_700_000_000_000_000_000
S = 1_000_000_000
LOG = Channel.SPEED_THROUGH_WATER


def monitor(ship, *, estimate=window_itself, **parameters) -> Monitor:
    return Monitor(ship, Parameters(**parameters), estimate=estimate, final=estimate)


def of(kind, events):
    return [event for event in events if isinstance(event, kind)]


def test_states_in_turn(ship, record) -> None:
    watched = monitor(ship)
    seen = []
    block = record()
    for i in range(len(block)):
        watched.update(block[i : i + 1])
        if not seen or seen[-1] is not watched.state:
            seen.append(watched.state)
    assert seen == [State.WAITING, State.STEADY, State.CANDIDATE, State.COASTDOWN]


def test_updates_are_on_a_grid_from_the_onset_on(ship, record) -> None:
    events = monitor(ship, update_s=7.5).update(record())
    (onset,) = of(Onset, events)
    stamps = np.array([update.stamp_ns for update in of(Update, events)])
    assert np.all((stamps - onset.start_ns) % 7_500_000_000 == 0)
    assert np.all(np.diff(stamps) == 7_500_000_000)
    assert 0 <= stamps[0] - onset.detected_ns < 7_500_000_000
    for update in of(Update, events):
        assert update.estimate.end_ns == update.stamp_ns
        # dated anew, by what came since
        assert abs(update.estimate.start_ns - onset.start_ns) < 5 * S


def test_window_s_limits_the_window(ship, record) -> None:
    events = monitor(ship, window_s=300.0).update(record(duration_s=600.0))
    last = of(Update, events)[-1].estimate
    assert last.end_ns - last.start_ns == 300 * S
    assert last.speed_through_water.time_ns[0] >= last.end_ns - 300 * S


def test_no_estimate_says_why(ship, record) -> None:
    watched = monitor(ship, estimate=refuse)
    events = watched.update(record()) + watched.finish()
    assert {event.reason for event in of(NoEstimate, events)} == {'not asked for'}
    (coastdown,) = of(EndedCoastdown, events)
    assert coastdown.estimate is None
    assert coastdown.failure == 'not asked for'


def test_the_end_of_the_record_ends_a_coastdown(ship, record) -> None:
    watched = monitor(ship)
    block = record()
    events = watched.update(block) + watched.finish()
    (onset,), (coastdown,) = of(Onset, events), of(EndedCoastdown, events)
    assert (coastdown.ended_by, coastdown.heading_rad) == (EndedBy.RECORD_END, None)
    assert coastdown.start_ns == coastdown.estimate.start_ns
    # dated anew by all that came
    assert abs(coastdown.start_ns - onset.start_ns) <= 5 * S
    assert coastdown.onset_detected_ns == onset.detected_ns
    assert coastdown.end_ns == int(block.stamp_ns[-1]) == coastdown.estimate.end_ns
    assert watched.state is not State.COASTDOWN
    assert watched.finish() == []


def test_finish_without_a_coastdown_says_nothing(ship, record) -> None:
    watched = monitor(ship)
    assert watched.update(record(orders=())) == []
    assert watched.finish() == []


def test_a_reset_ends_a_coastdown_and_forgets(ship, record) -> None:
    watched = monitor(ship)
    block = record()
    watched.update(block)
    used = watched.counts()['speed_through_water'].used
    coastdown, reset = watched.reset(123, 'asked for')
    assert coastdown.ended_by is EndedBy.RESET
    assert reset == Reset(123, 'asked for')
    assert watched.state is State.WAITING
    assert watched.counts()['speed_through_water'].used == used
    # everything starts afresh, also the stamps
    (onset,) = of(Onset, watched.update(block))
    assert onset == of(Onset, monitor(ship).update(block))[0]


@pytest.mark.parametrize('jumps', ['stamp', 'arrival'])
def test_a_clock_that_was_set_resets_and_says_so(ship, record, jumps: str) -> None:
    block = record()
    half = 1700
    later, shift = block[half:], 3600 * S
    later = replace(
        later,
        stamp_ns=later.stamp_ns - shift,
        receive_ns=later.receive_ns - shift * (jumps == 'arrival'),
    )
    watched = monitor(ship)
    events = watched.update(concatenate([block[:half], later]))
    (coastdown,), (reset,) = of(EndedCoastdown, events), of(Reset, events)
    assert coastdown.ended_by is EndedBy.RESET
    assert coastdown.end_ns == int(block.stamp_ns[half - 1])
    # a stamp or two far back are late; three that ascend are a clock that was set
    late = 2 if jumps == 'stamp' else 0
    assert reset.receive_ns == int(later.receive_ns[late])
    assert f'{3599 - late}.000 s' in reset.reason
    assert ('speed_through_water' in reset.reason) == (jumps == 'stamp')
    rejected = watched.counts()['speed_through_water'].rejected
    assert rejected == ({'late': late} if late else {})


@pytest.mark.parametrize('others', [['compass'], ['radar', 'compass']])
def test_silence_of_all_speeds_ends_a_coastdown_though_others_go_on(
    ship, record, sensors, others
) -> None:
    block = record(sensors=(sensors['log'], *(sensors[each] for each in others)))
    silent = (block.channel != Channel.HEADING) & (block.stamp_ns > START_NS + 1300 * S)
    watched = monitor(ship, data_stop_s=30.0)
    events = watched.update(block[~silent])
    (coastdown,) = of(EndedCoastdown, events)
    assert coastdown.ended_by is EndedBy.DATA_STOP
    assert coastdown.end_ns == START_NS + 1300 * S
    # noticed as soon as 30 s are over, not when the record is
    late = watched.update(block[:0])
    assert late == []
    assert watched.state is not State.CANDIDATE
    assert watched.finish() == []
    kept = block[~silent]
    before = kept[kept.stamp_ns <= START_NS + 1330 * S]
    assert of(EndedCoastdown, monitor(ship, data_stop_s=30.0).update(before)) == []


@pytest.mark.parametrize(
    ('inputs', 'gap_s'),
    [
        *(('log', gap_s) for gap_s in ((960, 1030), (1061, 1360), (1300, 1420))),
        *(('log shaft', (1061, 1360)), ('log compass', (960, 1030))),
    ],
)
def test_the_rest_of_a_glide_after_a_silence_is_a_coastdown_of_its_own(
    ship, record, sensors, inputs, gap_s
) -> None:
    block = record(sensors=tuple(sensors[each] for each in inputs.split()))
    second = (block.stamp_ns - START_NS) // S
    lost = (second >= gap_s[0]) & (second < gap_s[1]) & (block.channel != Channel.HEADING)
    heard, before = block[~lost], second[~lost] < gap_s[0]
    told = []
    for by_clock in (False, True):
        watched = monitor(ship, estimate=refuse)
        events = watched.update(heard[before])
        assert of(EndedCoastdown, events) == []
        if by_clock:
            events += watched.fall_silent()
            assert watched.state is not State.CANDIDATE
        for i in range(int(before.sum()), len(heard)):
            events += watched.update(heard[i : i + 1])
        first, rest = of(EndedCoastdown, events + watched.finish())
        assert first.ended_by is (EndedBy.SILENCE if by_clock else EndedBy.DATA_STOP)
        assert first.end_ns == block.stamp_ns[(second < gap_s[0]) & (block.channel == LOG)][-1]
        assert 0 <= rest.start_ns - (START_NS + gap_s[1] * S) <= 5 * S
        assert (rest.end_ns, rest.ended_by) == (heard.stamp_ns[-1], EndedBy.RECORD_END)
        assert [cut.reason for cut in rest.cuts] == [Dismissal.GAP]
        told.append(rest)
    assert bits(told[0]) == bits(told[1])  # whoever notices the silence


def test_figures_after_a_silence_are_of_the_rest_of_the_glide_alone(ship, record, sensors) -> None:
    block = record(sensors=(sensors['log'],))
    second = (block.stamp_ns - START_NS) // S
    events = monitor(ship).update(block[(second < 1061) | (second >= 1360)])
    rest = of(Onset, events)[1]
    after = [each.estimate for each in of(Update, events) if each.stamp_ns > rest.detected_ns]
    assert len(after) > 5
    assert all(each.start_ns >= START_NS + 1360 * S and each.before is None for each in after)


def test_a_compass_tells_no_speed_in_a_silence(ship, record, sensors) -> None:
    block = record(sensors=(sensors['log'], sensors['compass']), duration_s=1200.0)
    second = (block.stamp_ns - START_NS) // S
    lost = (second >= 1100) & (second < 1700) & (block.channel == LOG)
    watched = monitor(ship, estimate=refuse)
    told = of(EndedCoastdown, watched.update(block[~lost]) + watched.finish())
    assert [each.ended_by for each in told] == [EndedBy.DATA_STOP, EndedBy.RECORD_END]


def test_each_part_of_a_glide_between_silences_ends_by_itself(ship, record) -> None:
    orders = EngineOrder(0.0, 0.0, 0.0), EngineOrder(620.0, 1.0, 1.0)
    block = record(orders=orders, duration_s=1200.0)
    second = (block.stamp_ns - START_NS) // S
    lost = ((second >= 1060) & (second < 1160)) | ((second >= 1300) & (second < 1380))
    watched = monitor(ship, estimate=refuse)
    told = of(EndedCoastdown, watched.update(block[~lost]) + watched.finish())
    ended = [each.ended_by for each in told]
    assert ended == [EndedBy.DATA_STOP, EndedBy.DATA_STOP, EndedBy.ENGINE]
    seconds = [((each.start_ns - START_NS) // S, (each.end_ns - START_NS) // S) for each in told]
    assert seconds[1] == (1160, 1299)
    assert seconds[2] == (1380, pytest.approx(1520, abs=15))


def test_a_glide_that_ends_in_a_silence_has_no_rest(ship, record) -> None:
    orders = EngineOrder(0.0, 0.0, 0.0), EngineOrder(220.0, 1.0, 1.0)
    block = record(orders=orders, duration_s=1500.0)
    second = (block.stamp_ns - START_NS) // S
    watched = monitor(ship, estimate=refuse)
    events = watched.update(block[(second < 1100) | (second >= 1300)]) + watched.finish()
    assert [each.ended_by for each in of(EndedCoastdown, events)] == [EndedBy.DATA_STOP]
    assert of(NotCoastdown, events) == []


def test_a_gap_shorter_than_data_stop_s_does_not_end_a_coastdown(ship, record) -> None:
    block = record()
    time = (block.stamp_ns - START_NS) / S
    gap = block[(time < 1300.0) | (time > 1350.0)]
    events = monitor(ship).update(gap)
    assert of(EndedCoastdown, events) == []
    # one update for each part of the grid that holds data
    stamps = [update.stamp_ns for update in of(Update, events)]
    assert len(stamps) == len(set(stamps))
    ends = [int(update.estimate.speed_through_water.time_ns[-1]) for update in of(Update, events)]
    assert len(ends) == len(set(ends))
    ended = monitor(ship, data_stop_s=40.0).update(gap)
    assert of(EndedCoastdown, ended)[0].ended_by is EndedBy.DATA_STOP


def test_the_heading_before_the_onset_is_given(ship, record, sensors) -> None:
    block = record(sensors=(sensors['log'], sensors['compass']), heading_rad=2.9)
    finish = monitor(ship)
    (coastdown,) = of(EndedCoastdown, finish.update(block) + finish.finish())
    np.testing.assert_allclose(coastdown.heading_rad, 2.9, atol=0.005)
    compass = monitor(ship, heading_convention='compass')
    (turned,) = of(EndedCoastdown, compass.update(block) + compass.finish())
    np.testing.assert_allclose(turned.heading_rad, np.pi / 2 - 2.9, atol=0.005)


def test_speed_over_ground_will_do(ship, record) -> None:
    log = record()
    ground = replace(log, channel=np.full_like(log.channel, Channel.SPEED_OVER_GROUND))
    for block in (ground, log):
        (onset,) = of(Onset, monitor(ship, estimate=refuse).update(block))
        # the thrust falls as exp(-t / 8 s)
        assert START_NS + 895 * S <= onset.start_ns <= START_NS + 910 * S
        assert onset.detected_ns <= START_NS + 1000 * S


def test_everything_is_counted(ship) -> None:
    stamps = START_NS + np.arange(20) * S // 2
    log = Block.of(
        LOG, stamps.copy(), 8.0 + 0.1 * np.arange(20.0), receive_ns=stamps + 300_000_000
    )
    log.value[4, 0] = np.nan
    log.value[7, 0] = np.inf
    log.stamp_ns[9] = log.stamp_ns[8]
    track = Block.of(
        Channel.POSITION_GEODETIC, stamps, np.array([[60.0, 5.0]]) + np.c_[stamps, stamps] * 0.0
    )
    watched = monitor(ship)
    watched.update(in_arrival_order([log, track]))
    counts = watched.counts()
    speed = counts['speed_through_water']
    assert (speed.messages, speed.used) == (20, 17)
    assert speed.rejected == {'nan': 1, 'infinite': 1, 'duplicate': 1}
    assert counts['position'].used == 20
    assert counts['rudder'] == InputCounts()


def test_memory_does_not_grow(ship) -> None:
    watched = monitor(ship, steady_s=60.0, window_s=60.0, slope_window_s=5.0)
    rng = np.random.default_rng(0)

    def size() -> int:
        def of(part) -> int:
            return part.nbytes if isinstance(part, np.ndarray) else sum(map(of, part))

        return of(watched._memory)

    sizes = []
    for hour in range(20):
        stamps = START_NS + (np.arange(3600) + hour * 3600) * S
        watched.update(Block.of(LOG, stamps, 8.0 + 0.05 * rng.standard_normal(3600)))
        sizes.append(size())
    assert len(set(sizes[1:])) == 1


def test_nothing_is_compiled_once_it_runs(ship, record, sensors) -> None:
    from shipdrag_ros.coastdown import bins

    watched = monitor(ship)
    kernels = (bins.line, bins.mean_place, bins.displacement, bins.mean_turning)
    block = record(sensors=tuple(sensors.values()))
    monitor(ship).update(block)  # as the node does before it is ready
    compiled = [len(kernel.signatures) for kernel in kernels]
    block.value.flags.writeable = False
    events = watched.update(block[: len(block) // 2]) + watched.update(block[len(block) // 2 :])
    assert of(Onset, events)
    assert [len(kernel.signatures) for kernel in kernels] == compiled


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
    kind: str, hull: str, seed: int
) -> None:
    (case,) = [each for each in stops(seed) if (each.kind, each.hull) == (kind, hull)]
    (row,) = score(case, {'track': SUITES['track + shaft']}, spans=True)
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
        coastdown, *later = ended(watch(record(turns=(turn,), seed=seed)))
        after = later[-1] if later else coastdown
        # not the water, whatever it was, and little more
        shown += coastdown.ended_by in (EndedBy.TURN, EndedBy.BRAKE) and (
            370.0 <= end_s(coastdown) <= 420.0 and 550.0 <= start_s(after) <= 590.0
        )
    # less power before, and an engine that stops when the turn begins, explain the speed alone
    # about as well
    assert shown >= 2


@pytest.mark.parametrize('seed', [0, 2])
@pytest.mark.parametrize('second', [None, 'compass'])
def test_a_turn_ends_at_the_power_that_it_began_at(watch, record, sensors, second, seed) -> None:
    block = record(
        sensors=(sensors['log'], *([sensors[second]] if second else [])),
        seed=seed,
        speed_m_s=6.5,
        lead_in_s=1500.0,
        duration_s=1900.0,
        orders=(
            EngineOrder(0.0, shaft=0.5, thrust=0.25),
            EngineOrder(1000.0, shaft=0.0, thrust=0.0),
        ),
        turns=(Turn(400.0, 180.0, 0.014, drag_area_m2=14.0),),
    )
    # once it had the power of before the slow-down, and what followed was a coastdown
    (coastdown,) = [each for each in ended(watch(block)) if not each.withdrawn]
    assert abs(start_s(coastdown) - 600.0 - 1000.0) < 15.0


@pytest.mark.parametrize('seed', [0, 1])
@pytest.mark.parametrize('stops', [False, True])
def test_a_shaft_sensor_that_dies_makes_no_coastdown(ship, record, sensors, stops, seed) -> None:
    dies = EngineOrder(0.0, shaft=0.0, thrust=1.0)
    orders = (dies, EngineOrder(400.0, shaft=0.0, thrust=0.0)) if stops else (dies,)
    block = record(
        sensors=(sensors['log'], sensors['shaft']),
        seed=seed,
        speed_m_s=6.5,
        lead_in_s=1500.0,
        duration_s=1600.0,
        orders=orders,
    )
    monitor = Monitor(ship, Parameters(update_s=600.0))
    early = block.stamp_ns < block.stamp_ns[0] + 1_800_000_000_000
    events = monitor.update(block[early])
    assert 'not used: check the sensor' in monitor.doubts()['shaft']
    events += monitor.update(block[~early]) + monitor.finish()
    told = [each for each in ended(events) if not each.withdrawn]
    assert len(told) == stops
    for coastdown in told:
        assert abs(start_s(coastdown) - 600.0 - 400.0) < 30.0
        assert any('without shaft' in note for note in coastdown.estimate.notes)


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


@pytest.mark.parametrize('seed', [1, 5, 9])
def test_less_power_in_a_rough_sea_is_no_coastdown(watch, record, sensors, seed) -> None:
    # turns that may have been do not crowd out the levels that may come
    rough = replace(sensors['log'], coloured=GaussMarkov(0.13, 60.0))
    order = EngineOrder(0.0, shaft=0.5, thrust=0.25)
    block = record(
        sensors=(rough,), orders=(order,), seed=seed, lead_in_s=2400.0, duration_s=420.0
    )
    assert all(event.withdrawn for event in ended(watch(block)))


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


@pytest.mark.parametrize('thrust', [-0.4, -1.0])
def test_of_a_brake_that_is_let_go_the_glide_after_it_is_kept(ship, record, sensors, thrust):
    orders = (EngineOrder(0.0, shaft=0.0, thrust=thrust), EngineOrder(90.0, shaft=0.0, thrust=0.0))
    told = (sensors['log'], Sensor(channel=Channel.POSITION, sd=10.0))
    watched = Monitor(ship, Parameters(), estimate=window_itself, final=estimate_final)
    events = watched.update(record(sensors=told, orders=orders)) + watched.finish()
    assert of(Update, events)[-1].estimate.before is None  # the brake is no steady sailing
    (coastdown,) = [each for each in ended(events) if not each.withdrawn]
    (cut,) = coastdown.cuts
    assert cut.reason is Dismissal.BRAKE
    edges = [(each - START_NS) / S - 900.0 for each in (cut.start_ns, cut.end_ns)]
    assert edges == pytest.approx([0.0, 90.0], abs=8.0)
    found = coastdown.estimate.calm
    true = ship.resistance_n(found.speed_m_s) / ship.mass_kg
    assert found.resistance_m_s2 == pytest.approx(true, rel=0.02)
    assert np.all(np.abs(found.resistance_m_s2 - true) < 2.0 * found.sigma_m_s2)


def test_several_coastdowns_in_one_record(watch, record) -> None:
    full = EngineOrder(700.0, shaft=1.0, thrust=1.0)
    orders = (STOP, full, EngineOrder(2000.0, shaft=0.0, thrust=0.0))
    events = watch(record(orders=orders, duration_s=3000.0))
    onsets = [event for event in events if isinstance(event, Onset)]
    starts = [(onset.start_ns - START_NS) / S - 900.0 for onset in onsets]
    np.testing.assert_allclose(starts, [6.0, 2006.0], atol=12.0)
    ends = [event.ended_by for event in events if isinstance(event, EndedCoastdown)]
    assert ends == [EndedBy.ENGINE, EndedBy.RECORD_END]


TRACK = Channel.POSITION
STOP_S = 900

RNG = np.random.default_rng(0)
ONE_IN_20 = RNG.random(1800) < 0.05
FEW = RNG.random(1800) < 0.01


def between(first: int, last: int) -> np.ndarray:
    """Return which of the readings once a second are between two times after the stop."""
    return (np.arange(1800) >= STOP_S + first) & (np.arange(1800) < STOP_S + last)


def put(value: float, where: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: np.where(where[:, None], value, values)


def spiked(values: np.ndarray) -> np.ndarray:
    return np.where(FEW[:, None], values + RNG.uniform(-6.0, 6.0, values.shape), values)


FAULTS = {
    'a zero in 20': (LOG, put(0.0, ONE_IN_20)),
    'a burst of zeros': (LOG, put(0.0, between(10, 20))),
    'spikes': (LOG, spiked),
    'a gap': (LOG, put(np.nan, between(-10, 20))),
    'a longer gap': (LOG, put(np.nan, between(-70, -15))),
    'far positions': (TRACK, put(1e308, ONE_IN_20)),
    'no position': (TRACK, put(0.0, ONE_IN_20)),
}


def spoilt(block: Block, channel: Channel, spoil) -> Block:
    rows = block.channel == channel
    columns = 2 if channel is TRACK else 1
    value = block.value.copy()
    value[rows, :columns] = spoil(value[rows, :columns][:1800])
    return replace(block, value=value)


@pytest.fixture(scope='module')
def clean(record, sensors) -> Block:
    block = record(sensors=(sensors['log'], sensors['radar']))
    return block[block.stamp_ns < block.stamp_ns[0] + 1800 * S]


@pytest.fixture(scope='module')
def as_it_is(clean, watch) -> EndedCoastdown:
    [one] = [event for event in watch(clean) if isinstance(event, EndedCoastdown)]
    return one


@pytest.mark.parametrize('name', FAULTS)
def test_bad_readings_neither_hide_nor_move_a_coastdown(clean, as_it_is, watch, name) -> None:
    events = watch(spoilt(clean, *FAULTS[name]))
    [bad] = [event for event in events if isinstance(event, EndedCoastdown)]
    assert abs(bad.start_ns - as_it_is.start_ns) <= 10 * S
    assert bad.end_ns == as_it_is.end_ns


@pytest.mark.parametrize('at_s', [-300, 0, 200])
@pytest.mark.parametrize('value', [0.0, None])
def test_the_track_stands_in_for_a_log_that_fails(ship, clean, at_s, value) -> None:
    def fail(values: np.ndarray) -> np.ndarray:
        inside = between(at_s, 900)
        return put(values[np.argmax(inside), 0] if value is None else value, inside)(values)

    monitor = Monitor(ship, Parameters(update_s=600.0))
    events = [*monitor.update(spoilt(clean, LOG, fail)), *monitor.finish()]
    ended = [event for event in events if isinstance(event, EndedCoastdown)]
    # positions alone leave open whether the engine drove her for half a minute as the log failed
    assert len(ended) <= 2
    assert ended[-1].start_ns - ended[0].end_ns < 60 * S
    assert ended[-1].end_ns > clean.stamp_ns[-1] - 30 * S
    assert abs(ended[0].start_ns - clean.stamp_ns[0] - STOP_S * S) < 30 * S
    coastdown = ended[-1]
    assert coastdown.estimate is not None
    [note] = [note for note in coastdown.estimate.notes if 'no usable reading' in note]
    assert note.startswith('speed_through_water')
    assert note.endswith('rests on position')
