# SPDX-License-Identifier: Apache-2.0
"""Sensors: what they read, and the statistics of their faults."""

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Channel
from shipdrag_ros.simulation import (
    STANDARD_SD,
    START_NS,
    GaussMarkov,
    Scenario,
    Sensor,
    Truth,
    Turn,
    sense,
    simulate,
    standard_sensors,
)
from tests.runs import CARGO

LOG = Sensor(channel=Channel.SPEED_THROUGH_WATER)


@pytest.fixture(scope='module')
def coast() -> Truth:
    return simulate(
        CARGO,
        Scenario(
            speed_m_s=8.2,
            lead_in_s=100.0,
            duration_s=900.0,
            heading_rad=3.0,
            current_m_s=(0.5, -0.2),
            depth_m=35.0,
            turns=(Turn(200.0, 100.0, rate_rad_s=0.005, rudder_rad=0.2),),
        ),
    )


@pytest.fixture(scope='module')
def steady() -> Truth:
    """Sail for 20 000 s at exactly 8.2 m/s."""
    return simulate(CARGO, Scenario(speed_m_s=8.2, lead_in_s=20e3, duration_s=0.0, orders=()))


def errors(steady: Truth, seed: int = 1, **faults: object) -> np.ndarray:
    return sense(steady, [replace(LOG, **faults)], seed=seed).value[:, 0] - 8.2


def test_perfect_sensors_read_the_truth(coast):
    channels = list(STANDARD_SD)
    block = sense(coast, [Sensor(channel=channel) for channel in channels], seed=1)
    assert np.all(np.diff(block.receive_ns) >= 0)
    np.testing.assert_array_equal(block.stamp_ns, block.receive_ns)
    truth = coast.at(np.arange(1001.0))
    ground = truth.velocity_over_ground_m_s
    yaw = truth.heading_rad
    expected = {
        Channel.SPEED_THROUGH_WATER: truth.speed_through_water_m_s,
        Channel.SPEED_OVER_GROUND: np.hypot(*ground.T),
        Channel.HEADING: (yaw + np.pi) % (2 * np.pi) - np.pi,
        Channel.SHAFT: truth.shaft_rad_s,
        Channel.DEPTH: np.full(1001, 35.0),
        Channel.RUDDER: np.where((np.arange(1001) >= 300) & (np.arange(1001) < 400), 0.2, 0.0),
    }
    for channel, values in expected.items():
        part = block[block.channel == channel]
        np.testing.assert_array_equal(part.stamp_ns, START_NS + np.arange(1001) * 10**9)
        np.testing.assert_allclose(part.value[:, 0], values, atol=1e-12)
        np.testing.assert_array_equal(part.value[:, 1], 0.0)
    position = block[block.channel == Channel.POSITION].value
    np.testing.assert_allclose(position, truth.position_m, atol=1e-12)
    # in still air the wind felt on board is the ship's own motion, reversed
    wind = block[block.channel == Channel.WIND_APPARENT].value
    rotated = (wind[:, 0] + 1j * wind[:, 1]) * np.exp(1j * yaw)
    np.testing.assert_allclose(rotated, -(ground[:, 0] + 1j * ground[:, 1]), atol=1e-12)
    assert np.all(wind[:, 0] < 0.0)


def test_white_noise_has_its_sd(steady):
    # N = 20 001, seed 1; bounds 5 standard errors
    noise = errors(steady, sd=0.05)
    np.testing.assert_allclose(np.std(noise), 0.05, rtol=5.0 / np.sqrt(2 * 20e3))
    assert abs(np.mean(noise)) < 5.0 * 0.05 / np.sqrt(20e3)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 5.0 / np.sqrt(20e3)


def test_both_columns_of_a_position_are_noisy_on_their_own(steady):
    sensor = Sensor(channel=Channel.POSITION, sd=10.0, coloured=GaussMarkov(5.0, 3.0))
    exact = sense(steady, [replace(sensor, sd=0.0, coloured=None)], seed=1).value
    noise = sense(steady, [sensor], seed=1).value - exact
    # N = 20 001, about 1/3 of it independent, seed 1
    np.testing.assert_allclose(np.std(noise, axis=0), np.hypot(10.0, 5.0), rtol=0.05)
    assert abs(np.corrcoef(noise.T)[0, 1]) < 5.0 / np.sqrt(20e3 / 3)


