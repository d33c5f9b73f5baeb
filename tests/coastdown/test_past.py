# SPDX-License-Identifier: Apache-2.0
"""Readings that those before them make impossible, and those that only look like it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.coastdown.past import KEPT
from shipdrag_ros.coastdown.validate import validate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Reason

LENGTH_M = 150.0
NOW = 1_700_000_000_000_000_000
S = 1_000_000_000
LOG, GROUND = Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND
METRES, DEGREES = Channel.POSITION, Channel.POSITION_GEODETIC
RATES = st.sampled_from([0.2, 1.0, 2.0, 10.0, 100.0])


def reasons(channel, time_s, value, *, sd=None) -> np.ndarray:
    stamps = NOW + np.round(np.asarray(time_s) * S).astype(np.int64)
    variance = None if sd is None else np.square(sd)
    return validate(Block.of(channel, stamps, value, variance=variance), Parameters(), LENGTH_M)


def rejected(channel, time_s, value, **more) -> list[int]:
    return np.flatnonzero(reasons(channel, time_s, value, **more) != Reason.ACCEPTED).tolist()


def coasting(time_s, speed, start_s):
    """Steady, then v' = -c v^2 from a deceleration that a ship of that speed may have."""
    slowed = np.maximum(0.0, time_s - start_s)
    return speed / (1.0 + min(0.06, 0.15 * speed) / speed * slowed)


@settings(max_examples=150, deadline=None)
@given(
    rate=RATES,
    speed=st.floats(0.1, 20.0),
    noise=st.floats(0.0, 0.05),
    quantum=st.sampled_from([0.0, 0.01, 0.0514]),
    seed=st.integers(0, 2**31),
)
def test_a_clean_record_is_kept_whole(rate, speed, noise, quantum, seed) -> None:
    time = np.arange(600) / rate
    value = coasting(time, speed, 0.4 * time[-1])
    value *= 1.0 + noise * np.random.default_rng(seed).standard_normal(600)
    if quantum:
        value = np.round(value / quantum) * quantum
    found = reasons(LOG, time, value)
    # a coarse log rightly repeats for longer than frozen_s
    assert set(found[found != Reason.FROZEN]) == {Reason.ACCEPTED}
    if not quantum and noise:
        assert np.all(found == Reason.ACCEPTED)


@settings(max_examples=150, deadline=None)
@given(
    rate=RATES,
    speed=st.floats(2.0, 20.0),
    noise=st.floats(1e-4, 0.02),
    at=st.integers(KEPT, 550),
    bad=st.sampled_from([0.0, 3.0, 0.3, -1.0]),
    seed=st.integers(0, 2**31),
)
def test_one_bad_reading_is_rejected_and_the_next_good_one_is_not(
    rate, speed, noise, at, bad, seed
) -> None:
    time = np.arange(600) / rate
    value = coasting(time, speed, 0.4 * time[-1])
    value *= 1.0 + noise * np.random.default_rng(seed).standard_normal(600)
    far = abs(value[at]) * abs(bad - 1.0) > 0.15 / rate + 0.1 + 15 * noise * speed
    lost = bad == 0.0 and value[at] > 0.3
    value[at] *= bad
    # beside the reading at which she begins to slow, few readings look like a hard stop
    if (far or lost) and abs(at - 0.4 * 599) > 1.0:
        assert rejected(LOG, time, value) == [at]


@pytest.mark.parametrize('at', range(6))
def test_a_track_that_starts_with_a_jump_recovers(at) -> None:
    value = np.column_stack([8.0 * np.arange(60.0), np.zeros(60)])
    value += 2.0 * np.random.default_rng(11).standard_normal((60, 2))
    value[at] += 2e4
    # the first one has nothing before it
    assert rejected(METRES, np.arange(60.0), value) == ([at] if at else [])


@pytest.mark.parametrize('rate', [0.2, 1.0, 10.0, 100.0])
@pytest.mark.parametrize('channel', [METRES, DEGREES])
def test_a_jump_of_the_position_is_rejected(channel, rate) -> None:
    time = np.arange(600) / rate
    rng = np.random.default_rng(1)
    value = np.column_stack([8.0 * time, 3.0 * time]) + 2.0 * rng.standard_normal((600, 2))
    value[100] += [2000.0, 0.0]
    value[200] = [0.0, 1e6]
    value[300:303] -= [0.0, 5000.0]
    if channel is DEGREES:  # across the date line
        value = np.array([60.0, 179.99]) + value / 111_195.0
        value[:, 1] = (value[:, 1] + 180.0) % 360.0 - 180.0
    assert rejected(channel, time, value) == [100, 200, 300, 301, 302]


def test_a_position_beyond_the_earth_is_absurd() -> None:
    value = np.column_stack([8.0 * np.arange(20.0), np.zeros(20)])
    value[::5, 1] = 1e308
    found = reasons(METRES, np.arange(20.0), value)
    assert np.flatnonzero(found == Reason.ABSURD).tolist() == [0, 5, 10, 15]
    assert set(np.delete(found, [0, 5, 10, 15])) == {Reason.ACCEPTED}


@pytest.mark.parametrize(
    ('channel', 'step'),
    [(LOG, [-6.0, 0.0]), (GROUND, [5.0, 0.0]), (METRES, [900.0, 0.0]), (DEGREES, [0.1, 0.0])],
)
@pytest.mark.parametrize('rate', [0.2, 1.0, 10.0])
def test_a_new_truth_is_let_in(channel, step, rate) -> None:
    # a hull that is caught, a radar that takes another mark
    rng = np.random.default_rng(2)
    time = np.arange(300) / rate
    noise = 1e-5 if channel is DEGREES else 0.02
    value = np.array([8.0, 0.0]) + noise * rng.standard_normal((300, 2))
    value[150:] += step
    assert rejected(channel, time, value) == []
    value[154:] -= step  # four of them prove nothing
    assert rejected(channel, time, value) == [150, 151, 152, 153]


