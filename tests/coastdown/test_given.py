# SPDX-License-Identifier: Apache-2.0
"""A window that a person claims is cut to what is a coastdown, and a clean one stays whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown.events import Dismissal
from shipdrag_ros.coastdown.given import GivenPart, estimate_given, judge
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.estimation.words import notes
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.simulation import GaussMarkov, Scenario, Sensor, sense, simulate

START_NS = 1_700_000_000_000_000_000
BOAT = Ship(length_m=10.0, displaced_volume_m3=5.0, added_mass=ConstantAddedMass(value=0.1))
LOG, HEADING, SHAFT = Channel.SPEED_THROUGH_WATER, Channel.HEADING, Channel.SHAFT
LENGTH_S = 300.0
TIME_S = np.arange(0.0, LENGTH_S)
BIN_S = 2.0


def glide(time_s: np.ndarray, *, start_s: float = 0.0, speed: float = 4.0) -> np.ndarray:
    """Return the speed of a boat that coasts by v' = -0.006 v^2 from a time on."""
    return speed / (1.0 + 0.006 * speed * np.maximum(time_s - start_s, 0.0))


def slowed(levels: np.ndarray, *, first: float = 4.0) -> np.ndarray:
    """Return the speed of the boat under revs, as parts of those that hold her first speed."""
    speed, out = first, []
    for level in levels:
        revs = level * first
        pushes = max(1.65 * revs * abs(revs) - revs * speed, 0.0) / 0.65  # none at 1.65 of it
        pushes -= revs**2 if revs < 0.0 else 0.0
        out.append(speed)
        speed -= 0.006 * (speed**2 - pushes)
    return np.array(out)


def block(channel: Channel, value: np.ndarray, time_s: np.ndarray = TIME_S) -> Block:
    return Block.of(channel, START_NS + (time_s * 1e9).astype(np.int64), value)


def noisy(speed: np.ndarray, seed: int = 0) -> np.ndarray:
    return speed + np.random.default_rng(seed).normal(0.0, 0.02, len(speed))


def window(*blocks: Block, before_s: float | None = None, end_s: float = LENGTH_S) -> Window:
    before_ns = None if before_s is None else START_NS - round(before_s * 1e9)
    joined = in_arrival_order(list(blocks))
    return Window.from_block(joined, START_NS, START_NS + round(end_s * 1e9), before_ns=before_ns)


def judged(*blocks: Block, **parameters: object) -> GivenPart:
    return judge(window(*blocks), BOAT, Parameters(**parameters))  # type: ignore[arg-type]


def kept_s(found: GivenPart) -> tuple[float, float]:
    return (found.start_ns - START_NS) / 1e9, (found.end_ns - START_NS) / 1e9


def reasons(found: GivenPart) -> set[Dismissal]:
    return {cut.reason for cut in found.cuts}


def is_whole(found: GivenPart) -> bool:
    return found.cuts == () and found.failure is None and kept_s(found) == (0.0, LENGTH_S)


# what a shaft says


@pytest.mark.parametrize('fraction', [0.35, 0.6, 0.8])
def test_a_shaft_that_the_water_turns_is_no_thrust(fraction: float) -> None:
    speed = glide(TIME_S)
    assert is_whole(judged(block(LOG, noisy(speed)), block(SHAFT, fraction * 3.0 * speed)))


def test_the_glide_begins_where_the_shaft_stops() -> None:
    shaft = np.where(TIME_S < 80.0, 12.0, 0.0)
    found = judged(block(LOG, noisy(glide(TIME_S, start_s=80.0))), block(SHAFT, shaft))
    assert reasons(found) == {Dismissal.THRUST}
    assert kept_s(found) == (pytest.approx(80.0, abs=BIN_S), LENGTH_S)
    assert 'the shaft turns' in found.cuts[0].text


def test_what_is_kept_from_where_the_shaft_stops_is_not_said_to_be_cut() -> None:
    time_s = np.arange(-100.0, LENGTH_S)
    # she loses a quarter of her speed in four seconds, then glides
    speed = np.interp(time_s, [0.0, 4.0], [4.0, 3.0])
    speed = np.where(time_s < 4.0, speed, glide(time_s, start_s=4.0, speed=3.0))
    shaft = block(SHAFT, np.where(time_s < 0.0, 12.0, 0.0), time_s)
    claimed = window(block(LOG, noisy(speed), time_s), shaft, before_s=100.0)
    found = judge(claimed, BOAT, Parameters())
    assert kept_s(found) == (0.0, LENGTH_S)
    assert found.cuts == ()