def test_outliers_have_their_share_and_size(steady):
    # N = 20 001, seed 1; binomial bound 5 standard errors
    size = np.abs(errors(steady, outlier_fraction=0.03, outlier_size=2.0))
    share = np.mean(size > 0.0)
    assert abs(share - 0.03) < 5.0 * np.sqrt(0.03 * 0.97 / 20e3)
    assert 1.0 <= np.min(size[size > 1e-9]) <= np.max(size) <= 3.0
    signs = np.sign(errors(steady, outlier_fraction=1.0, outlier_size=2.0))
    assert abs(np.mean(signs)) < 5.0 / np.sqrt(20e3)


def test_gaps_are_silent(coast):
    block = sense(coast, [replace(LOG, gaps_s=((100.0, 199.5), (400.0, 410.0)))], seed=1)
    seconds = (block.stamp_ns - START_NS) // 10**9
    expected = [t for t in range(1001) if not (100 <= t <= 199 or 400 <= t <= 410)]
    np.testing.assert_array_equal(seconds, expected)


def test_readings_are_multiples_of_the_quantum(coast):
    block = sense(coast, [replace(LOG, sd=0.2, quantum=0.05)], seed=1)
    steps = block.value[:, 0] / 0.05
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert len(np.unique(np.round(steps))) > 10


def test_delay_and_jitter_touch_the_times_and_not_the_values(coast):
    plain = sense(coast, [LOG], seed=1)
    late = sense(coast, [replace(LOG, delay_s=0.4, stamp_jitter_s=0.02)], seed=1)
    np.testing.assert_array_equal(late.value, plain.value)
    np.testing.assert_array_equal(late.receive_ns - plain.receive_ns, 400_000_000)
    jitter = (late.stamp_ns - plain.stamp_ns) * 1e-9
    # N = 1001, seed 1; bound 5 standard errors
    np.testing.assert_allclose(np.std(jitter), 0.02, rtol=5.0 / np.sqrt(2e3))


def test_a_delayed_sensor_arrives_after_the_prompt_one(coast):
    sensors = [replace(LOG, delay_s=2.5), Sensor(channel=Channel.HEADING)]
    block = sense(coast, sensors, seed=1)
    assert np.all(np.diff(block.receive_ns) >= 0)
    np.testing.assert_array_equal(block.channel[:4], [4, 4, 4, 0])


def test_the_rate_sets_the_stamps(coast):
    block = sense(coast, [replace(LOG, rate_hz=20.0)], seed=1, start_ns=5)
    assert len(block) == 20_001
    assert block.stamp_ns[0] == 5
    np.testing.assert_array_equal(np.diff(block.stamp_ns), 50_000_000)


def test_stated_sd_is_the_variance_that_is_sent(coast):
    block = sense(coast, [Sensor(channel=Channel.POSITION, stated_sd=3.0)], seed=1)
    np.testing.assert_array_equal(block.variance, 9.0)
    assert np.all(np.isnan(sense(coast, [LOG], seed=1).variance))
    log = sense(coast, [replace(LOG, stated_sd=0.1)], seed=1)
    np.testing.assert_allclose(log.variance[:, 0], 0.01, rtol=1e-12)
    assert np.all(np.isnan(log.variance[:, 1]))


def test_seeds_decide_and_sensors_do_not_disturb_each_other(coast):
    sensors = standard_sensors()
    first, again = sense(coast, sensors, seed=7), sense(coast, sensors, seed=7)
    np.testing.assert_array_equal(first.value, again.value)
    other = sense(coast, sensors, seed=8)
    assert not np.array_equal(first.value, other.value)
    alone = sense(coast, sensors[:1], seed=7)
    together = first[first.channel == Channel.SPEED_THROUGH_WATER]
    np.testing.assert_array_equal(alone.value, together.value)


@pytest.mark.parametrize(
    ('sensor', 'message'),
    [
        (replace(LOG, rate_hz=0.0), 'rate_hz is 0.0'),
        (replace(LOG, sd=-1.0), 'sd is -1.0'),
        (replace(LOG, delay_s=np.nan), 'delay_s is nan'),
        (replace(LOG, outlier_fraction=2.0), 'outlier_fraction is 2.0'),
        (replace(LOG, coloured=GaussMarkov(1.0, -1.0)), 'coloured correlation_time_s is -1.0'),
        (Sensor(channel=Channel.POSITION_GEODETIC), 'position_geodetic'),
    ],
)
def test_an_impossible_sensor_is_named(coast, sensor, message):
    with pytest.raises(SimulationError, match=message):
        sense(coast, [sensor], seed=1)


def test_one_sensor_of_a_channel(coast):
    with pytest.raises(SimulationError, match='two sensors'):
        sense(coast, [LOG, LOG], seed=1)
