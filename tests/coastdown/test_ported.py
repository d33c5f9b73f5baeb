# SPDX-License-Identifier: Apache-2.0
"""What the judging of windows by rules held and that by histories does not yet."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.coastdown.events import Dismissal
from shipdrag_ros.coastdown.given import GivenPart as Examination
from shipdrag_ros.coastdown.given import judge as examine
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship

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


@pytest.mark.parametrize(('rate', 'reason'), [(0.0, Dismissal.BRAKE), (0.004, Dismissal.TURN)])
def test_what_slows_her_while_the_heading_swings_is_a_turn(rate: float, reason: Dismissal) -> None:
    speed = glide(TIME_S)
    speed[240:] = speed[240] - 0.006 * np.arange(60.0)
    heading = 1.0 + rate * np.maximum(TIME_S - 240.0, 0.0)
    found = examined(block(LOG, noisy(speed)), block(HEADING, heading))
    assert reasons(found) == {reason}
    assert kept_s(found) == (0.0, pytest.approx(240.0, abs=12.0))


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
