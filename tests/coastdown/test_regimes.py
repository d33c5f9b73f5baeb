# SPDX-License-Identifier: Apache-2.0
"""The bank of histories: what it finds, dates and dismisses, and that cutting changes no bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import Dismissal, EndedBy, EndedCoastdown, NotCoastdown, Update
from shipdrag_ros.coastdown.regimes import read_out
from shipdrag_ros.coastdown.regimes.births import bear, brakes, glides
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.noise import NoiseFilters, listen
from shipdrag_ros.coastdown.regimes.numbers import BIN_S, NUMBERS, WIND_SD
from shipdrag_ros.coastdown.regimes.read_out import (
    Spans,
    probability_of,
    slowed_by,
    smoothed,
    unpowered,
)
from shipdrag_ros.coastdown.regimes.state import (
    ADVANCE,
    AMID,
    BRAKE,
    GLIDE,
    GLIDE_TURN,
    HELD,
    LEVEL,
    LN_A,
    LN_U,
    N_EDDY,
    N_FIX,
    N_GUST,
    N_LOG,
    N_WANDER,
    OPEN,
    SAID,
    BankSetting,
    Histories,
)
from shipdrag_ros.coastdown.regimes.state import LOG as LOG_SAYS
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import EngineOrder, GaussMarkov, Sensor
from tests.coastdown.conftest import window_itself

START_NS = 1_700_000_000_000_000_000
S = 1_000_000_000
SLOW_UPDATES = Parameters(update_s=60.0)
LOG = Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.03, coloured=GaussMarkov(0.01, 30.0))
SHAFT = Sensor(channel=Channel.SHAFT, sd=0.05)
TRACK = Sensor(channel=Channel.POSITION, sd=1.0)
COMPASS = Sensor(channel=Channel.HEADING, sd=0.01)


def events_of(ship, block: Block, places=()) -> list:
    monitor = Monitor(ship, SLOW_UPDATES, estimate=None, final=window_itself)
    events = []
    for first, last in zip([0, *places], [*places, len(block)], strict=True):
        events += monitor.update(block[first:last])
    return events + monitor.finish()


def of(kind, events):
    return [event for event in events if isinstance(event, kind)]


@pytest.mark.parametrize(
    ('sensors', 'within_s'),
    [((TRACK, COMPASS), 10.0), ((LOG, TRACK), 5.0)],  # others: test_onset.py
)
def test_a_coastdown_is_found_and_dated(ship, record, sensors, within_s) -> None:
    block = record(sensors=sensors, seed=1)
    (ended,) = [each for each in of(EndedCoastdown, events_of(ship, block)) if not each.withdrawn]
    # the thrust falls as exp(-t / 8 s): as much speed is lost as by an abrupt stop at 8 s
    assert abs(ended.start_ns - START_NS - 905 * S) < within_s * S
    assert ended.end_ns > START_NS + 1700 * S
    assert ended.estimate is not None


def wandering(time_s, seed: int):
    """Errors of fixes that are alike for minutes: 2.5 m east and north, 80 to 900 s long."""
    draw, off = np.random.default_rng(seed), np.zeros((len(time_s), 2))
    for period_s in np.geomspace(80.0, 900.0, 14):
        part = 2.5 * draw.standard_normal((2, 2)) / np.sqrt(28.0)
        angle = 2.0 * np.pi * time_s / period_s
        off += np.outer(np.sin(angle), part[0]) + np.outer(np.cos(angle), part[1])
    return off


@pytest.mark.parametrize('sensors', [(LOG,), (LOG, SHAFT)])
@pytest.mark.parametrize('minutes', [15, 25])
def test_power_that_is_taken_off_evenly_is_no_coastdown(ship, record, sensors, minutes) -> None:
    end_s = 60.0 * minutes
    shafts = [(at_s, 1.0 - 0.6 * at_s / end_s) for at_s in np.arange(0.0, end_s + 1.0, 10.0)]
    orders = tuple(EngineOrder(at_s, shaft=part, thrust=part**2) for at_s, part in shafts)
    block = record(sensors=sensors, seed=2, orders=orders, duration_s=end_s + 900.0)
    events = events_of(ship, block)
    assert not [each for each in of(EndedCoastdown, events) if not each.withdrawn]
    assert {each.reason for each in of(NotCoastdown, events)} <= {Dismissal.SETTLED}


def test_a_glide_that_begins_later_is_not_the_one_announced(ship, record) -> None:
    orders = (EngineOrder(0.0, shaft=0.4, thrust=0.16), EngineOrder(360.0, shaft=0.0, thrust=0.0))
    log = replace(LOG, sd=0.05, coloured=None)
    block = record(sensors=(log,), seed=1, orders=orders, duration_s=860.0)
    told = of(EndedCoastdown, events_of(ship, block))
    assert all(each.start_ns < each.onset_detected_ns for each in told)
    (ended,) = [each for each in told if not each.withdrawn]
    assert abs(ended.start_ns - START_NS - 1260 * S) < 20 * S


def test_a_forecast_is_withdrawn_once_it_is_likelier_that_she_is_driven(ship, record) -> None:
    orders = (EngineOrder(0.0, shaft=0.0, thrust=0.0), EngineOrder(1000.0, shaft=0.3, thrust=0.07))
    block = record(sensors=(LOG, TRACK), orders=orders, duration_s=1600.0)
    monitor = Monitor(ship, SLOW_UPDATES)
    updates = of(Update, [*monitor.update(block), *monitor.finish()])
    made = [each.forecast is not None for each in updates]
    assert any(made)
    assert not made[-1]


@pytest.mark.parametrize('at_s', [-30, 60, 300])
def test_fixes_on_another_mark_are_no_turn_and_no_end(ship, record, at_s) -> None:
    whole = 0
    for seed in range(4):
        block = record(sensors=(LOG, replace(TRACK, sd=0.2)), seed=seed)
        later = block.stamp_ns >= START_NS + (900 + at_s) * S
        value = block.value.copy()
        value[later & (block.channel == Channel.POSITION)] += 1.0
        (ended,) = of(EndedCoastdown, events_of(ship, replace(block, value=value)))
        in_time = abs(ended.start_ns - START_NS - 905 * S) < 10 * S
        whole += in_time and ended.ended_by is EndedBy.RECORD_END
    assert whole >= 3  # with fixes of 10 m, a stop after a slow-down may look as likely


def test_a_log_that_shows_tenths_of_a_knot_shows_no_manoeuvre(ship, record) -> None:
    quiet = Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.005, coloured=GaussMarkov(0.01, 30.0))
    block = record(sensors=(quiet,), seed=1)
    tenth = 0.1 * 1852.0 / 3600.0
    events = events_of(ship, replace(block, value=np.round(block.value / tenth) * tenth))
    (ended,) = of(EndedCoastdown, events)
    assert abs(ended.start_ns - START_NS - 905 * S) < 15 * S
    assert not of(NotCoastdown, events)


def test_a_compass_that_is_first_heard_in_a_glide_does_not_end_it(ship, record, sensors) -> None:
    block = record(sensors=(sensors['log'], replace(sensors['compass'], sd=0.01)))
    heard = (block.channel != Channel.HEADING) | (
        block.stamp_ns > block.stamp_ns[0] + 1100 * 10**9
    )
    (ended,) = of(EndedCoastdown, events_of(ship, block[heard]))
    assert ended.ended_by is EndedBy.RECORD_END


@pytest.mark.parametrize('seed', [1, 3])
def test_a_ship_that_was_slow_a_while_before_is_judged_still(ship, record, seed) -> None:
    block = record(sensors=(LOG,), seed=seed, lead_in_s=1500.0)
    exact = record(sensors=(replace(LOG, sd=1e-9, coloured=None),), lead_in_s=1500.0)
    since_s = (block.stamp_ns - START_NS) / S
    # from a tenth of her speed she gathers way as steady thrust lets her
    under_way = np.tanh(0.1 + 0.0035 * np.clip(since_s - 300.0, 0.0, None))[:, np.newaxis]
    events = events_of(ship, replace(block, value=block.value - exact.value * (1.0 - under_way)))
    (ended,) = [each for each in of(EndedCoastdown, events) if not each.withdrawn]
    assert abs(ended.start_ns - START_NS - 1505 * S) < 10 * S


def test_a_record_of_what_no_ship_does_is_explained_less_well(ship, record) -> None:
    block = record(sensors=(LOG,), seed=1)
    since_s = (block.stamp_ns - START_NS) / S
    # from 500 s on the log shows an error that nothing in the model has: it jumps each minute
    jumps = np.where((since_s > 500.0) & (since_s // 60.0 % 2 == 0), 0.9, 1.0)[:, np.newaxis]
    explained = []
    for value in (block.value, block.value * jumps):
        (*_, ended) = of(EndedCoastdown, events_of(ship, replace(block, value=value)))
        explained.append(ended.regimes.explained)
    assert explained[0] > 0.05 > explained[1]


@pytest.mark.parametrize(('lead_s', 'seed'), [(60.0, 7), (120.0, 2), (120.0, 5), (120.0, 9)])
def test_a_long_glide_soon_after_the_start_is_told_in_one_piece(
    ship, record, lead_s, seed
) -> None:
    log = Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.03)
    block = record(sensors=(log,), seed=seed, speed_m_s=6.5, lead_in_s=lead_s, duration_s=1500.0)
    (ended,) = of(EndedCoastdown, events_of(ship, block))
    assert ended.end_ns - ended.start_ns > 1100 * S


@pytest.mark.parametrize(('rate_hz', 'seed'), [(0.2, 2), (0.2, 3), (0.2, 4), (5.0, 1)])
def test_the_steps_of_a_display_are_no_manoeuvres(ship, record, rate_hz, seed) -> None:
    tenths_of_a_knot = replace(LOG, sd=0.01, rate_hz=rate_hz, quantum=0.0514)
    tenths_of_a_knot = replace(tenths_of_a_knot, coloured=GaussMarkov(0.02, 60.0))
    block = record(sensors=(tenths_of_a_knot,), seed=seed, speed_m_s=7.0, lead_in_s=1800.0)
    (ended,) = of(EndedCoastdown, events_of(ship, block))
    assert abs(ended.start_ns - START_NS - 1805 * S) < 15 * S
    assert ended.end_ns > START_NS + 2650 * S


@pytest.mark.parametrize('seed', [0, 2, 3])
def test_power_that_varies_is_seldom_a_coastdown(ship, record, seed) -> None:
    draw, at_s, orders = np.random.default_rng(seed), 0.0, []
    while at_s < 2400.0:
        power = float(draw.uniform(0.3, 1.0))
        orders.append(EngineOrder(at_s, shaft=power, thrust=power * power))
        at_s += draw.uniform(20.0, 60.0)
    scenario = {'duration_s': 2400.0, 'orders': tuple(orders)}
    events = events_of(ship, record(sensors=(LOG, SHAFT), seed=seed, **scenario))
    # without it as a regime there are ten and more
    assert sum(not each.withdrawn for each in of(EndedCoastdown, events)) <= 5


def test_what_follows_a_manoeuvre_knows_her_speed_and_revs_in_it(ship) -> None:
    bank, setting = Histories.fresh(), BankSetting.of(HullPrior.of(ship), BIN_S, shafts=1)
    bank.used[0] = 1
    bank.mean[0, [LN_U, LN_A, OPEN]] = np.log(6.0), setting.hull.level, 0.01
    bank.row['regime'][0], bank.row['revs'][0] = AMID, 0.6
    brakes(bank, 0, setting, 100.0, 0.1)
    glides(bank, 0, setting, 100.0, 0.1)
    after = slice(1, int(bank.used[0]))
    assert np.allclose(bank.row['before'][after], np.log(6.0))
    held = (bank.row['regime'][after] == GLIDE) & (bank.row['kind'][after] >= HELD)
    assert held.any()
    assert np.all(bank.row['revs'][after][held] == 0.6)


@pytest.mark.parametrize(('turned_s', 'kept'), [(10.0, 1.0), (2000.0, 0.0)])
def test_after_a_turn_in_a_glide_the_wind_is_that_of_before(ship, turned_s, kept) -> None:
    bank, setting = Histories.fresh(), BankSetting.of(HullPrior.of(ship), BIN_S)
    bank.used[0], bank.clock[0] = 1, 100
    bank.mean[0, [LN_U, LN_A, OPEN]] = np.log(3.0), setting.hull.level, -0.03
    bank.spread[0, OPEN, OPEN] = 0.01**2
    bank.row['regime'][0], bank.row['first_a'][0], bank.row['since'][0] = GLIDE, 0.01, 0.0
    bear(bank, setting, False, True)
    for regime in (BRAKE, GLIDE_TURN):
        (first, *_) = np.flatnonzero(bank.row['regime'][: bank.used[0]] == regime)
        before = int(bank.used[0])
        glides(bank, first, setting, 100.0 * BIN_S + turned_s, 0.1)
        share = kept if regime == GLIDE_TURN else 1.0
        after = slice(before, int(bank.used[0]))
        assert np.allclose(bank.mean[after, OPEN], -0.03 * share, atol=1e-3)
        # what was learnt of it stays, or it is drawn anew
        sd = np.sqrt(bank.spread[after, OPEN, OPEN])
        assert np.allclose(sd, 0.01 if share else float(WIND_SD), rtol=0.1)


@pytest.mark.parametrize('seed', range(4))
def test_a_bin_in_which_she_is_hardly_driven_teaches_hardly_any_noise(ship, seed) -> None:
    learnt = []
    for likely in (0.0, 0.01):
        filters, said = NoiseFilters.fresh(), np.full(SAID, np.nan)
        setting, draw = BankSetting.of(HullPrior.of(ship), BIN_S), np.random.default_rng(seed)
        for k in range(140):
            slows = 0.05 * max(k - 40, 0)  # as no ship does that is driven
            said[LOG_SAYS] = 6.0 - slows + 0.01 * draw.standard_normal()
            known = likely if slows else 1.0
            listen(filters, setting, said, known, known)
        learnt.append(filters.used[[N_GUST, N_WANDER, N_LOG]])
    assert np.all(np.abs(np.log(learnt[1] / learnt[0])) < 0.5)


@pytest.mark.parametrize('seed', [1, 2, 4])
def test_the_error_of_fixes_is_learnt_whatever_the_first_ones_say(ship, seed) -> None:
    # of a radar: within a bin it is a quarter of the way of a slow ship
    fix_m, filters, said = 4.5, NoiseFilters.fresh(), np.full(SAID, np.nan)
    setting = BankSetting.of(HullPrior.of(ship), BIN_S)
    errors_m = fix_m * np.random.default_rng(seed).standard_normal(200)
    for advance in 17.0 + np.diff(errors_m):
        said[ADVANCE] = advance
        listen(filters, setting, said, 1.0, 1.0)
    assert 0.8 < filters.used[N_FIX] / fix_m < 1.25


def test_fixes_that_come_in_bursts_of_one_and_the_same_are_borne(ship, record) -> None:
    block = record(sensors=(LOG, TRACK))
    fix = block.channel == Channel.POSITION
    since_s = (block.stamp_ns - START_NS) // S
    value = block.value.copy()
    for burst in np.unique(since_s[fix] // 30):
        these = fix & (since_s // 30 == burst)
        value[these] = value[these][0]
    bursts = replace(block, value=value)[~fix | (since_s % 30 < 12)]
    (ended,) = of(EndedCoastdown, events_of(ship, bursts))
    assert abs(ended.start_ns - START_NS - 900 * S) < 60 * S


@pytest.mark.parametrize('seed', range(8))
def test_that_fixes_wander_is_learnt_beside_a_log(ship, seed) -> None:
    learnt, time_s = [], BIN_S * np.arange(240.0)
    for size in (0.0, 1.0):
        filters, said = NoiseFilters.fresh(), np.full(SAID, np.nan)
        setting, draw = BankSetting.of(HullPrior.of(ship), BIN_S), np.random.default_rng(seed)
        errors_m = size * wandering(time_s, seed)[:, 0] + 0.05 * draw.standard_normal(len(time_s))
        for off_m in np.diff(errors_m):
            said[LOG_SAYS] = 6.0 + 0.01 * draw.standard_normal()
            said[ADVANCE] = BIN_S * 6.0 + off_m
            listen(filters, setting, said, 1.0, 1.0)
        learnt.append(filters.used[[N_EDDY, N_WANDER]])
    (still, _), (moves, log_error) = learnt
    assert moves > 2.0 * max(still, log_error)


def test_every_number_has_a_unit_and_a_source() -> None:
    assert all(each.unit and each.source for each in NUMBERS)


def test_a_stop_that_is_told_dates_a_glide_that_a_noisy_log_shows_late(ship, record) -> None:
    noisy = Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.1, coloured=GaussMarkov(0.07, 60.0))
    block = record(sensors=(noisy,), seed=2)
    at = int(np.searchsorted(block.stamp_ns, START_NS + 900 * S))
    starts = []
    for told in (False, True):
        monitor = Monitor(ship, SLOW_UPDATES, estimate=None, final=window_itself)
        events = monitor.update(block[:at])
        if told:
            monitor.engine_stopped(START_NS + 900 * S)
        events += [*monitor.update(block[at:]), *monitor.finish()]
        starts.append(
            [
                (each.onset_detected_ns, each.start_ns)
                for each in of(EndedCoastdown, events)
                if not each.withdrawn
            ]
        )
    (late, _), (soon, start_ns) = starts[0][0], starts[1][0]
    assert abs(start_ns - START_NS - 900 * S) < 15 * S
    assert soon < late


@pytest.mark.parametrize(('lead_s', 'behind_s'), [(300.0, 0), (600.0, 0), (600.0, 100)])
def test_a_stop_that_is_told_soon_after_the_start_keeps_its_time(
    ship, record, lead_s, behind_s
) -> None:
    block = record(sensors=(LOG,), seed=2, lead_in_s=lead_s)
    block = replace(block, receive_ns=block.receive_ns + behind_s * S)  # by the clock of the log
    at = int(np.searchsorted(block.stamp_ns, START_NS + round((lead_s + 5.0) * S)))
    monitor = Monitor(ship, SLOW_UPDATES, estimate=None, final=window_itself)
    events = monitor.update(block[:at])
    assert monitor.engine_stopped(int(block.receive_ns[at - 1])) == ''
    events += [*monitor.update(block[at:]), *monitor.finish()]
    (ended,) = of(EndedCoastdown, events)
    assert abs(ended.start_ns - START_NS - (lead_s + 5.0) * S) < 10 * S
    assert monitor.ended_window(ended).told_ns == ended.told_ns
    assert abs(ended.told_ns - block.stamp_ns[at - 1]) < S


def test_a_stop_that_is_told_and_is_none_is_no_coastdown(ship, record) -> None:
    block = record(sensors=(LOG,), seed=2, orders=(), duration_s=900.0)
    at = int(np.searchsorted(block.stamp_ns, START_NS + 900 * S))
    monitor = Monitor(ship, SLOW_UPDATES, estimate=None, final=window_itself)
    events = monitor.update(block[:at])
    monitor.engine_stopped(START_NS + 900 * S)
    events += [*monitor.update(block[at:]), *monitor.finish()]
    assert not [each for each in of(EndedCoastdown, events) if not each.withdrawn]


def test_probabilities_of_regimes_are_shares_of_what_was_kept() -> None:
    """None is negative by rounding, and together they are one where histories were dropped."""
    weight = np.array([0.1, 0.2, 0.3, 0.35])  # 0.05 was dropped
    zero, over, end = np.zeros(4), np.array([15.0, 30.0, 45.0, 60.0]), np.full(4, 100.0)
    code, same = np.full(4, GLIDE), zero > 0.0
    glide = Spans(code, code, zero, zero, zero, zero, over, weight, code, same)
    brake = Spans(np.full(4, BRAKE), code, zero, over, over, over, end, weight, code, same)
    both = Spans._make(np.concatenate(each) for each in zip(glide, brake, strict=True))
    shares = np.array(list(smoothed(both, 20, 5.0).values()))
    assert shares.min() == 0.0
    assert shares.sum(axis=0) == pytest.approx(1.0, abs=1e-12)


def test_regimes_that_are_long_over_took_no_speed() -> None:
    """What their weights leave behind by rounding is no regime."""
    weight = np.full(11, 0.1)
    end_s = np.linspace(5.0, 105.0, 11)
    before = np.zeros(11)
    code = np.full(11, BRAKE)
    spans = Spans(code, code, before, before, before, end_s, end_s, weight, code, before > 0.0)
    assert probability_of(spans, 40, 5.0)[25:].max() > 0.0
    assert slowed_by(spans, np.linspace(5.0, 3.0, 40), 25, 5.0) is None


@pytest.mark.parametrize(('one_glide', 'found'), [(0.9, []), (0.4, [(20.0, 600.0)])])
def test_a_glide_that_may_have_been_held_at_first_is_followed_whole(ship, one_glide, found):
    """A glide from 20 s on; or a brake, or power for a while, and then a glide."""
    other = 0.5 * (1.0 - one_glide)
    what = np.array([GLIDE, BRAKE, GLIDE, GLIDE, LEVEL, GLIDE])
    begin_s = np.array([20.0, 20.0, 200.0, 20.0, 150.0, 200.0])
    end_s = np.array([600.0, 200.0, 600.0, 150.0, 200.0, 600.0])
    weight = np.array([one_glide, *[other] * 5])
    spans = Spans(
        what, what, 0.0 * begin_s, begin_s, begin_s, begin_s, end_s, weight, what, what == LEVEL
    )
    assert unpowered(spans, 120, BankSetting.of(HullPrior.of(ship), BIN_S)) == found


def test_no_glide_is_told_twice(ship) -> None:
    """One that probably ended at a doubt, and after it another, or the same all along."""
    begin_s, end_s = np.array([20.0, 20.0, 310.0]), np.array([300.0, 600.0, 600.0])
    what = np.full(3, GLIDE)
    weight = np.array([0.4, 0.32, 0.28])
    spans = Spans(what, what, begin_s, begin_s, begin_s, begin_s, end_s, weight, what, what < 0)
    setting = BankSetting.of(HullPrior.of(ship), BIN_S)
    told = read_out.glides(spans, setting, 120)
    assert [(each.begin_s, each.end_s) for each in told] == [(20.0, 300.0)]


def seconds_of(channel: Channel, value: np.ndarray) -> Block:
    return Block.of(channel, START_NS + np.arange(len(value)) * S, value)


def test_of_two_coastdowns_the_second_claims_nothing_of_the_first() -> None:
    # a tanker that glides in gusts, and turns from 1200 s after the stop on
    rng, gust, drag = np.random.default_rng(7), 0.0, 9.3e-5
    speed = np.full(3300, 7.5)
    for k in range(1, len(speed)):
        gust += 0.05 * np.sqrt(0.05) * rng.normal() - gust / 40.0
        force = drag * 56.25 * ((k < 900) + gust)
        speed[k] = speed[k - 1] + force - (1.9 if k > 2100 else 1.0) * drag * speed[k - 1] ** 2
    tanker = Ship(length_m=330.0, displaced_volume_m3=312000.0)
    log = seconds_of(Channel.SPEED_THROUGH_WATER, speed + 0.05 * rng.normal(size=len(speed)))
    first, second = of(EndedCoastdown, events_of(tanker, log))
    assert second.cuts
    assert second.stop_ns is not None
    assert second.stop_ns >= first.end_ns
    assert min(cut.start_ns for cut in second.cuts) >= first.end_ns


def test_a_glide_in_which_she_keeps_her_speed_is_not_said_to_be_braked_or_driven() -> None:
    rng, ferry = np.random.default_rng(0), Ship(length_m=90.0, displaced_volume_m3=3500.0)
    time_s = np.arange(1900.0)
    slowing_s = np.clip(time_s - 900.0, 0.0, 350.0) + np.maximum(time_s - 1500.0, 0.0)
    speed = 7.5 / (1.0 + 6.9e-3 * slowing_s) + 0.05 * rng.normal(size=len(time_s))
    revs = 10.5 * np.exp(-np.maximum(time_s - 900.0, 0.0) / 8.0) + 0.02 * rng.normal(size=1900)
    log = seconds_of(Channel.SPEED_THROUGH_WATER, speed)
    events = events_of(ferry, in_arrival_order([log, seconds_of(Channel.SHAFT, revs)]))
    (ended,) = of(EndedCoastdown, events)
    assert ended.ended_by is EndedBy.SPEED
    assert ended.cuts == ()
