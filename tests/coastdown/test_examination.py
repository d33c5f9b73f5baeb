# SPDX-License-Identifier: Apache-2.0
"""A stretch is cut to what is a coastdown, and a clean one stays whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown.events import Dismissal
from shipdrag_ros.coastdown.examination import Examination, examine
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.simulation import GaussMarkov, Scenario, Sensor, sense, simulate

START_NS = 1_700_000_000_000_000_000
BOAT = Ship(length_m=10.0, displaced_volume_m3=5.0, added_mass=ConstantAddedMass(value=0.1))
LOG, HEADING, SHAFT = Channel.SPEED_THROUGH_WATER, Channel.HEADING, Channel.SHAFT
LENGTH_S = 300.0
TIME_S = np.arange(0.0, LENGTH_S)


def glide(time_s: np.ndarray, *, start_s: float = 0.0, speed: float = 4.0) -> np.ndarray:
    """Return the speed of a boat that coasts by v' = -0.006 v^2 from a time on."""
    return speed / (1.0 + 0.006 * speed * np.maximum(time_s - start_s, 0.0))


def block(channel: Channel, value: np.ndarray, time_s: np.ndarray = TIME_S) -> Block:
    return Block.of(channel, START_NS + (time_s * 1e9).astype(np.int64), value)


def noisy(speed: np.ndarray, seed: int = 0) -> np.ndarray:
    return speed + np.random.default_rng(seed).normal(0.0, 0.02, len(speed))


def window(*blocks: Block, before_s: float | None = None, end_s: float = LENGTH_S) -> Window:
    before_ns = None if before_s is None else START_NS - round(before_s * 1e9)
    joined = in_arrival_order(list(blocks))
    return Window.from_block(joined, START_NS, START_NS + round(end_s * 1e9), before_ns=before_ns)


def examined(*blocks: Block, **parameters: object) -> Examination:
    return examine(window(*blocks), BOAT, Parameters(**parameters))  # type: ignore[arg-type]


def kept_s(found: Examination) -> tuple[float, float]:
    return (found.start_ns - START_NS) / 1e9, (found.end_ns - START_NS) / 1e9


def reasons(found: Examination) -> set[Dismissal]:
    return {cut.reason for cut in found.cuts}


def is_whole(found: Examination) -> bool:
    return found.cuts == () and found.failure is None and kept_s(found) == (0.0, LENGTH_S)


# what a shaft says


@pytest.mark.parametrize('fraction', [0.35, 0.6, 0.8])
def test_a_shaft_that_the_water_turns_is_no_thrust(fraction: float) -> None:
    speed = glide(TIME_S)
    assert is_whole(examined(block(LOG, noisy(speed)), block(SHAFT, fraction * 3.0 * speed)))


@pytest.mark.parametrize('creep', [0.0, 0.3])
def test_a_shaft_that_stands_is_no_thrust(creep: float) -> None:
    shaft = np.where(TIME_S < 20.0, 12.0, creep)
    found = examined(block(LOG, noisy(glide(TIME_S))), block(SHAFT, shaft))
    assert reasons(found) == {Dismissal.THRUST}
    assert kept_s(found) == (20.0, LENGTH_S)


def test_a_propeller_at_zero_pitch_is_no_thrust() -> None:
    pitch = block(Channel.PITCH, np.where(TIME_S < 30.0, 0.8, 0.0))
    shaft = block(SHAFT, np.full(len(TIME_S), 12.0))
    found = examined(block(LOG, noisy(glide(TIME_S))), shaft, pitch)
    assert kept_s(found) == (30.0, LENGTH_S)


def test_a_shaft_that_keeps_its_speed_while_the_ship_slows_drives() -> None:
    found = examined(block(LOG, noisy(glide(TIME_S))), block(SHAFT, np.full(len(TIME_S), 12.0)))
    assert reasons(found) == {Dismissal.THRUST}
    assert found.failure is not None
    assert 'nothing of it is a coastdown: thrust: the shaft turns' in found.failure
    assert '115 rpm' in found.failure


def test_the_last_of_several_shafts_to_stop_counts() -> None:
    shafts = [
        block(channel, np.where(end_s > TIME_S, 12.0, 0.0))
        for channel, end_s in ((SHAFT, 10.0), (Channel.SHAFT_2, 80.0))
    ]
    found = examined(block(LOG, noisy(glide(TIME_S))), *shafts)
    assert kept_s(found) == (80.0, LENGTH_S)
    assert any(cut.text.startswith('shaft 2 turns') for cut in found.cuts)