def test_the_last_of_several_shafts_to_stop_counts() -> None:
    shafts = [
        block(channel, np.where(end_s > TIME_S, 12.0, 0.0))
        for channel, end_s in ((SHAFT, 10.0), (Channel.SHAFT_2, 80.0))
    ]
    found = judged(block(LOG, noisy(glide(TIME_S, start_s=80.0))), *shafts)
    assert kept_s(found) == (pytest.approx(80.0, abs=BIN_S), LENGTH_S)
    assert reasons(found) == {Dismissal.THRUST}


def test_a_propeller_at_zero_pitch_is_no_thrust() -> None:
    pitch = block(Channel.PITCH, np.where(TIME_S < 30.0, 0.8, 0.0))
    shaft = block(SHAFT, np.full(len(TIME_S), 12.0))
    found = judged(block(LOG, noisy(glide(TIME_S, start_s=30.0))), shaft, pitch)
    assert kept_s(found) == (pytest.approx(30.0, abs=BIN_S), LENGTH_S)


def test_a_ship_that_goes_faster_leaves_nothing() -> None:
    found = judged(block(LOG, noisy(2.0 + 0.006 * TIME_S)), block(SHAFT, 6.0 + 0.02 * TIME_S))
    assert found.failure is not None
    assert found.failure.startswith('nothing of it is a coastdown: thrust: the shaft turns')
    assert kept_s(found) == (0.0, LENGTH_S)
    assert reasons(found) == {Dismissal.THRUST}


@pytest.mark.parametrize('creep', [0.0, 0.3])
def test_a_shaft_that_stands_is_no_thrust(creep: float) -> None:
    revs = np.where(TIME_S < 20.0, 1.0, 0.0)
    shaft = block(SHAFT, np.maximum(12.0 * revs, creep))
    found = judged(block(LOG, noisy(slowed(revs))), shaft)
    assert reasons(found) == {Dismissal.THRUST}
    assert kept_s(found) == (pytest.approx(20.0, abs=BIN_S), LENGTH_S)


@pytest.mark.parametrize(('kick', 'reason'), [(9.0, 'thrust'), (-9.0, 'astern')])
def test_a_kick_in_the_glide_is_cut_out(kick: float, reason: str) -> None:
    shaft = np.where(TIME_S < 5.0, 12.0, 0.0) + np.where(abs(TIME_S - 100.0) < 3.0, kick, 0.0)
    found = judged(block(LOG, noisy(slowed(shaft / 12.0))), block(SHAFT, shaft))
    assert kept_s(found) == (pytest.approx(103.0, abs=BIN_S), LENGTH_S)
    assert reason in {cut.reason.value for cut in found.cuts if cut.start_ns > START_NS + 9e10}


@pytest.mark.parametrize('pitch_s', [[], [3.0]], ids=['shaft', 'and a pitch that is read once'])
def test_a_shaft_that_holds_a_lower_speed_while_the_ship_slows_to_it_drives(pitch_s) -> None:
    revs = np.where(TIME_S < 10.0, 1.0, 0.6)
    pitch = block(Channel.PITCH, np.full(len(pitch_s), 0.8), np.array(pitch_s))
    found = judged(block(LOG, noisy(slowed(revs))), block(SHAFT, 12.0 * revs), pitch)
    assert found.failure is not None
    assert 'the shaft turns' in found.failure


@pytest.mark.parametrize(('level', 'told'), [(0.0, False), (0.5, True), (0.8, True)])
def test_a_level_that_only_the_claim_makes_a_glide_is_told(level: float, told: bool) -> None:
    read = window(block(LOG, noisy(slowed(np.full(len(TIME_S), level)))))
    found = estimate_given(read, BOAT, Parameters(), estimate_final)
    assert found.estimate is not None
    assert any('is not told from zero' in note for note in notes(found.estimate)) == told


