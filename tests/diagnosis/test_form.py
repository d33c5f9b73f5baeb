# SPDX-License-Identifier: Apache-2.0
"""Without a stated baseline a form is fitted, and no single force is ever named."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun, DiagnosisResult, Verdict, diagnose_fitted
from shipdrag_ros.diagnosis.words import sentence
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation import Window
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.ship.baseline import NO_CLEAN_HULL

MODEL = Ship(
    length_m=1.1, displaced_volume_m3=0.015, added_mass=ConstantAddedMass(value=0.1, sd=0.03)
)
TYPES = (Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND)


def coast(
    *,
    force_m_s2: float = 0.0,
    offset_m_s: float = 0.0,
    heading_rad: float = 0.3,
    channel: Channel = Channel.SPEED_THROUGH_WATER,
    bump: float = 0.0,
    seed: int = 1,
    seconds: float = 30.0,
) -> CoastRun:
    """
    Coast with a resistance of another form than is fitted, and read the speed.

    The force pushes to the east; a bump is an error of the reading half-way.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.1)
    speed = np.empty(len(time))
    speed[0] = 0.25
    for i in range(1, len(time)):
        v = speed[i - 1]
        drag = 0.04 * v + 0.28 * v * abs(v) ** 0.83
        speed[i] = v - 0.1 * (drag - force_m_s2 * math.cos(heading_rad - 0.3))
    read = speed + offset_m_s + rng.normal(0.0, 0.001, len(time))
    read += bump * np.exp(-(((time - 10.0) / 2.0) ** 2))
    stamps = np.round(time * 1e9).astype(np.int64) + 10**18
    yaw: Float64 = heading_rad + rng.normal(0.0, 0.01, len(time))
    block = in_arrival_order(
        [Block.of(channel, stamps, read), Block.of(Channel.HEADING, stamps, yaw)]
    )
    return CoastRun('coast', Window.from_block(block, int(stamps[0]), int(stamps[-1])))


def names(found: DiagnosisResult) -> set[tuple[str, ...]]:
    """Return the candidates."""
    return {each.names for each in found.candidates}


def test_without_a_clean_hull_nobody_knows_whether_it_is_fouled() -> None:
    # N = 6, seeds 0..5: were more than 1 in 2 an alarm, none in 6 has a probability < 2 %
    for seed in range(6):
        found = diagnose_fitted([coast(seed=seed)], MODEL)
        assert found.candidates[0].names == ()
        assert ('fouling',) in names(found)
        assert found.verdict is Verdict.ONE_OF
        assert found.baseline == 'fitted_here'
        assert sentence(found).startswith(NO_CLEAN_HULL)
        assert 'Nothing else is missing' in sentence(found)


@pytest.mark.parametrize('channel', TYPES, ids=['log', 'over ground'])
def test_of_one_run_a_constant_part_is_a_set_and_no_force(channel: Channel) -> None:
    # N = 6, seeds 0..5, no name in any; the force is found within 4 sd or 10 %
    for seed in range(6):
        found = diagnose_fitted([coast(force_m_s2=-0.0045, channel=channel, seed=seed)], MODEL)
        assert found.verdict is Verdict.ONE_OF
        assert found.effects == ()
        expected = {('current',), ('waves',), ('wind',)}
        if channel is Channel.SPEED_THROUGH_WATER:
            expected |= {('log_offset',)}
        assert names(found) == expected
        assert found.after is not None
        assert found.after.rms_speed_m_s is not None
        assert found.before.rms_speed_m_s is not None
        assert found.after.rms_speed_m_s < 0.5 * found.before.rms_speed_m_s
        assert found.held_out_before is None
        assert found.where is not None
        assert found.where.channel == 'force'


def test_a_run_on_the_reciprocal_heading_tells_what_turns_with_the_earth() -> None:
    headings = (0.3, 0.3 + math.pi)
    pushed = [coast(force_m_s2=-0.003, heading_rad=h, seed=i) for i, h in enumerate(headings)]
    found = diagnose_fitted(pushed, MODEL)
    assert found.verdict is Verdict.ONE_OF
    assert names(found) == {('current',), ('waves',), ('wind',)}
    shifted = [coast(offset_m_s=-0.03, heading_rad=h, seed=i) for i, h in enumerate(headings)]
    found = diagnose_fitted(shifted, MODEL)
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    size = effect.parameters['offset_m_s']
    assert effect.name == 'log_offset'
    np.testing.assert_allclose(size.value, -0.03, rtol=0.0, atol=max(3.0 * size.sd, 0.003))


def test_an_error_of_no_form_has_no_name() -> None:
    found = diagnose_fitted([coast(bump=0.02)], MODEL)
    assert found.verdict is not Verdict.NAMED


def test_a_run_without_speeds_is_refused() -> None:
    with pytest.raises(DiagnosisError, match='a ship file with `baseline`'):
        diagnose_fitted([coast(seconds=3.0)], MODEL)