@pytest.mark.parametrize(('kick', 'reason'), [(9.0, 'thrust'), (-9.0, 'astern')])
def test_a_kick_in_the_glide_is_cut_out(kick: float, reason: str) -> None:
    shaft = np.where(TIME_S < 5.0, 12.0, 0.0) + np.where(abs(TIME_S - 100.0) < 3.0, kick, 0.0)
    found = examined(block(LOG, noisy(glide(TIME_S))), block(SHAFT, shaft))
    assert kept_s(found) == (103.0, LENGTH_S)
    assert reason in {cut.reason.value for cut in found.cuts if cut.start_ns > START_NS + 9e10}


def after_steady_sailing(
    turning: np.ndarray, time_s: np.ndarray, speed: np.ndarray
) -> Examination:
    inputs = [block(LOG, noisy(speed), time_s), block(SHAFT, turning, time_s)]
    return examine(window(*inputs, before_s=600.0), BOAT, Parameters())


def test_a_run_down_from_the_start_on_is_cut() -> None:
    time_s = np.arange(-135.0, LENGTH_S)
    shaft = np.where(time_s < 0.0, 12.0, 12.0 * np.exp(-np.maximum(time_s, 0.0) / 8.0))
    inputs = [block(LOG, noisy(glide(time_s)), time_s), block(SHAFT, shaft, time_s)]
    found = examine(window(*inputs, before_s=135.0), BOAT, Parameters())
    assert reasons(found) == {Dismissal.THRUST}
    assert kept_s(found)[0] == pytest.approx(17.0, abs=3.0)


def test_a_shaft_that_holds_a_lower_speed_while_the_ship_slows_to_it_drives() -> None:
    time_s = np.arange(-600.0, LENGTH_S)
    speed = np.where(time_s < 0.0, 4.0, 2.4 + 1.6 * np.exp(-np.maximum(time_s, 0.0) / 90.0))
    turning = 12.0 * np.where(time_s < 0.0, 1.0, 0.6)
    found = after_steady_sailing(turning, time_s, speed)
    assert found.failure is not None
    assert 'the shaft turns' in found.failure


def test_power_taken_back_in_steps_is_no_windmilling() -> None:
    time_s = np.arange(-600.0, LENGTH_S)
    speed = 4.0 / (1.0 + 0.0045 * np.maximum(time_s, 0.0))
    turning = 12.0 * np.select([time_s < 0.0, time_s < 150.0], [1.0, 0.7], 0.45)
    assert after_steady_sailing(turning, time_s, speed).failure is not None


def test_a_shaft_that_is_let_go_may_speed_up_to_windmill() -> None:
    time_s = np.arange(-600.0, LENGTH_S)
    speed = glide(time_s)
    turning = np.where(time_s < 0.0, 12.0, np.where(time_s < 40.0, 3.0, 0.5 * 3.0 * speed))
    assert is_whole(after_steady_sailing(turning, time_s, speed))


# what heading, track, rudder and log say


def test_a_turn_is_cut_by_heading_and_by_course() -> None:
    yaw = 0.7 + np.maximum(TIME_S - 200.0, 0.0) * 0.02
    speed = glide(TIME_S, speed=1.5)
    found = examined(block(LOG, noisy(speed)), block(HEADING, np.angle(np.exp(1j * yaw))))
    assert reasons(found) == {Dismissal.TURN}
    assert kept_s(found) == (0.0, pytest.approx(217.0, abs=6.0))
    track = np.cumsum(np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw)]), axis=0)
    found = examined(block(LOG, noisy(speed)), block(Channel.POSITION, track))
    assert reasons(found) == {Dismissal.TURN}
    assert kept_s(found)[1] == pytest.approx(217.0, abs=25.0)


def test_a_turn_all_the_time_is_told() -> None:
    found = examined(block(LOG, noisy(glide(TIME_S))), block(HEADING, TIME_S * 0.02))
    assert is_whole(found)
    assert 'swings over' in found.notes[0]


def test_rudder_over_at_the_end_is_cut_and_all_the_time_is_told() -> None:
    rudder = np.where(TIME_S < 220.0, 0.0, -0.5)
    found = examined(block(LOG, noisy(glide(TIME_S))), block(Channel.RUDDER, rudder))
    assert reasons(found) == {Dismissal.RUDDER}
    assert kept_s(found) == (0.0, 220.0)
    always = block(Channel.RUDDER, np.full(len(TIME_S), -0.5))
    found = examined(block(LOG, noisy(glide(TIME_S))), always)
    assert is_whole(found)
    assert 'rudder is over by -29 degrees' in found.notes[0]