def test_power_taken_back_in_steps_is_no_coastdown() -> None:
    time_s = np.arange(-200.0, LENGTH_S)
    revs = np.select([time_s < 0.0, time_s < 150.0], [1.0, 0.75], 0.5)
    inputs = [block(LOG, noisy(slowed(revs)), time_s), block(SHAFT, 12.0 * revs, time_s)]
    found = judge(window(*inputs, before_s=200.0), BOAT, Parameters())
    assert found.failure is not None
    assert 'the shaft turns' in found.failure


def test_a_run_down_from_the_start_on_is_cut() -> None:
    time_s = np.arange(-135.0, LENGTH_S)
    revs = np.where(time_s < 0.0, 1.0, np.exp(-np.maximum(time_s, 0.0) / 8.0))
    inputs = [block(LOG, noisy(slowed(revs)), time_s), block(SHAFT, 12.0 * revs, time_s)]
    found = judge(window(*inputs, before_s=135.0), BOAT, Parameters())
    # a shaft without fewer turns a metre than 1 / 1.65 of those before pushes: until 4 s;
    # it turns at a tenth of its revs at 18 s
    assert 4.0 - BIN_S < kept_s(found)[0] < 18.5
    assert kept_s(found)[1] == LENGTH_S
    assert reasons(found) == {Dismissal.THRUST}


def test_a_window_in_which_she_is_driven_almost_to_its_end_is_refused() -> None:
    revs = np.where(TIME_S < 295.0, 1.0, 0.0)
    found = judged(block(LOG, noisy(slowed(revs))), block(SHAFT, 12.0 * revs))
    assert kept_s(found) == (0.0, LENGTH_S)
    assert found.failure is not None
    assert 'the shaft turns' in found.failure


def test_a_shaft_that_is_let_go_may_speed_up_to_windmill() -> None:
    time_s = np.arange(-200.0, LENGTH_S)
    speed = glide(time_s)
    turning = np.where(time_s < 0.0, 12.0, np.where(time_s < 40.0, 3.0, 0.5 * 3.0 * speed))
    inputs = [block(LOG, noisy(speed), time_s), block(SHAFT, turning, time_s)]
    assert is_whole(judge(window(*inputs, before_s=200.0), BOAT, Parameters()))


def test_a_shaft_that_keeps_its_revs_in_a_glide_is_told() -> None:
    found = judged(block(LOG, noisy(glide(TIME_S))), block(SHAFT, np.full(len(TIME_S), 12.0)))
    assert is_whole(found)
    assert 'zero pitch' in found.notes[0]


def test_a_shaft_of_which_only_the_glide_is_read_may_windmill_without_a_note() -> None:
    speed = 4.0 / (1.0 + 0.003 * TIME_S)
    found = judged(block(LOG, noisy(speed)), block(SHAFT, 1.5 * speed))
    assert is_whole(found)
    assert found.notes == ()


def test_of_several_parts_the_better_one_is_kept_and_the_other_told() -> None:
    driven = (TIME_S > 60.0) & (TIME_S < 90.0)
    speed = np.where(TIME_S < 60.0, glide(TIME_S), glide(TIME_S, start_s=90.0, speed=1.64))
    speed = np.where(driven, 1.64, speed)
    found = judged(block(LOG, noisy(speed)), block(SHAFT, np.where(driven, 9.0, 0.0)))
    assert kept_s(found)[0] == pytest.approx(90.0, abs=2.0 * BIN_S)
    (other,) = (cut for cut in found.cuts if cut.reason is Dismissal.OTHER)
    assert 'a better part is kept' in other.text
    assert Dismissal.THRUST in reasons(found)


def test_a_further_log_is_heard_where_the_first_is_silent() -> None:
    speed, first = glide(TIME_S), TIME_S < 100.0
    other = block(Channel.SPEED_THROUGH_WATER_2, 1.1 * noisy(speed, 1))
    assert is_whole(judged(block(LOG, noisy(speed)[first], TIME_S[first]), other))
    assert is_whole(judged(other))


# what heading, track, rudder and log say


def test_a_turn_at_the_end_is_cut_by_heading_and_by_course() -> None:
    yaw = 0.7 + np.maximum(TIME_S - 200.0, 0.0) * 0.02
    speed = glide(TIME_S, speed=1.5)
    found = judged(block(LOG, noisy(speed)), block(HEADING, np.angle(np.exp(1j * yaw))))
    assert reasons(found) == {Dismissal.TURN}
    assert kept_s(found) == (0.0, pytest.approx(200.0, abs=6.0))
    track = np.cumsum(np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw)]), axis=0)
    found = judged(block(LOG, noisy(speed)), block(Channel.POSITION, track))
    assert reasons(found) == {Dismissal.TURN}
    assert kept_s(found)[1] == pytest.approx(200.0, abs=15.0)


