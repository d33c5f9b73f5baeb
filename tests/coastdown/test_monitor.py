# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import (
    EndedBy,
    EndedCoastdown,
    NoEstimate,
    Onset,
    Reset,
    State,
    Update,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, concatenate, in_arrival_order
from tests.coastdown.conftest import refuse, window_itself

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
        assert (update.estimate.start_ns, update.estimate.end_ns) == (
            onset.start_ns,
            update.stamp_ns,
        )


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
    assert coastdown.ended_by is EndedBy.RECORD_END
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
    used = watched.health()['speed_through_water'].used
    coastdown, reset = watched.reset(123, 'asked for')
    assert coastdown.ended_by is EndedBy.RESET
    assert reset == Reset(123, 'asked for')
    assert watched.state is State.WAITING
    assert watched.health()['speed_through_water'].used == used
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
    rejected = watched.health()['speed_through_water'].rejected
    assert rejected == ({'late': late} if late else {})


def test_silence_of_the_log_ends_a_coastdown_though_others_go_on(ship, record, sensors) -> None:
    block = record(sensors=(sensors['log'], sensors['compass']))
    silent = (block.channel == LOG) & (block.stamp_ns > START_NS + 1300 * S)
    watched = monitor(ship, data_stop_s=30.0)
    events = watched.update(block[~silent])
    (coastdown,) = of(EndedCoastdown, events)
    assert coastdown.ended_by is EndedBy.DATA_STOP
    assert coastdown.end_ns == START_NS + 1300 * S
    # noticed as soon as 30 s are over, not when the record is
    late = watched.update(block[:0])
    assert late == []
    kept = block[~silent]
    before = kept[kept.stamp_ns <= START_NS + 1330 * S]
    assert of(EndedCoastdown, monitor(ship, data_stop_s=30.0).update(before)) == []


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


def test_without_a_heading_none_is_given(ship, record) -> None:
    watched = monitor(ship)
    assert of(EndedCoastdown, watched.update(record()) + watched.finish())[0].heading_rad is None


def test_speed_over_ground_will_do(ship, record) -> None:
    log = record()
    ground = replace(log, channel=np.full_like(log.channel, Channel.SPEED_OVER_GROUND))
    for block in (ground, log):
        (onset,) = of(Onset, monitor(ship, estimate=refuse).update(block))
        # the thrust falls as exp(-t / 8 s)
        assert START_NS + 895 * S <= onset.start_ns <= START_NS + 910 * S
        assert onset.detected_ns <= START_NS + 1000 * S


def test_health_counts_everything(ship) -> None:
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
    health = watched.health()
    speed = health['speed_through_water']
    assert (speed.messages, speed.used) == (20, 17)
    assert speed.rejected == {'nan': 1, 'infinite': 1, 'duplicate': 1}
    assert speed.last_receive_ns == int(stamps[-1]) + 300_000_000
    assert speed.clock_offset_s == pytest.approx(0.3)
    assert health['position'].used == 20
    assert health['position'].rate_hz == pytest.approx(2.0)
    empty = health['rudder']
    assert (empty.messages, empty.last_receive_ns, empty.rate_hz) == (0, None, None)


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
    kernels = (bins.line, bins.mean_place, bins.displacement, bins.mean_turning, bins.newest_bin)
    compiled = [len(kernel.signatures) for kernel in kernels]
    block = record(sensors=tuple(sensors.values()))
    block.value.flags.writeable = False
    events = watched.update(block[: len(block) // 2]) + watched.update(block[len(block) // 2 :])
    assert of(Onset, events)
    assert [len(kernel.signatures) for kernel in kernels] == compiled


def test_silence_of_all_speeds_ends_a_coastdown_though_the_heading_goes_on(ship, record, sensors):
    everything = record(sensors=(sensors['log'], sensors['radar'], sensors['compass']))
    silent_ns = START_NS + 1500 * S
    heard = everything[(everything.stamp_ns < silent_ns) | (everything.channel == Channel.HEADING)]
    watched = monitor(ship)
    (ended,) = of(EndedCoastdown, watched.update(heard))
    assert ended.ended_by is EndedBy.DATA_STOP
    assert silent_ns - S <= ended.end_ns < silent_ns
