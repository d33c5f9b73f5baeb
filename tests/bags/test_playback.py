# SPDX-License-Identifier: Apache-2.0
"""Replay gives what the node gave, bit for bit, and tells where it does not."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import BagWriter, Recorded, ReplayResult, open_runs, replay
from shipdrag_ros.bags.comparison import Comparison
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import Coastdown, EndedBy, Event, Onset, Reset, Update
from shipdrag_ros.errors import BagError, ParameterError, ShipFileError
from shipdrag_ros.messages import (
    EncodedMessage,
    OutputMessage,
    Source,
    decode,
    encode,
    outputs,
    reset_request,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, concatenate, in_arrival_order
from shipdrag_ros.ship import Ship

START_NS = 1_700_000_000_000_000_000
PARAMETERS = Parameters(update_s=30.0)


@pytest.fixture(scope='module')
def ship() -> Ship:
    return Ship(name='test ship', length_m=150.0, displaced_volume_m3=20200.0)


def voyage(seed: int = 1, *, steady_s: float = 400.0, coast_s: float = 700.0) -> Block:
    """A steady ship whose engine stops; r = v^2 / 3000, at 1 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, steady_s + coast_s)
    coasting = np.maximum(t - steady_s, 0.0)
    speed = 8.0 / (1.0 + 8.0 * coasting / 3000.0)
    track = np.where(
        t < steady_s, 8.0 * (t - steady_s), 3000.0 * np.log1p(8.0 * coasting / 3000.0)
    )
    shaft = 10.0 * np.exp(-coasting / 8.0)
    stamps = START_NS + np.round(t * 1e9).astype(np.int64)
    log = speed + rng.normal(0.0, 0.03, len(t))
    fixes = np.column_stack([track, 0.0 * track]) + rng.normal(0.0, 1.0, (len(t), 2))
    yaw = rng.normal(0.7, 0.005, len(t))
    received = stamps + 20_000_000

    def block(channel: Channel, value: np.ndarray, delay_ns: int) -> Block:
        return Block.of(channel, stamps, value, receive_ns=received + delay_ns)

    return in_arrival_order(
        [
            block(Channel.SPEED_THROUGH_WATER, log, 0),
            block(Channel.POSITION, fixes, 1),
            block(Channel.SHAFT, shaft, 2),
            block(Channel.HEADING, yaw, 3),
        ]
    )


class Live:
    """What the node does with messages, without ROS: one at a time, and recording."""

    def __init__(self, ship: Ship, parameters: Parameters = PARAMETERS) -> None:
        self.monitor = Monitor(ship, parameters)
        self.ship, self.parameters = ship, parameters
        self.bag: BagWriter | None = None
        self.events: list[Event] = []

    def start(self, path: Path, ring: Iterable[EncodedMessage] = ()) -> None:
        self.bag = BagWriter(path)
        self.bag.attach('ship.yaml', self.ship.to_yaml())
        self.bag.attach('parameters.yaml', self.parameters.to_yaml())
        for message in ring:
            self.write(message)

    def receive(self, message: EncodedMessage) -> None:
        self.write(message)
        source = Source(message.topic.removeprefix('/'), message.type)
        block = decode(source, [message.payload], [message.log_ns]).block
        self.report(self.monitor.update(block), message.log_ns)

    def reset(self, now_ns: int) -> None:
        self.write_output(reset_request(now_ns, 'service'), now_ns)
        self.report(self.monitor.reset(now_ns, 'service'), now_ns)

    def stop(self, now_ns: int, *, finish: bool = True) -> None:
        if finish:
            self.report(self.monitor.finish(), now_ns)
        assert self.bag is not None
        self.bag.close()
        self.bag = None

    def report(self, events: list[Event], now_ns: int) -> None:
        self.events += events
        for event in events:
            for message in outputs(event):
                self.write_output(message, now_ns)

    def write(self, message: EncodedMessage) -> None:
        if self.bag is not None:
            self.bag.write(
                message.topic,
                message.type,
                message.payload,
                log_ns=message.log_ns,
                publish_ns=message.publish_ns,
            )

    def write_output(self, message: OutputMessage, now_ns: int) -> None:
        if self.bag is not None:
            self.bag.write(
                message.topic,
                message.type,
                message.payload,
                log_ns=now_ns,
                publish_ns=message.stamp_ns,
            )