def test_rudder_over_at_the_end_is_cut_and_all_the_time_is_told() -> None:
    rudder = np.where(TIME_S < 220.0, 0.0, -0.5)
    found = judged(block(LOG, noisy(glide(TIME_S))), block(Channel.RUDDER, rudder))
    assert reasons(found) == {Dismissal.TURN}
    assert kept_s(found) == (0.0, pytest.approx(220.0, abs=BIN_S))
    always = block(Channel.RUDDER, np.full(len(TIME_S), -0.5))
    found = judged(block(LOG, noisy(glide(TIME_S))), always)
    assert is_whole(found)
    assert 'she turns' in found.notes[0]


@pytest.mark.parametrize('every', [1, 5])
def test_a_rudder_amidships_is_no_turn(every: int) -> None:
    still = np.zeros(len(TIME_S))
    heading = block(HEADING, still[::every], TIME_S[::every])
    found = judged(block(LOG, noisy(glide(TIME_S))), block(Channel.RUDDER, still), heading)
    assert is_whole(found)
    assert found.notes == ()


def test_a_log_that_begins_late_hides_no_glide() -> None:
    late, still = TIME_S >= 20.0, np.zeros(len(TIME_S))
    log = block(LOG, noisy(glide(TIME_S))[late], TIME_S[late])
    found = judged(log, block(HEADING, still))
    assert found.failure is None
    assert kept_s(found)[1] == LENGTH_S


def test_going_astern_is_refused_by_the_log_and_by_the_course() -> None:
    found = judged(block(LOG, -noisy(glide(TIME_S))))
    assert reasons(found) == {Dismissal.ASTERN}
    assert found.failure is not None
    assert 'goes astern' in found.failure
    track = np.column_stack([-np.cumsum(glide(TIME_S)), np.zeros(len(TIME_S))])
    ground = block(Channel.SPEED_OVER_GROUND, noisy(glide(TIME_S)))
    ahead = block(HEADING, np.zeros(len(TIME_S)))
    found = judged(ground, block(Channel.POSITION, track), ahead)
    assert reasons(found) == {Dismissal.ASTERN}
    sideways = block(HEADING, np.full(len(TIME_S), 0.5 * np.pi))
    assert is_whole(judged(ground, block(Channel.POSITION, track), sideways))
    compass = block(HEADING, np.full(len(TIME_S), 1.5 * np.pi))
    found = judged(ground, block(Channel.POSITION, track), compass, heading_convention='compass')
    assert is_whole(found)


def test_a_gap_is_cut_and_a_short_one_is_not() -> None:
    log = noisy(glide(TIME_S))
    long = (TIME_S < 60.0) | (TIME_S > 150.0)
    found = judged(block(LOG, log[long], TIME_S[long]))
    assert Dismissal.GAP in reasons(found)
    assert kept_s(found)[0] == pytest.approx(151.0, abs=BIN_S)
    short = (TIME_S < 60.0) | (TIME_S > 90.0)
    assert is_whole(judged(block(LOG, log[short], TIME_S[short])))


# what the speed alone says