def test_going_astern_is_refused_by_the_log_and_by_the_course() -> None:
    found = examined(block(LOG, -noisy(glide(TIME_S))))
    assert reasons(found) == {Dismissal.ASTERN}
    assert found.failure is not None
    assert 'goes astern' in found.failure
    track = np.column_stack([-np.cumsum(glide(TIME_S)), np.zeros(len(TIME_S))])
    ground = block(Channel.SPEED_OVER_GROUND, noisy(glide(TIME_S)))
    ahead = block(HEADING, np.zeros(len(TIME_S)))
    found = examined(ground, block(Channel.POSITION, track), ahead)
    assert reasons(found) == {Dismissal.ASTERN}
    sideways = block(HEADING, np.full(len(TIME_S), 0.5 * np.pi))
    assert is_whole(examined(ground, block(Channel.POSITION, track), sideways))
    compass = block(HEADING, np.full(len(TIME_S), 1.5 * np.pi))
    found = examined(ground, block(Channel.POSITION, track), compass, heading_convention='compass')
    assert is_whole(found)


def test_a_gap_is_cut_and_a_short_one_is_not() -> None:
    log = noisy(glide(TIME_S))
    long = (TIME_S < 60.0) | (TIME_S > 150.0)
    found = examined(block(LOG, log[long], TIME_S[long]))
    assert Dismissal.GAP in reasons(found)
    assert kept_s(found)[0] == 151.0
    short = (TIME_S < 60.0) | (TIME_S > 90.0)
    assert is_whole(examined(block(LOG, log[short], TIME_S[short])))


# what the speed alone says


@pytest.mark.parametrize('scale', [0.025, 0.1, 1.0, 8.0])
class TestSpeedAlone:
    """At any scale of time: a car of 7 s, a model, a boat, a ship of 40 min."""

    def found(self, speed: np.ndarray, scale: float, noise: float = 0.02) -> Examination:
        time_s = np.linspace(0.0, LENGTH_S, 1 + round(min(LENGTH_S * scale * 100.0, 3000.0)))
        rng = np.random.default_rng(3)
        value = np.interp(time_s, np.linspace(0.0, LENGTH_S, len(speed)), speed)
        log = block(LOG, rng.normal(value, noise), time_s * scale)
        one = Window.from_block(log, START_NS, START_NS + round(LENGTH_S * scale * 1e9))
        # the same motion in other units of time and length: decelerations are as for the boat
        ship = replace(BOAT, length_m=10.0 * scale, displaced_volume_m3=5.0 * scale**3)
        found = examine(one, ship, Parameters())
        start_s, end_s = kept_s(found)
        return replace(
            found,
            start_ns=START_NS + round(start_s / scale * 1e9),
            end_ns=START_NS + round(end_s / scale * 1e9),
        )

    def test_a_glide_stays_whole(self, scale: float) -> None:
        assert is_whole(self.found(glide(TIME_S), scale))

    def test_a_brake_is_cut(self, scale: float) -> None:
        speed = glide(TIME_S)
        speed[200:] = np.maximum(speed[200] - 0.04 * np.arange(100.0), 0.0)
        found = self.found(speed, scale)
        assert reasons(found) == {Dismissal.BRAKE}
        assert kept_s(found) == (0.0, pytest.approx(200.0, abs=10.0))

    def test_a_hull_that_is_caught_is_cut(self, scale: float) -> None:
        speed = np.where(TIME_S < 220.0, glide(TIME_S), 0.0)
        found = self.found(speed, scale)
        assert reasons(found) == {Dismissal.BRAKE}
        assert kept_s(found) == (0.0, pytest.approx(220.0, abs=8.0))

    def test_acceleration_before_the_coast_is_cut(self, scale: float) -> None:
        speed = np.minimum(1.0 + TIME_S * 0.05, glide(TIME_S, start_s=60.0))
        found = self.found(speed, scale)
        assert reasons(found) == {Dismissal.LEAD_IN}
        assert kept_s(found) == (pytest.approx(62.0, abs=8.0), LENGTH_S)

    def test_steady_sailing_before_the_coast_is_cut(self, scale: float) -> None:
        found = self.found(glide(TIME_S, start_s=80.0), scale)
        assert reasons(found) == {Dismissal.LEAD_IN}
        assert kept_s(found) == (pytest.approx(80.0, abs=8.0), LENGTH_S)

    def test_a_plateau_is_cut(self, scale: float) -> None:
        found = self.found(np.maximum(glide(TIME_S), 1.4), scale, noise=0.01)
        assert reasons(found) == {Dismissal.PLATEAU}
        assert kept_s(found) == (0.0, pytest.approx(77.0, abs=8.0))