def replayed(path: Path) -> ReplayResult:
    (run,) = open_runs([path])
    assert run.warnings == ()
    return replay(run)


@pytest.fixture(scope='module')
def recording(ship: Ship, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Event]]:
    path = tmp_path_factory.mktemp('recording') / 'live.mcap'
    live = Live(ship)
    live.start(path)
    block = voyage()
    for message in encode(block):
        live.receive(message)
    live.stop(int(block.receive_ns[-1]))
    return path, live.events


def test_replay_gives_the_live_figures_bit_for_bit(
    recording: tuple[Path, list[Event]], ship: Ship
) -> None:
    path, events = recording
    result = replayed(path)
    updates = [event for event in events if isinstance(event, Update)]
    assert len(updates) > 10
    # speed, resistance and curve of each, and the curve once more at the end
    assert result.recorded == Recorded(3 * len(updates) + 1, 3 * len(updates) + 1, None)
    assert result.parameters == PARAMETERS
    assert result.ship == ship
    (coastdown,) = result.coastdowns
    assert coastdown.ended_by is EndedBy.RECORD_END
    assert coastdown.estimate is not None
    curve = coastdown.estimate.valid_curve
    np.testing.assert_allclose(
        curve.resistance_m_s2[5:-5], curve.speed_m_s[5:-5] ** 2 / 3000.0, rtol=0.2
    )
    assert [type(event) for event in result.events] == [Onset, Coastdown]
    assert result.inputs['shaft'].messages == result.inputs['shaft'].used == 1100
    assert list(result.inputs) == ['speed_through_water', 'position', 'heading', 'shaft']


def test_also_when_recording_starts_in_mid_run(ship: Ship, tmp_path: Path) -> None:
    block = voyage()
    messages = list(encode(block))
    live = Live(ship)
    begin = int(0.7 * len(messages))  # in the coastdown
    for message in messages[:begin]:
        live.receive(message)
    before = sum(isinstance(event, Update) for event in live.events)
    assert before > 3
    live.start(tmp_path / 'a.mcap', ring=messages[:begin])
    for message in messages[begin:]:
        live.receive(message)
    live.stop(int(block.receive_ns[-1]))
    result = replayed(tmp_path / 'a.mcap')
    after = sum(isinstance(event, Update) for event in live.events) - before
    assert result.recorded == Recorded(3 * after + 1, 3 * after + 1, None)


def test_also_when_recording_stops_before_the_node(ship: Ship, tmp_path: Path) -> None:
    block = voyage()
    live = Live(ship)
    live.start(tmp_path / 'a.mcap')
    for message in encode(block):
        live.receive(message)
    live.stop(int(block.receive_ns[-1]), finish=False)
    result = replayed(tmp_path / 'a.mcap')
    updates = sum(isinstance(event, Update) for event in live.events)
    assert result.recorded == Recorded(3 * updates, 3 * updates, None)
    assert len(result.coastdowns) == 1  # which the recording does not know to have ended


def test_also_after_a_reset_in_the_coastdown(ship: Ship, tmp_path: Path) -> None:
    block = voyage()
    messages = list(encode(block))
    at = int(0.75 * len(messages))
    live = Live(ship)
    live.start(tmp_path / 'a.mcap')
    for message in messages[:at]:
        live.receive(message)
    live.reset(messages[at - 1].log_ns)
    for message in messages[at:]:
        live.receive(message)
    live.stop(int(block.receive_ns[-1]))
    result = replayed(tmp_path / 'a.mcap')
    assert result.recorded.compared == result.recorded.identical > 10
    assert [coastdown.ended_by for coastdown in result.coastdowns] == [EndedBy.RESET]
    assert Reset(messages[at - 1].log_ns, 'service') in result.events


