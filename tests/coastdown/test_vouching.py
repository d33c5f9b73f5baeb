# SPDX-License-Identifier: Apache-2.0
"""A speed that says nothing of the ship is named by another, which carries on."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest

from benchmarks.accuracy.vouching import (
    CURRENTS_M_S,
    FAULTS,
    LEAD_S,
    START_NS,
    WRONG_SCALES,
    alarms,
    faulty,
    judged,
    sailing,
    ship_of,
)
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import (
    Dismissal,
    EndedBy,
    EndedCoastdown,
    Event,
    NotCoastdown,
    Onset,
)
from shipdrag_ros.coastdown.vouching import Craft, Vouching, sound_probabilities
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import INPUTS, SECOND_NS, Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, Sensor, sense, simulate
from tests.coastdown.conftest import bits

LOG, GROUND, TRACK = 0, 1, 2
CRAFT = Craft(60.0, 1.2)
SOUND = Channel.SPEED_OVER_GROUND
GROUNDS = (Channel.POSITION, SOUND)
MINUTE = np.zeros(10)
RNG = np.random.default_rng(0)


def sound(log: np.ndarray, ground: np.ndarray) -> float:
    """Return the probability that both measure the ship."""
    speeds = {LOG: log, GROUND: ground + 0.02 * RNG.standard_normal(10)}
    return sound_probabilities(speeds, CRAFT).sets[LOG, GROUND]


def lately(fault: str, ground: Channel) -> Block:
    """Return the last ten minutes before the stop, and the glide."""
    block = faulty(fault, ground)
    return block[block.stamp_ns >= START_NS + (LEAD_S - 600) * SECOND_NS]


@pytest.mark.parametrize(
    'fault', [fault for fault in FAULTS if fault not in ('constant', 'other axis')]
)
def test_what_says_nothing_is_not_green_within_a_minute_and_the_stop_is_found(fault: str) -> None:
    ground = Channel.POSITION if fault == 'position in km' else SOUND
    first, green, _, stops = judged(lately(fault, ground))
    assert first is not None
    assert first <= 60
    assert green < 10
    if fault != '20 % spikes':  # its readings come back once the spikes are known, and noisy
        assert stops == pytest.approx([LEAD_S], abs=30.0)


def test_a_log_with_a_wrong_sign_stays_doubted_while_she_slows() -> None:
    for speed in (np.linspace(4.5, 3.5, 10), np.linspace(3.0, 2.4, 10)):
        speeds = {LOG: -speed, GROUND: speed + 0.02 * RNG.standard_normal(10)}
        found = sound_probabilities(speeds, CRAFT, doubted=[LOG])
        assert found.wrong(LOG) > 0.5


def test_a_constant_log_is_known_as_frozen_and_the_stop_is_found() -> None:
    first, _, _, stops = judged(faulty('constant', SOUND))
    assert first == 121
    assert stops == pytest.approx([LEAD_S], abs=30.0)


def test_nothing_is_said_of_a_sound_record_and_the_words_name_what_to_do() -> None:
    first, _, _, stops = judged(faulty('none', SOUND))
    assert first is None
    assert stops == pytest.approx([LEAD_S], abs=30.0)
    monitor = Monitor(ship_of(60.0), Parameters(), estimate=None)
    monitor.update(faulty('random', SOUND)[:400])
    text = monitor.doubts()['speed_through_water']
    for words in ('the speed over ground ', 'is used instead', 'look at its sensor'):
        assert words in text


@pytest.mark.parametrize('heard', [[LOG], [GROUND], [LOG, GROUND]])
def test_a_ship_that_wanders_by_the_sea_glides_in_one_piece(heard: list[int]) -> None:
    whole = 0
    for seed in range(3):
        block = faulty('none', SOUND, seed=seed)
        monitor = Monitor(ship_of(60.0), Parameters(), estimate=None)
        events = [*monitor.update(block[np.isin(block.channel, heard)]), *monitor.finish()]
        (ended,) = [event for event in events if hasattr(event, 'stands')]
        start_s, end_s = ((at - START_NS) / SECOND_NS for at in (ended.start_ns, ended.end_ns))
        whole += abs(start_s - LEAD_S) < 10.0 and end_s > LEAD_S + 400.0
    assert whole == 3


def test_the_window_of_a_coastdown_is_without_what_says_nothing() -> None:
    monitor = Monitor(ship_of(60.0), Parameters(), estimate=None)
    events = [*monitor.update(faulty('random', SOUND)), *monitor.finish()]
    (ended,) = [event for event in events if hasattr(event, 'stands')]
    window = monitor.ended_window(ended)
    assert not len(window.speed_through_water)
    assert len(window.speed_over_ground) > 300


def test_a_log_that_is_sound_again_is_used_again_without_what_it_read_before() -> None:
    bad, good = faulty('random', SOUND), faulty('none', SOUND)
    rows = (good.stamp_ns < START_NS + 200 * SECOND_NS) & (good.channel == LOG)
    value = np.where(rows[:, None], bad.value, good.value)
    monitor = Monitor(ship_of(60.0), Parameters(), estimate=None)
    block = Block(good.channel, good.stamp_ns, good.receive_ns, value, good.variance)
    events = [*monitor.update(block), *monitor.finish()]
    (ended,) = [event for event in events if hasattr(event, 'stands')]
    window = monitor.ended_window(ended)
    assert len(window.speed_through_water) > 300
    assert window.before is not None
    used_ns = window.before.speed_through_water.time_ns
    assert START_NS + 500 * SECOND_NS < used_ns[0] < START_NS + 700 * SECOND_NS


@pytest.mark.parametrize('fault', ['random', 'position in km'])
def test_how_the_record_is_cut_into_blocks_cannot_matter(fault: str) -> None:
    block = faulty(fault, Channel.POSITION)
    said = []
    for size in (1, len(block)):
        monitor = Monitor(ship_of(60.0), Parameters(), estimate=None)
        events = [
            e for i in range(0, len(block), size) for e in monitor.update(block[i : i + size])
        ]
        said.append([bits(event) for event in events] + [str(monitor.doubts()).encode()])
    assert said[0] == said[1]


def test_a_current_a_turn_in_it_a_glide_and_noise_are_no_contradiction() -> None:
    step = np.arange(10.0)
    five = MINUTE + 5.0
    assert sound(five, five + 1.5) > 0.9
    assert sound(five, five - 1.5 + step / 3.0) > 0.9
    assert sound(five - 0.05 * step, five - 0.05 * step) > 0.99
    assert sound(five + 0.3 * RNG.standard_normal(10), five) > 0.9
    assert sound(MINUTE, MINUTE + 1.5) > 0.9  # she drifts
    assert sound(MINUTE - 1.0, MINUTE + 1.0) > 0.9  # she goes astern


def test_a_third_source_shows_which_of_two_is_wrong() -> None:
    five = MINUTE + 5.0
    two = sound_probabilities({GROUND: five, TRACK: MINUTE + 9.0}, CRAFT).sets
    assert max(two[(GROUND,)], two[(TRACK,)]) < 0.9
    three = sound_probabilities({LOG: five, GROUND: five, TRACK: MINUTE + 9.0}, CRAFT).sets
    assert three[LOG, GROUND] > 0.9


@pytest.mark.parametrize(('length_m', 'inputs'), [(60.0, 'ls'), (150.0, 'lsp'), (8.0, 'lp')])
def test_sound_sailing_in_waves_and_a_tide_raises_no_alarm(length_m: float, inputs: str) -> None:
    block = sailing(31, 1.0, length_m, inputs, heading=False)
    assert alarms(block, ship_of(length_m)) == []


@pytest.mark.parametrize(
    ('fault', 'ground'),  # beside either in turn; the benchmark has each beside both
    list(zip([fault for fault in WRONG_SCALES if fault != '0.7 times'], cycle(GROUNDS))),
)
def test_a_log_in_a_wrong_scale_is_left_out_before_its_glide_ends(fault, ground):
    monitor = Monitor(ship_of(60.0), Parameters(), estimate=None)
    events = [*monitor.update(faulty(fault, ground)), *monitor.finish()]
    assert set(monitor.left_out()) == {'speed_through_water'}
    (ended,) = [event for event in events if hasattr(event, 'stands')]
    window = monitor.ended_window(ended)
    assert not len(window.speed_through_water)
    assert any(note.startswith('without speed_through_water: ') for note in window.notes)


def test_a_log_in_knots_is_not_green_within_a_minute_beside_quiet_positions() -> None:
    first, green, out, stops = judged(lately('in knots', Channel.POSITION))
    assert first is not None
    assert first <= 60
    assert green < 10
    assert out is not None
    assert out <= 140
    assert stops == pytest.approx([LEAD_S], abs=30.0)


@pytest.mark.parametrize(('fault', 'ground'), list(zip(list(CURRENTS_M_S)[1:4], cycle(GROUNDS))))
def test_a_current_beside_a_sound_log_is_no_contradiction(fault: str, ground: Channel) -> None:
    first, _, out, _ = judged(faulty(fault, ground))
    assert first is None
    assert out is None


def test_where_a_log_is_left_out_that_is_the_reason_that_is_given_and_what_to_do() -> None:
    sound = Vouching(CRAFT, 120.0)
    was = NotCoastdown(0, 1, Dismissal.THRUST, 'the shaft slowed down, yet the speed did not')
    assert sound.explained([was]) == [was]
    monitor = Monitor(ship_of(60.0), Parameters(), estimate=None)
    block = faulty('in knots', Channel.POSITION)
    events = monitor.update(block[block.stamp_ns < START_NS + (LEAD_S + 30) * SECOND_NS])
    events += monitor.finish()
    # a candidate that was dismissed, or a coastdown without an estimate
    failed = ('text', 'failure', 'reason')
    said = [str(vars(e)[name]) for e in events for name in failed if vars(e).get(name)]
    said = [text for text in said if ' ' in text]
    assert said
    for text in said:
        assert text.startswith('the speed through water is left out: ')
        for words in (
            'near knots over m/s',
            'By what is left',
            'To do: look at',
            'less is needed',
        ):
            assert words in text


LEAD_IN_S, COAST_S = 900.0, 600.0
FIRST, SECOND = Channel.SPEED_THROUGH_WATER, Channel.SPEED_THROUGH_WATER_2


def sailed(ship: Ship, *sensors: Sensor) -> Block:
    scenario = Scenario(speed_m_s=6.0, lead_in_s=LEAD_IN_S, duration_s=COAST_S)
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
    assert list(monitor.counts()) == list(INPUTS)[:8]
    spiky = Sensor(channel=SECOND, sd=0.03, outlier_fraction=0.05, outlier_size=4.0)
    monitor, _ = watched(ship, sailed(ship, Sensor(channel=FIRST, sd=0.03), spiky))
    health = monitor.counts()
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
    silent = Sensor(channel=first, sd=sd, gaps_s=((LEAD_IN_S + 200.0, 9999.0),))
    (*_, alone) = watched(ship, sailed(ship, silent))[1]
    (onset, ended) = watched(ship, sailed(ship, silent, Sensor(channel=second, sd=sd)))[1]
    assert isinstance(onset, Onset)
    assert isinstance(ended, EndedCoastdown)
    assert isinstance(alone, EndedCoastdown)
    assert ended.ended_by is EndedBy.RECORD_END
    assert (ended.end_ns - alone.end_ns) * 1e-9 == pytest.approx(COAST_S - 200.0, abs=2.0)


@pytest.mark.parametrize('off', [-0.05, 0.05])
def test_a_second_log_in_another_scale_makes_no_step_where_it_carries_on(ship, off):
    silent = Sensor(channel=FIRST, sd=0.03, gaps_s=((LEAD_IN_S + 200.0, LEAD_IN_S + 300.0),))
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
        Sensor(channel=FIRST, sd=0.03, gaps_s=((LEAD_IN_S + 100.0, LEAD_IN_S + 300.0),)),
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


@pytest.mark.parametrize(
    ('glides', 'shaft'), [(False, False), (False, True), (True, True)], ids=['', 'shaft', 'glide']
)
def test_a_coastdown_that_rests_on_a_doubted_log_is_judged_without_it(glides, shaft) -> None:
    # a log fades while she sails on; or fixes go on evenly while she glides, as the shaft says
    rng, time_s = np.random.default_rng(4), np.arange(2900.0)
    tanker = Ship(length_m=330.0, displaced_volume_m3=312000.0)
    after_s = np.maximum(time_s - 900.0, 0.0)
    stamp_ns = START_NS + np.arange(len(time_s)) * SECOND_NS
    log = 7.5 / (1.0 + (1e-3 if glides else 2e-3) * after_s) + 0.05 * rng.normal(size=len(time_s))
    track = np.column_stack([7.5 * time_s, 0.0 * time_s]) + rng.normal(0, 5.0, (len(time_s), 2))
    revs = 10.5 * np.exp(-after_s / 8.0 * glides) + 0.02 * rng.normal(size=len(time_s))
    readings = [(FIRST, log), (Channel.POSITION, track), (Channel.SHAFT, revs)]
    block = in_arrival_order(
        [Block.of(channel, stamp_ns, value) for channel, value in readings[: 2 + shaft]]
    )
    said = []
    for size in (997, len(block)):
        monitor, events = Monitor(tanker, Parameters(), estimate=None), list[Event]()
        for first in range(0, len(block), size):
            events += monitor.update(block[first : first + size])
        said.append([*events, *monitor.finish()])
    assert [bits(event) for event in said[0]] == [bits(event) for event in said[1]]
    assert 'speed_through_water' in monitor.left_out()
    ended = [event for event in said[0] if isinstance(event, EndedCoastdown)]
    assert ended
    assert any(event.stands for event in ended) is glides
    if not glides:
        assert 'By what is left, nothing slowed her after all' in str(ended[0].failure)
