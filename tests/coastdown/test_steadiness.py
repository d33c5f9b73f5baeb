# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.bins import line
from shipdrag_ros.coastdown.steadiness import (
    SCALES,
    Slopes,
    Steadiness,
    white_sd_of_slopes,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship

SECOND_NS = 1_000_000_000
LOG = int(Channel.SPEED_THROUGH_WATER)
FIRST = 1_700_000_000


def learnt(speed, *, first: int = FIRST, **parameters) -> Steadiness:
    stamps = (first + np.arange(len(speed))) * SECOND_NS
    ship = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    monitor = Monitor(ship, Parameters(**parameters), estimate=None)
    monitor.update(Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed))
    return monitor._memory.steadiness


def noise(seconds: int, seed: int) -> np.ndarray:
    return 8.0 + 0.05 * np.random.default_rng(seed).standard_normal(seconds)


def test_spread_of_white_noise() -> None:
    # 12 sigma^2 / W^3 is the variance of a slope; over 40 records the mean of the spread, of
    # which each is good to 15..35 %, is within 3 standard errors of the longest window, 15 %
    found = np.mean([learnt(noise(2200, seed)).slope_sd[LOG] for seed in range(40)], axis=0)
    width = 60.0 * 2.0 ** np.arange(SCALES)
    np.testing.assert_allclose(found, 0.05 * np.sqrt(12.0 / width**3), rtol=0.15)


def test_a_coastdown_in_the_record_hardly_matters() -> None:
    speed = noise(2200, 3)
    before = learnt(speed).slope_sd[LOG, 0]
    time = np.maximum(0.0, np.arange(2200) - 1000.0)
    after = learnt(speed * 410.0 / (410.0 + time)).slope_sd[LOG, 0]
    assert before < after < 1.6 * before


@pytest.mark.parametrize('gap', [0, 40, 500, 100_000])
def test_the_changes_kept_are_those_of_the_slopes_kept(gap: int) -> None:
    speed = noise(4000, 12)
    seconds = FIRST + np.arange(4000) + np.where(np.arange(4000) >= 3000, gap, 0)
    ship = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    monitor = Monitor(ship, Parameters())
    monitor.update(Block.of(Channel.SPEED_THROUGH_WATER, seconds * SECOND_NS, speed))
    kept, slopes = monitor._memory.steadiness, Slopes.of(Parameters())
    for scale in range(SCALES):
        points = slopes.points >> scale
        newest = (int(kept.due[LOG, scale]) + 1) // (slopes.stride << scale) - 1
        slope = kept.slope[LOG, scale]
        at = np.arange(newest - points + 1, newest + 1) - slopes.lag
        change = np.abs(slope[at % len(slope)] - slope[(at - slopes.lag) % len(slope)])
        change[np.isnan(change)] = np.inf
        assert np.array_equal(np.sort(change), kept.changes[LOG, scale, :points])
        assert np.isfinite(change).any()


def test_only_the_last_steady_s_matters() -> None:
    speed = noise(5000, 4)
    speed[:2000] += 3.0 * np.random.default_rng(5).standard_normal(2000)
    steady_s, windows = 1800, 3 * 4 * 60
    later = 5000 - steady_s - windows - 4 * 60
    whole = learnt(speed)
    part = learnt(speed[later:], first=FIRST + later)
    assert np.array_equal(whole.slope_sd[LOG], part.slope_sd[LOG])
    assert np.array_equal(whole.limit[LOG], part.limit[LOG])


def test_steady_s_says_how_much_record_is_learnt_from() -> None:
    speed = noise(3000, 6)
    speed[:2000] += 0.3 * np.random.default_rng(7).standard_normal(2000)
    assert learnt(speed, steady_s=600.0).slope_sd[LOG, 0] < 0.7 * learnt(speed).slope_sd[LOG, 0]


def test_slope_window_s_says_how_long_a_slope_is() -> None:
    speed = noise(3000, 8)
    short, long = learnt(speed, slope_window_s=30.0), learnt(speed, slope_window_s=120.0)
    np.testing.assert_allclose(short.slope_sd[LOG, 0] / long.slope_sd[LOG, 0], 8.0, rtol=0.5)


def test_fewer_false_alarms_need_a_higher_limit() -> None:
    speed = noise(3000, 9)
    rare = learnt(speed, false_alarms_per_day=0.001)
    assert np.all(rare.limit[LOG] > learnt(speed, false_alarms_per_day=10.0).limit[LOG])


def test_nothing_is_known_at_first_then_a_guess_then_more() -> None:
    speed = noise(2200, 10)
    assert np.isnan(learnt(speed[:20]).limit[LOG, 0])
    guess = learnt(speed[:90])
    assert 0.0 < guess.limit[LOG, 0] < 0.02
    assert np.isnan(guess.limit[LOG, 1])
    assert np.all(learnt(speed).limit[LOG] < guess.limit[LOG, 0])


def test_a_fall_does_not_teach_the_limit_that_it_is_to_pass() -> None:
    speed = noise(900, 11)
    fallen = speed - 0.02 * np.maximum(np.arange(900) - 845.0, 0.0)
    assert learnt(fallen).limit[LOG, 0] == learnt(speed).limit[LOG, 0]


def test_slopes_of_places_scatter_as_white_noise_of_places_says() -> None:
    # N = 40 records, seeds 0 to 39: the root mean square is good to 11 % (one standard error)
    ship = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    stamps = (FIRST + np.arange(700)) * SECOND_NS
    slope, guess = [], []
    for seed in range(40):
        monitor = Monitor(ship, Parameters(), estimate=None)
        place = 8.0 * np.arange(700) + 4.0 * np.random.default_rng(seed).standard_normal(700)
        monitor.update(Block.of(Channel.POSITION, stamps, np.stack([place, 0.0 * place], axis=1)))
        bins, source = monitor._memory.bins, int(monitor._watch.seen_source)
        last, room = int(bins.closed[source]), np.empty(240)
        for width in (60, 120, 240):
            slope.append(line(bins, source, last, width)[0])
            guess.append(white_sd_of_slopes(bins, source, last, 60, width, room))
    slopes, guesses = np.reshape(slope, (-1, 3)), np.reshape(guess, (-1, 3))
    np.testing.assert_allclose(
        np.sqrt(np.mean(slopes**2, axis=0)), guesses.mean(axis=0), rtol=0.35
    )
