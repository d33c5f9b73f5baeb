# SPDX-License-Identifier: Apache-2.0
"""A log that reads exactly 0 below some speed has a dead band; other zeros are none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shipdrag_ros.diagnosis import SailingRecord, diagnose_sailing
from shipdrag_ros.diagnosis.sailing_model import StandingLog
from shipdrag_ros.inference.decision import Verdict
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order

BAND_M_S = 0.6


def record(
    *, band_m_s: float = 0.0, dropped: float = 0.0, drifting: bool = False, seed: int = 1
) -> SailingRecord:
    """Sail two hours at changing speeds and courses, slower than the band for a third of it."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 7200.0)
    leg = (time // 600.0).astype(int)
    speed = np.array([0.4, 1.5, 2.5])[leg % 3] + 0.05 * np.sin(time / 100.0)
    course = np.radians(np.array([10.0, 130.0, 250.0, 310.0])[leg // 3])
    log: Float64 = speed + rng.normal(0.0, 0.03, len(time))
    velocity = np.array([speed * np.cos(course), speed * np.sin(course)]).T
    if drifting:  # with the water, the log rightly at 0
        velocity[speed < 1.0] = (0.3, 0.1)
        log[speed < 1.0] = 0.0
    log[speed < band_m_s] = 0.0
    # some minutes in ten without a reading, at any speed
    log[np.repeat(rng.random(120) < dropped, 60)] = 0.0
    place = np.cumsum(velocity, axis=0) + rng.normal(0.0, 1.0, (len(time), 2))
    stamps = np.round(time * 1e9).astype(np.int64) + 10**18
    return SailingRecord(
        'sailing',
        in_arrival_order(
            [
                Block.of(Channel.SPEED_THROUGH_WATER, stamps, log),
                Block.of(Channel.POSITION, stamps, place),
            ]
        ),
    )


def test_a_wheel_that_stands_still_has_a_dead_band() -> None:
    # N = 5, seeds 0 .. 4: the speed lies between those that are and are not read
    for seed in range(5):
        found = StandingLog.of([record(band_m_s=BAND_M_S, seed=seed)], Parameters())
        assert found is not None
        assert found.log_factor > 9.0  # odds of 1 to 50 beforehand
        assert 0.4 < found.way.unknowns[0].prior.at(found.z) < 1.5
        assert found.share > 0.95
        assert found.at_m_s.max() < BAND_M_S


@pytest.mark.parametrize('other', [{}, {'dropped': 0.3}, {'drifting': True}])
def test_other_zeros_are_no_dead_band(other: dict[str, float]) -> None:
    # N = 5, seeds 0 .. 4
    for seed in range(5):
        found = StandingLog.of([record(**other, seed=seed)], Parameters())
        assert found is None or found.log_factor < 0.0


def test_zeros_at_any_speed_are_said_and_not_named() -> None:
    found = diagnose_sailing([record(dropped=0.3)], Parameters())
    assert found.notes[0].startswith('the log reads exactly 0 in')
    assert not any('log_dead_band' in each.names for each in found.candidates)


def test_the_diagnosis_names_it_and_says_why() -> None:
    found = diagnose_sailing([record(band_m_s=BAND_M_S)], Parameters())
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert effect.name == 'log_dead_band'
    assert found.candidates[0].names == ('log_dead_band',)
    assert found.notes[0].startswith('the log reads exactly 0 in')
    assert found.where is not None
    assert found.where.channel == 'log'
    assert math.isfinite(found.before.chi2_per_sample)


def test_noise_of_the_way_over_ground_is_no_error_that_bends_with_the_speed() -> None:
    rng, records = np.random.default_rng(1), []
    time = np.arange(0.0, 3300.0)
    speed = 8.0 / (1.0 + np.maximum(time - 1800.0, 0.0) / 500.0)
    stamps = np.round(time * 1e9).astype(np.int64) + 10**18
    for name in 'abcd':  # steady for the most part: many legs of one speed, apart by noise alone
        place = np.zeros((len(time), 2))
        place[:, 0] = np.cumsum(speed)
        place += rng.normal(0.0, 10.0, place.shape)
        log = speed + rng.normal(0.0, 0.05, len(time))
        parts = [(Channel.SPEED_THROUGH_WATER, log), (Channel.POSITION, place)]
        block = in_arrival_order([Block.of(channel, stamps, value) for channel, value in parts])
        records.append(SailingRecord(name, block))
    assert diagnose_sailing(records, Parameters()).verdict is Verdict.NONE