@pytest.mark.parametrize('first', [0.0, 30.0, -20.0])
def test_a_record_that_starts_on_a_bad_reading_recovers(first) -> None:
    value = 8.0 + 0.02 * np.random.default_rng(3).standard_normal(200)
    value[:3] = first
    assert [i for i in rejected(LOG, np.arange(200.0), value) if i > 3] == []


def test_refused_readings_may_have_one_stamp() -> None:
    time = np.arange(100.0)
    time[60:80] = 60.0
    value = np.full(100, 8.0) + 0.02 * np.random.default_rng(10).standard_normal(100)
    value[60:80] = np.linspace(2.0, 3.0, 20)
    assert rejected(LOG, time, value) == list(range(60, 80))


@pytest.mark.parametrize('quantum', [0.0, 0.0514])
def test_zeros_are_never_let_in(quantum) -> None:
    value = 8.0 + 0.05 * np.random.default_rng(4).standard_normal(600)
    if quantum:
        value = np.round(value / quantum) * quantum
    value[200:400] = 0.0
    found = reasons(LOG, np.arange(600.0), value)
    assert set(found[:200]) | set(found[400:]) == {Reason.ACCEPTED}
    assert set(found[200:321]) == {Reason.OUTLIER}
    assert set(found[322:400]) == {Reason.FROZEN}


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('share', [0.1, 0.3, 0.5])
def test_zeros_from_the_first_reading_on_are_no_noise_of_the_log(share, seed) -> None:
    rng = np.random.default_rng(seed)
    value = 8.0 + 0.05 * rng.standard_normal(600)
    zero = rng.random(600) < share
    value[zero] = 0.0
    found = rejected(LOG, np.arange(600.0), value)
    assert set(np.flatnonzero(zero)) - set(found) <= set(range(100))
    assert set(found) <= set(np.flatnonzero(zero)) | set(range(100))


@pytest.mark.parametrize('seed', range(4))
def test_spikes_from_the_first_reading_on_are_no_noise_of_the_log(seed) -> None:
    rng = np.random.default_rng(seed)
    value = 8.0 + 0.05 * rng.standard_normal(600)
    spike = rng.random(600) < 0.2
    value[spike] = rng.uniform(10.0, 20.0, int(spike.sum()))
    found = rejected(LOG, np.arange(600.0), value)
    assert set(found) ^ set(np.flatnonzero(spike)) <= set(range(40))


def test_a_coarse_log_of_a_ship_at_rest_may_read_zero() -> None:
    value = np.where(np.random.default_rng(12).random(600) < 0.4, 0.0, 0.1)
    assert len(rejected(LOG, np.arange(600.0), value)) < 5


def test_a_log_that_sticks_is_frozen_at_once_unless_it_repeats_by_nature() -> None:
    value = 8.0 + 0.05 * np.random.default_rng(5).standard_normal(300)
    value[100:160] = value[100]
    found = reasons(LOG, np.arange(300.0), value)
    assert np.flatnonzero(found == Reason.FROZEN).tolist() == list(range(107, 160))
    assert set(np.delete(found, range(107, 160))) == {Reason.ACCEPTED}
    held = np.repeat(value[:100], 10)  # sent ten times a second, measured once
    assert rejected(LOG, 0.1 * np.arange(1000), held) == []


def test_a_car_that_brakes_is_believed() -> None:
    time = np.arange(0.0, 60.0, 0.01)
    speed = np.maximum(0.0, np.minimum(30.0, 30.0 - 3.0 * (time - 40.0)))
    speed += 0.02 * np.random.default_rng(6).standard_normal(len(time))
    assert rejected(GROUND, time, np.abs(speed)) == []


@pytest.mark.parametrize('rate', [0.2, 1.0, 10.0, 100.0])
@pytest.mark.parametrize('top', [0.5, 9.0, 20.0])
def test_a_ship_that_gets_under_way_is_believed(rate, top) -> None:
    # a good GNSS and a good log: almost no noise to hide behind
    time = np.arange(max(400.0, 200.0 / rate) * rate) / rate
    speed = top * (1.0 - np.exp(-np.maximum(0.0, time - 150.0) / 60.0))
    noise = np.random.default_rng(9).standard_normal((3, len(time)))
    track = np.column_stack([np.cumsum(speed) / rate, np.zeros(len(time))]) + 0.01 * noise[:2].T
    assert rejected(METRES, time, track) == []
    assert rejected(LOG, time, speed + 0.005 * noise[2]) == []


def test_a_speed_may_go_through_zero() -> None:
    time = np.arange(0.0, 300.0)
    assert rejected(LOG, time, 1.5 - 0.01 * time) == []


def test_a_stated_variance_widens_the_gate_of_its_reading_alone() -> None:
    value = 8.0 + 0.02 * np.random.default_rng(7).standard_normal(200)
    sd = np.full(200, 0.02)
    value[[80, 120]] += 2.0
    sd[120] = 1.0
    assert rejected(LOG, np.arange(200.0), value, sd=sd) == [80]


def test_a_sensor_that_has_become_worse_is_believed_again() -> None:
    rng = np.random.default_rng(8)
    value = 8.0 + np.where(np.arange(1200) < 400, 0.02, 2.0) * rng.standard_normal(1200)
    bad = rejected(LOG, np.arange(1200.0), value)
    assert len(bad) > 5
    assert sum(i > 600 for i in bad) < 5