def test_another_ship_or_parameters_are_used_and_not_compared(
    recording: tuple[Path, list[Event]], ship: Ship
) -> None:
    path, _ = recording
    (run,) = open_runs([path])
    own = replay(run)
    larger = replay(run, ship=replace(ship, length_m=170.0))
    assert larger.recorded == Recorded(0, 0, None)
    assert larger.ship.length_m == 170.0
    assert own.coastdowns[0].estimate is not None
    assert larger.coastdowns[0].estimate is not None
    assert (
        larger.coastdowns[0].estimate.curve.froude[-1]
        < own.coastdowns[0].estimate.curve.froude[-1]
    )
    speed_only = replay(run, parameters=replace(PARAMETERS, estimator='s1_speed'))
    assert speed_only.recorded == Recorded(0, 0, None)
    assert speed_only.coastdowns[0].estimate is not None
    assert speed_only.coastdowns[0].estimate.estimator == 's1_speed'
    # the same as its own, given explicitly, is compared
    assert replay(run, ship=ship, parameters=PARAMETERS).recorded == own.recorded


def test_progress_is_told_and_ends_at_the_total(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    told: list[tuple[int, int]] = []
    replay(run, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (4400, 4400)
    assert len(told) > 1


def test_a_window_is_estimated_without_an_onset(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    result = replay(run, window=(410.0, 1000.0))
    (coastdown,) = result.coastdowns
    assert coastdown.ended_by is EndedBy.GIVEN
    assert coastdown.onset_detected_ns is None
    assert coastdown.start_ns == START_NS + 410_000_000_000
    assert coastdown.end_ns == START_NS + 1_000_000_000_000
    assert coastdown.estimate is not None
    assert coastdown.heading_rad == pytest.approx(0.7, abs=0.005)
    assert coastdown.estimate.samples['speed_through_water'] == 591
    assert result.recorded == Recorded(0, 0, None)
    shorter = replay(run, window=(410.0, 700.0)).coastdowns[0].estimate
    assert shorter is not None
    assert shorter.curve.speed_m_s[0] > coastdown.estimate.curve.speed_m_s[0]


def test_the_heading_of_a_window_follows_the_convention(
    recording: tuple[Path, list[Event]],
) -> None:
    (run,) = open_runs([recording[0]])
    compass = replace(PARAMETERS, heading_convention='compass')
    for window in ((410.0, 1000.0), (0.0, 1000.0)):
        (coastdown,) = replay(run, parameters=compass, window=window).coastdowns
        assert coastdown.heading_rad == pytest.approx(pi / 2 - 0.7, abs=0.02)


def test_a_window_that_gives_nothing_says_why(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    (coastdown,) = replay(run, window=(10.0, 11.0)).coastdowns
    assert coastdown.estimate is None
    assert coastdown.failure


@pytest.mark.parametrize(
    'window', [(-1.0, 5.0), (5.0, 5.0), (6.0, 5.0), (2000.0, 3000.0), (0.0, np.nan), (0.0, np.inf)]
)
def test_a_window_outside_of_the_bag(
    recording: tuple[Path, list[Event]], window: tuple[float, float]
) -> None:
    (run,) = open_runs([recording[0]])
    with pytest.raises(BagError, match=r'window .* s: expected 0 <= start < end inside of .*live'):
        replay(run, window=window)


def write(path: Path, block: Block, ship: Ship | None = None, parameters: str = '') -> Path:
    with BagWriter(path) as bag:
        if ship is not None:
            bag.attach('ship.yaml', ship.to_yaml())
        if parameters:
            bag.attach('parameters.yaml', parameters)
        for message in encode(block):
            bag.write(
                message.topic,
                message.type,
                message.payload,
                log_ns=message.log_ns,
                publish_ns=message.publish_ns,
            )
    return path


def test_a_window_is_of_stamps_even_if_the_recorder_has_another_clock(
    tmp_path: Path, ship: Ship
) -> None:
    block = voyage()
    later = replace(block, receive_ns=block.receive_ns + 3600 * 10**9)
    results = []
    for name, each in (('a', block), ('b', later)):
        (run,) = open_runs([write(tmp_path / f'{name}.mcap', each, ship)])
        results.append(replay(run, window=(410.0, 1000.0)).coastdowns[0])
    assert results[0].start_ns == results[1].start_ns
    assert results[0].estimate is not None
    assert results[1].estimate is not None
    np.testing.assert_array_equal(
        results[0].estimate.curve.resistance_m_s2, results[1].estimate.curve.resistance_m_s2
    )


def test_a_clock_set_in_a_window_is_no_estimate(tmp_path: Path, ship: Ship) -> None:
    block = voyage()
    second = replace(block, receive_ns=block.receive_ns + 1200 * 10**9)
    (run,) = open_runs([write(tmp_path / 'a.mcap', concatenate([block, second]), ship)])
    (coastdown,) = replay(run, window=(410.0, 2000.0)).coastdowns
    assert coastdown.failure is not None
    assert 'a clock was set in the window' in coastdown.failure


def test_rejected_samples_are_counted_in_a_window_and_in_a_replay(
    tmp_path: Path, ship: Ship
) -> None:
    block = voyage(steady_s=60.0, coast_s=60.0)
    value = block.value.copy()
    log = np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)
    value[log[10], 0] = np.nan
    value[log[20], 0] = 99.0
    (run,) = open_runs([write(tmp_path / 'a.mcap', replace(block, value=value), ship)])
    for window in (None, (0.0, 100.0)):
        counts = replay(run, window=window).inputs['speed_through_water']
        assert counts.rejected == {'nan': 1, 'absurd': 1}
        assert counts.used == counts.messages - 2


def test_unreadable_messages_and_wrong_types_are_counted_among_the_rejected(
    tmp_path: Path, ship: Ship
) -> None:
    (good,) = encode(Block.of(Channel.SHAFT, [1], [2.0]))
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for payload in (good.payload, b'', good.payload[:20]):
            bag.write('/shaft', good.type, payload, log_ns=1, publish_ns=1)
        bag.write('/depth', good.type, good.payload, log_ns=2, publish_ns=2)
        bag.write('/log', good.type, good.payload, log_ns=2, publish_ns=2)
    (run,) = open_runs([tmp_path / 'a.mcap'], remap={'/log': 'speed_through_water'})
    result = replay(run, ship=ship)
    assert result.inputs['shaft'].messages == 3
    assert result.inputs['shaft'].used == 1
    assert result.inputs['shaft'].rejected == {'malformed': 2}
    assert result.inputs['depth'].rejected == {'type': 1}
    assert result.inputs['speed_through_water'].rejected == {'type': 1}


def test_a_bag_without_a_ship_file_asks_for_one(tmp_path: Path, ship: Ship) -> None:
    (run,) = open_runs([write(tmp_path / 'a.mcap', voyage()[:50])])
    with pytest.raises(BagError, match=r'a\.mcap.* no ship\.yaml attached; give one with --ship'):
        replay(run)
    assert replay(run, ship=ship).parameters == Parameters()


def test_attachments_that_cannot_be_used_are_told(tmp_path: Path, ship: Ship) -> None:
    (run,) = open_runs([write(tmp_path / 'a.mcap', voyage()[:9], ship, parameters='window: 1')])
    with pytest.raises(ParameterError, match=r"a\.mcap: parameters\.yaml(.|\n)*'window': unknown"):
        replay(run)
    with BagWriter(tmp_path / 'b.mcap') as bag:
        bag.attach('ship.yaml', 'length_m: -1')
        bag.register('/shaft', 'sensor_msgs/msg/JointState')
    (run,) = open_runs([tmp_path / 'b.mcap'])
    with pytest.raises(ShipFileError, match=r'b\.mcap: ship\.yaml'):
        replay(run)


def test_a_bag_without_inputs_says_what_it_has(tmp_path: Path, ship: Ship) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        bag.register('/gps', 'sensor_msgs/msg/NavSatFix')
    (run,) = open_runs([tmp_path / 'a.mcap'])
    with pytest.raises(BagError, match=r'it has /gps \(sensor_msgs/msg/NavSatFix\): name one'):
        replay(run, ship=ship)


# the comparison alone


def message(stamp_ns: int, payload: bytes = b'', name: str = 'speed') -> OutputMessage:
    kind = 'geometry_msgs/msg/TwistWithCovarianceStamped'
    return OutputMessage(f'/coastdown_node/{name}', kind, payload, stamp_ns)


@pytest.mark.parametrize(
    ('recorded', 'replayed', 'expected'),
    [
        ([], [1, 2], (0, 0, None)),
        ([1, 2, 3], [1, 2, 3], (3, 3, None)),
        ([3, 4], [1, 2, 3, 4, 5], (2, 2, None)),
        ([1, 3], [1, 2, 3], (3, 2, 'at 2 ns: recorded nothing, replayed')),
        ([1, 2, 3], [1, 3], (3, 2, 'at 2 ns: recorded 0 bytes')),
        ([1, 2], [], (2, 0, 'at 1 ns: recorded')),
        ([5, 6, 1, 2], [5, 6, 1, 2], (4, 4, None)),
    ],
)
def test_comparison(
    recorded: list[int], replayed: list[int], expected: tuple[int, int, str | None]
) -> None:
    comparison = Comparison(iter([message(stamp) for stamp in recorded]))
    for stamp in replayed:
        comparison.add(message(stamp))
    found = comparison.finish()
    assert (found.compared, found.identical) == expected[:2]
    if expected[2] is None:
        assert found.first_difference is None
    else:
        assert found.first_difference is not None
        assert expected[2] in found.first_difference


def test_topics_are_compared_each_for_itself() -> None:
    recorded = [message(stamp, name=name) for name in ('speed', 'resistance') for stamp in (1, 2)]
    comparison = Comparison(iter([*recorded, message(1, name='events')]))
    for stamp in (1, 2):
        for name in ('speed', 'resistance', 'events'):
            comparison.add(message(stamp, name=name))
    assert comparison.finish() == Recorded(4, 4, None)


def test_a_figure_that_differs_is_shown(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    original = list(run.outputs())
    updates = [event for event in recording[1] if isinstance(event, Update)]
    changed = replace(
        updates[3], estimate=replace(updates[3].estimate, last_resistance_m_s2=0.125)
    )
    comparison = Comparison(iter(original))
    for event in [*updates[:3], changed, *updates[4:]]:
        for each in outputs(event):
            comparison.add(each)
    found = comparison.finish()
    assert found.compared - found.identical == 2  # and the final curve, which was not given
    assert found.largest_difference == np.inf  # of that curve
    assert found.first_difference is not None
    assert 'replayed 0.125 m/s^2' in found.first_difference
    assert f'/coastdown_node/resistance at {changed.stamp_ns} ns' in found.first_difference


def test_how_much_figures_differ_is_told(recording: tuple[Path, list[Event]]) -> None:
    updates = [event for event in recording[1] if isinstance(event, Update)]
    last = updates[3].estimate.last_resistance_m_s2
    curve = updates[3].estimate.curve
    for changed, difference in (
        (replace(updates[3].estimate, last_resistance_m_s2=last * (1.0 - 1e-13)), 1e-13),
        (
            replace(
                updates[3].estimate,
                curve=replace(curve, resistance_m_s2=curve.resistance_m_s2 * 1.01),
            ),
            0.01 / 1.01,
        ),
    ):
        comparison = Comparison(iter(outputs(updates[3])))
        for each in outputs(replace(updates[3], estimate=changed)):
            comparison.add(each)
        assert comparison.finish().largest_difference == pytest.approx(difference, rel=0.01)
