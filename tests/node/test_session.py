# SPDX-License-Identifier: Apache-2.0
"""From bytes received to bytes published and recorded, without ROS; clocks that are set."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import StopMark, open_runs
from shipdrag_ros.messages import EventKind, Source, encode, read_event
from shipdrag_ros.node import session
from shipdrag_ros.node.session import OwnClock, SensorClock, both_ns, set_by
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64
from shipdrag_ros.ship import Ship
from tests.node.desk import NODE, Desk
from tests.recorded import Row, rows

SECOND_NS = 10**9
START_NS = 1_700_000_000 * SECOND_NS
SHIP = Ship.from_yaml('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n', subject='test')
PARAMETERS = Parameters()


class BagDesk(Desk):
    """A desk that is fed blocks."""

    def feed(self, block: Block) -> None:
        self.receive(encode(block))

    def bags(self) -> list[list[Row]]:
        return [rows(path) for path in self.recorded()]


@pytest.fixture
def desk(tmp_path: Path) -> BagDesk:
    desk = BagDesk(tmp_path, SHIP, PARAMETERS)
    desk.recorder.start()
    return desk


def speeds(arrival_s: list[float]) -> Block:
    """One reading at each arrival, stamped 10 ms before it."""
    arrival_ns = START_NS + np.round(np.array(arrival_s) * SECOND_NS).astype(np.int64)
    values = 5.0 + 0.01 * np.arange(len(arrival_s))
    return Block.of(Channel.SPEED_THROUGH_WATER, arrival_ns - 10**7, values, receive_ns=arrival_ns)


def test_a_message_that_feeds_nothing_is_recorded_and_makes_no_estimate(
    desk: BagDesk,
) -> None:
    desk.session.keep(Source('nmea', 'std_msgs/msg/String'), b'as heard', START_NS)
    (bag,) = desk.bags()
    assert [row[::3] for row in bag] == [('/nmea', b'as heard')]
    assert bag[0].log_ns == START_NS
    assert desk.published == []


def test_records_bytes_as_received_with_both_times(desk: BagDesk) -> None:
    block = speeds([0, 1, 2])
    desk.feed(block)
    (bag,) = desk.bags()
    assert [row.payload for row in bag] == [message.payload for message in encode(block)]
    assert [row.log_ns for row in bag] == block.receive_ns.tolist()


def test_a_small_step_back_of_the_clock_is_held(desk: BagDesk) -> None:
    desk.feed(speeds([0, 5, 1, 6]))
    (bag,) = desk.bags()
    assert [(row.log_ns - START_NS) // SECOND_NS for row in bag] == [0, 5, 5, 6]
    assert desk.published == []


def test_the_clock_is_watched_also_while_nothing_arrives(desk: BagDesk) -> None:
    desk.feed(speeds([100]))
    desk.session.watch_clock(START_NS)
    assert EventKind.CLOCK_JUMP in desk.kinds()


def test_a_stop_that_is_told_is_recorded_and_weighed_once_there_is_a_speed(
    desk: BagDesk,
) -> None:
    done, said = desk.session.engine_stopped(START_NS)
    assert not done
    assert said.startswith('of no use: no speed was read yet')  # where nothing is recorded too
    desk.feed(speeds([0, 1]))
    done, said = desk.session.engine_stopped(START_NS + 2 * SECOND_NS)
    assert done
    assert 'weighed with the readings' in said
    (bag,) = desk.bags()
    kinds = [read_event(row.payload).kind for row in bag if row.topic == f'{NODE}/events']
    assert kinds == [EventKind.ENGINE_STOPPED] * 2


def test_a_stop_that_is_told_before_any_input_makes_a_file(desk: BagDesk) -> None:
    desk.session.engine_stopped(START_NS)
    (bag,) = desk.bags()
    assert [(row.topic, row.log_ns) for row in bag] == [(f'{NODE}/events', START_NS)]
    (run,) = open_runs([desk.directory])
    assert [type(each) for each in run.inputs()] == [StopMark]


def test_a_later_recording_begins_after_the_reset(tmp_path: Path) -> None:
    desk = BagDesk(tmp_path, SHIP, PARAMETERS)
    desk.feed(speeds([0, 1]))
    desk.session.reset('asked for', START_NS + 2 * SECOND_NS)
    desk.feed(speeds([3]))
    desk.recorder.start()
    desk.feed(speeds([4]))
    (bag,) = desk.bags()
    assert [(row.log_ns - START_NS) // SECOND_NS for row in bag] == [3, 4]


def test_nothing_is_recorded_at_time_0(desk: BagDesk) -> None:
    desk.session.note(EventKind.LIFECYCLE, 'active', 0)
    assert desk.kinds() == [EventKind.LIFECYCLE]
    desk.feed(speeds([0]))
    (bag,) = desk.bags()
    assert [row.topic for row in bag] == ['/speed_through_water']


def test_what_comes_before_compiled_code_is_recorded_at_once_and_used_in_its_order(tmp_path):
    arrivals = [float(k) for k in range(20)]
    prompt, patient = (
        BagDesk(tmp_path / name, SHIP, PARAMETERS) for name in ('prompt', 'patient')
    )
    patient.ready = False
    for desk in (prompt, patient):
        desk.recorder.start()
        desk.feed(speeds(arrivals[:9]))
        desk.session.reset('asked for', START_NS + 9 * SECOND_NS)
        desk.feed(speeds(arrivals[10:15]))
    assert patient.session.waiting == 15
    assert patient.session.monitor.counts()['speed_through_water'].used == 0
    assert EventKind.RESET not in patient.kinds()
    patient.ready = True
    for desk in (prompt, patient):
        desk.feed(speeds(arrivals[15:]))
    assert patient.session.waiting == 0
    assert patient.session.monitor.counts() == prompt.session.monitor.counts()
    assert [it.payload for it in patient.published] == [it.payload for it in prompt.published]
    (one,), (other,) = prompt.bags(), patient.bags()
    assert sorted(one) == sorted(other)


def test_what_waits_is_bounded_by_its_size_too(desk: BagDesk, monkeypatch) -> None:
    monkeypatch.setattr(session, 'WAITING_BYTES', 1000)
    desk.ready = False
    desk.feed(speeds([0]))
    assert not desk.session.full
    desk.feed(speeds([1, 2, 3]))
    assert desk.session.full
    desk.ready = True
    desk.session.go_on()
    assert not desk.session.full


def steps(lags_s: Float64) -> list[tuple[int, float]]:
    """Return when a step was seen, and how large."""
    clock = SensorClock()
    found = [(tick, clock.step_s(float(lag))) for tick, lag in enumerate(lags_s)]
    return [(tick, step_s) for tick, step_s in found if step_s]


def lags(seed: int) -> Float64:
    """Some hundredths of a second, and now and then some tenths."""
    rng = np.random.default_rng(seed)
    late = 0.3 * (rng.random(120) < 0.05)
    return np.asarray(0.02 + rng.exponential(0.01, 120) + late)


@pytest.mark.parametrize('step_s', [-30.0, -1.5, 1.5, 30.0])
def test_the_clock_of_this_computer_is_held_against_one_that_nobody_sets(step_s: float) -> None:
    clock = OwnClock()
    found = []
    for second in range(20):
        now_ns = second * SECOND_NS + round((step_s if second >= 12 else 0.0) * SECOND_NS)
        found.append(clock.step_s(now_ns, second * SECOND_NS))
    assert found == pytest.approx([step_s if second == 12 else 0.0 for second in range(20)])


def test_both_clocks_of_this_computer_go_on() -> None:
    clock = OwnClock()
    moments = [moment for moment in (both_ns() for _ in range(50)) if moment is not None]
    assert moments
    assert not any(clock.step_s(*moment) for moment in moments)


@pytest.mark.parametrize('seed', range(5))
def test_a_sensor_whose_clock_is_set_forward_is_seen_at_once(seed: int) -> None:
    lag = lags(seed)
    lag[60:] -= 3.0
    ((tick, step_s),) = steps(lag)
    assert tick <= 64
    assert step_s == pytest.approx(3.0, abs=0.7)


@pytest.mark.parametrize('seed', range(5))
def test_a_sensor_whose_clock_is_set_back_is_seen_when_its_lag_stays(seed: int) -> None:
    lag = lags(seed)
    lag[60:] += 3.0
    ((tick, step_s),) = steps(lag)
    assert tick <= 82
    assert step_s == pytest.approx(-3.0, abs=0.7)


@pytest.mark.parametrize('seed', range(5))
def test_a_network_that_stalls_sets_no_clock(seed: int) -> None:
    lag = lags(seed)
    lag[60:75] += np.linspace(8.0, 0.0, 15)
    assert steps(lag) == []


def test_a_sensor_that_is_silent_tells_nothing() -> None:
    clock = SensorClock()
    assert not any(clock.step_s(None) for _ in range(50))


def test_it_is_said_which_way() -> None:
    assert set_by(3.0) == 'went forward by 3.0 s'
    assert set_by(-3.0) == 'went back by 3.0 s'
