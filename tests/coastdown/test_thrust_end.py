# SPDX-License-Identifier: Apache-2.0
"""A thrust that runs down slowly is dated by its end, and a quick stop is left as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown.events import Dismissal
from shipdrag_ros.coastdown.examination import Examination, examine
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Propulsion, Ship

EPOCH_NS = 1_700_000_000_000_000_000
STOP_S, LENGTH_S = 900.0, 1500.0
TIME_S = np.arange(0.0, LENGTH_S)
SHIP = Ship(
    length_m=80.0,
    displaced_volume_m3=3000.0,
    added_mass=ConstantAddedMass(value=0.06),
    propulsion=Propulsion(run_down_s=8.0, sd=4.0),
)


def sailed(thrust: np.ndarray, power: float = 2.2) -> np.ndarray:
    """Return the speed of a ship of 6 m/s, by thrust over the steady one each second."""
    speed = np.empty(len(thrust))
    v = 6.0
    for i, part in enumerate(thrust):
        speed[i] = v
        v -= 0.03 * ((v / 6.0) ** power - part)
    return speed


def after_s(stop_s: float = STOP_S) -> np.ndarray:
    return np.maximum(TIME_S - stop_s, 0.0)


def quick(run_down_s: float) -> np.ndarray:
    return np.exp(-after_s() / run_down_s)


def slow(length_s: float) -> np.ndarray:
    return np.clip(1.0 - after_s() / length_s, 0.0, 1.0)


def one_by_one(apart_s: float) -> np.ndarray:
    return 0.5 * (after_s() == 0.0) + 0.5 * (after_s(STOP_S + apart_s) == 0.0)


def block(channel: Channel, value: np.ndarray) -> Block:
    return Block.of(channel, EPOCH_NS + (TIME_S * 1e9).astype(np.int64), value)


def log(speed: np.ndarray, seed: int) -> Block:
    """Return what a log with a filter of 8 s makes of a speed."""
    reading = np.empty(len(speed))
    v = speed[0]
    for i, true in enumerate(speed):
        v += (true - v) / 8.0
        reading[i] = v
    rng = np.random.default_rng(seed)
    return block(Channel.SPEED_THROUGH_WATER, reading + rng.normal(0.0, 0.02, len(speed)))


def track(speed: np.ndarray, seed: int) -> Block:
    rng = np.random.default_rng(seed)
    place = np.column_stack([np.cumsum(speed), np.zeros(len(speed))])
    return block(Channel.POSITION, place + rng.normal(0.0, 0.5, place.shape))


def examined(
    *blocks: Block, onset_s: float, ship: Ship = SHIP, end_s: float = LENGTH_S
) -> Examination:
    start_ns, end_ns = (EPOCH_NS + round(s * 1e9) for s in (STOP_S + onset_s, end_s))
    joined = in_arrival_order(list(blocks))
    window = Window.from_block(joined, start_ns, end_ns, before_ns=EPOCH_NS)
    return examine(window, ship, Parameters())


def start_s(found: Examination) -> float:
    return (found.start_ns - EPOCH_NS) * 1e-9 - STOP_S


@pytest.mark.parametrize('sensor', [log, track])
@pytest.mark.parametrize(
    ('thrust', 'onset_s', 'gone_s'),
    [(slow(60.0), 20.0, 60.0), (slow(120.0), 45.0, 100.0), (one_by_one(90.0), 40.0, 90.0)],
    # of one that falls evenly for long the last quarter is told least
    ids=['60 s', '120 s', 'one by one'],
)
def test_a_coastdown_begins_where_the_thrust_is_gone(
    sensor, thrust: np.ndarray, onset_s: float, gone_s: float
) -> None:
    for seed in range(5):
        found = examined(sensor(sailed(thrust), seed), onset_s=onset_s)
        assert found.failure is None
        assert [cut.reason for cut in found.cuts] == [Dismissal.THRUST]
        assert 'the deceleration grows for' in found.cuts[0].text
        assert start_s(found) == pytest.approx(gone_s, abs=20.0)


@pytest.mark.parametrize('sensor', [log, track])
@pytest.mark.parametrize('power', [1.7, 2.2, 3.0])
@pytest.mark.parametrize('run_down_s', [0.1, 8.0])
def test_a_quick_stop_is_left_as_it_is(sensor, power: float, run_down_s: float) -> None:
    for seed in range(5):
        found = examined(sensor(sailed(quick(run_down_s), power), seed), onset_s=5.0)
        assert found.cuts == ()


def test_a_run_down_that_the_ship_file_states_is_not_cut() -> None:
    record = log(sailed(quick(25.0)), 1)
    assert examined(record, onset_s=10.0).cuts
    known = replace(SHIP, propulsion=Propulsion(run_down_s=25.0, sd=5.0))
    assert examined(record, onset_s=10.0, ship=known).cuts == ()


def test_a_shaft_dates_the_stop_itself() -> None:
    thrust = slow(60.0)
    shaft = block(Channel.SHAFT, 12.0 * thrust)
    found = examined(log(sailed(thrust), 1), shaft, onset_s=20.0)
    assert not any('deceleration grows' in cut.text for cut in found.cuts)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('length_s', [10.0, 30.0, 70.0])
def test_too_short_a_coastdown_is_left_as_it_is(length_s: float) -> None:
    found = examined(log(sailed(slow(60.0)), 1), onset_s=20.0, end_s=STOP_S + 20.0 + length_s)
    assert found.cuts == ()