@pytest.mark.parametrize(('rate', 'reason'), [(0.0, Dismissal.BRAKE), (0.004, Dismissal.TURN)])
def test_what_slows_her_while_the_heading_swings_is_a_turn(rate: float, reason: Dismissal) -> None:
    speed = glide(TIME_S)
    speed[240:] = speed[240] - 0.006 * np.arange(60.0)
    heading = 1.0 + rate * np.maximum(TIME_S - 240.0, 0.0)
    found = examined(block(LOG, noisy(speed)), block(HEADING, heading))
    assert reasons(found) == {reason}
    assert kept_s(found) == (0.0, pytest.approx(240.0, abs=12.0))


def held_at_first(until_s: float, length_s: float, *, start: float = 6.0) -> np.ndarray:
    """Return the speed of a ship of 150 m that something slows until a time."""
    speed = [start]
    for time_s in np.arange(1.0, length_s):
        water = 5e-4 + 2.7e-4 * speed[-1] ** 2
        speed.append(speed[-1] - water - (0.015 if time_s < until_s else 0.0))
    return np.array(speed)


@pytest.mark.parametrize('seed', range(6))
def test_a_brake_that_is_let_go_is_cut_and_nothing_else(seed: int) -> None:
    ship = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    speed = held_at_first(120.0, 780.0)
    noise = np.random.default_rng(900 + seed).normal(0.0, 0.03, len(speed))
    log = block(LOG, speed + noise, np.arange(780.0))
    found = examine(window(log, end_s=780.0), ship, Parameters())
    assert [cut.reason for cut in found.cuts] == [Dismissal.BRAKE]
    assert kept_s(found) == (pytest.approx(120.0, abs=10.0), 780.0)


@pytest.mark.parametrize('seed', range(6))
def test_a_brake_that_is_let_go_late_leaves_no_coastdown_before_it(seed: int) -> None:
    ship = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    speed = held_at_first(75.0, 102.0, start=4.87)
    noise = np.random.default_rng(900 + seed).normal(0.0, 0.03, len(speed))
    log = block(LOG, speed + noise, np.arange(102.0))
    found = examine(window(log, end_s=102.0), ship, Parameters())
    assert {cut.reason for cut in found.cuts} == {Dismissal.BRAKE}
    assert found.failure is not None or kept_s(found)[0] > 68.0


def test_spikes_are_no_change_of_the_force() -> None:
    speed = noisy(glide(TIME_S))
    rng = np.random.default_rng(8)
    speed[rng.choice(300, 6, replace=False)] += rng.choice([-3.0, 3.0], 6)
    speed[rng.choice(300, 4, replace=False)] = 0.0
    assert is_whole(examined(block(LOG, speed)))


def test_a_refusal_says_what_is_left_and_what_it_takes() -> None:
    shaft = np.where(TIME_S < 295.0, 12.0, 0.0)
    found = examined(block(LOG, noisy(glide(TIME_S))), block(SHAFT, shaft))
    assert found.failure is not None
    assert kept_s(found) == (0.0, LENGTH_S)
    assert '5.0 s with 5 readings' in found.failure
    assert 'it takes 8 readings and a fall of 5%' in found.failure


def test_of_several_parts_the_better_one_is_kept_and_the_other_told() -> None:
    shaft = np.where((TIME_S > 60.0) & (TIME_S < 90.0), 12.0, 0.0)
    found = examined(block(LOG, noisy(glide(TIME_S))), block(SHAFT, shaft))
    assert kept_s(found) == (90.0, LENGTH_S)
    (other,) = (cut for cut in found.cuts if cut.reason is Dismissal.OTHER)
    assert 'a better part is kept' in other.text


# clean coastdowns of simulated ships


def test_clean_coastdowns_of_a_ship_in_a_seaway_stay_whole(ship: Ship) -> None:
    rng = np.random.default_rng(11)
    cut = []
    for seed in range(60):
        sea, gust = rng.choice([0.02, 0.07, 0.13]), rng.choice([0.0, 1e-4, 3e-4])
        duration_s = float(rng.uniform(600.0, 2400.0))
        scenario = Scenario(
            speed_m_s=float(rng.uniform(4.0, 8.2)),
            lead_in_s=200.0,
            duration_s=duration_s,
            gust_force=GaussMarkov(float(gust), 120.0),
            water_speed=GaussMarkov(0.02, 900.0),
        )
        log = Sensor(channel=LOG, sd=0.05, coloured=GaussMarkov(float(sea), 60.0))
        radar = Sensor(channel=Channel.POSITION, sd=10.0)
        sensors = ((log,), (radar,), (log, radar))[seed % 3]
        record = sense(simulate(ship, scenario), sensors, seed=seed, start_ns=START_NS)
        start_ns = START_NS + 240 * 10**9
        one = Window.from_block(record, start_ns, START_NS + round((200.0 + duration_s) * 1e9))
        if examine(one, ship, Parameters()).cuts:
            cut.append(seed)
    assert len(cut) <= 1, cut