@pytest.mark.parametrize('scale', [0.025, 8.0])
class TestSpeedAlone:
    """At any scale of time: a car of 7 s, a ship of 40 min; the rest here is of a boat."""

    def found(self, speed: np.ndarray, scale: float, noise: float = 0.02) -> GivenPart:
        time_s = np.linspace(0.0, LENGTH_S, 1 + round(min(LENGTH_S * scale * 100.0, 3000.0)))
        rng = np.random.default_rng(3)
        value = np.interp(time_s, np.linspace(0.0, LENGTH_S, len(speed)), speed)
        log = block(LOG, rng.normal(value, noise), time_s * scale)
        one = Window.from_block(log, START_NS, START_NS + round(LENGTH_S * scale * 1e9))
        ship = replace(BOAT, length_m=10.0 * scale, displaced_volume_m3=5.0 * scale**3)
        found = judge(one, ship, Parameters())
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
        # and then she is at rest
        assert found.cuts[0].reason is Dismissal.BRAKE
        assert reasons(found) <= {Dismissal.BRAKE, Dismissal.SLOW}
        assert kept_s(found) == (0.0, pytest.approx(200.0, abs=10.0))

    def test_a_hull_that_is_caught_is_cut(self, scale: float) -> None:
        found = self.found(np.where(TIME_S < 220.0, glide(TIME_S), 0.0), scale)
        assert reasons(found) <= {Dismissal.BRAKE, Dismissal.SLOW}
        assert kept_s(found) == (0.0, pytest.approx(220.0, abs=8.0))

    def test_acceleration_before_the_coast_is_cut(self, scale: float) -> None:
        speed = np.minimum(1.0 + TIME_S * 0.05, glide(TIME_S, start_s=60.0))
        found = self.found(speed, scale)
        # the bin of the highest speed may be a regime of its own
        assert found.cuts[0].reason is Dismissal.LEAD_IN
        assert reasons(found) <= {Dismissal.LEAD_IN, Dismissal.BRAKE}
        assert kept_s(found) == (pytest.approx(62.0, abs=8.0), LENGTH_S)

    def test_steady_sailing_before_the_coast_is_cut(self, scale: float) -> None:
        found = self.found(glide(TIME_S, start_s=80.0), scale)
        assert reasons(found) == {Dismissal.LEAD_IN}
        assert kept_s(found) == (pytest.approx(80.0, abs=8.0), LENGTH_S)

    def test_a_plateau_is_cut(self, scale: float) -> None:
        found = self.found(np.maximum(glide(TIME_S), 1.4), scale, noise=0.01)
        assert reasons(found) == {Dismissal.PLATEAU}
        assert kept_s(found) == (0.0, pytest.approx(77.0, abs=8.0))


def held_at_first(until_s: float, length_s: float, *, start: float = 6.0) -> np.ndarray:
    """Return the speed of a ship of 150 m that something slows until a time."""
    speed = [start]
    for time_s in np.arange(1.0, length_s):
        water = 5e-4 + 2.7e-4 * speed[-1] ** 2
        speed.append(speed[-1] - water - (0.015 if time_s < until_s else 0.0))
    return np.array(speed)


def test_a_brake_that_is_let_go_is_cut_and_nothing_else() -> None:
    ship = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    speed = held_at_first(120.0, 780.0)
    noise = np.random.default_rng(900).normal(0.0, 0.03, len(speed))
    log = block(LOG, speed + noise, np.arange(780.0))
    found = judge(window(log, end_s=780.0), ship, Parameters())
    assert [cut.reason for cut in found.cuts] == [Dismissal.BRAKE]
    assert kept_s(found) == (pytest.approx(120.0, abs=10.0), 780.0)


def test_a_brake_that_is_let_go_late_leaves_no_coastdown_before_it() -> None:
    ship = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    speed = held_at_first(75.0, 102.0, start=4.87)
    right = 0
    for seed in range(6):
        noise = np.random.default_rng(900 + seed).normal(0.0, 0.03, len(speed))
        log = block(LOG, speed + noise, np.arange(102.0))
        found = judge(window(log, end_s=102.0), ship, Parameters())
        cut = {cut.reason for cut in found.cuts} == {Dismissal.BRAKE}
        right += cut and (found.failure is not None or kept_s(found)[0] > 68.0)
    # 27 s of a glide after it: not every noise shows that the force has changed
    assert right >= 5


def test_spikes_are_no_change_of_the_force() -> None:
    speed = noisy(glide(TIME_S))
    rng = np.random.default_rng(8)
    speed[rng.choice(300, 6, replace=False)] += rng.choice([-3.0, 3.0], 6)
    speed[rng.choice(300, 4, replace=False)] = 0.0
    assert is_whole(judged(block(LOG, speed)))


# clean coastdowns of simulated ships


@pytest.mark.parametrize('seed', range(3))  # log, radar, both
def test_clean_coastdowns_of_a_ship_in_a_seaway_stay_whole(ship: Ship, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    sea, gust = rng.choice([0.02, 0.07, 0.13]), rng.choice([0.0, 1e-4, 3e-4])
    duration_s = float(rng.uniform(600.0, 1500.0))
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
    found = judge(one, ship, Parameters())
    assert found.failure is None
    assert found.cuts == ()
