# SPDX-License-Identifier: Apache-2.0
"""A speed that says nothing of the ship is named by another, which carries on."""

from __future__ import annotations

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
from shipdrag_ros.coastdown.events import Dismissal, NotCoastdown
from shipdrag_ros.coastdown.vouching import Craft, Vouching, sound_probabilities
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Block, Channel
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


@pytest.mark.parametrize(
    'fault', [fault for fault in FAULTS if fault not in ('constant', 'other axis')]
)
def test_what_says_nothing_is_not_green_within_a_minute_and_the_stop_is_found(fault: str) -> None:
    ground = Channel.POSITION if fault == 'position in km' else SOUND
    first, green, _, stops = judged(faulty(fault, ground))
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
    first, green, out, stops = judged(faulty('in knots', Channel.POSITION))
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
    sound = Vouching(CRAFT)
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
