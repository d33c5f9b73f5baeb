# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.coastdown.validate import validate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SET_BACK, Block, Channel, Reason, concatenate

LENGTH_M = 150.0
NOW = 1_700_000_000_000_000_000
S = 1_000_000_000
LOG, GROUND = Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND
METRES, DEGREES = Channel.POSITION, Channel.POSITION_GEODETIC


def sample(channel, stamp_s, value, *, receive_s=None) -> Block:
    receive_s = stamp_s if receive_s is None else receive_s
    return Block.of(
        channel,
        [NOW + round(stamp_s * S)],
        np.atleast_2d(value) if np.ndim(value) else [value],
        receive_ns=[NOW + round(receive_s * S)],
    )


def reasons(*samples: Block, **parameters) -> list[str]:
    codes = validate(concatenate(samples), Parameters(**parameters), LENGTH_M)
    return [Reason(code).name.lower() for code in codes]


@pytest.mark.parametrize(
    ('bad', 'expected'),
    [
        (sample(LOG, 100.0, 8.1, receive_s=101.0), 'duplicate'),
        (sample(LOG, 99.0, 8.1, receive_s=101.0), 'out_of_order'),
        (sample(LOG, 90.0, 8.1, receive_s=101.0), 'out_of_order'),
        (sample(LOG, 103.1, 8.1, receive_s=101.0), 'future'),
        (sample(LOG, 103.0, 8.1, receive_s=101.0), 'accepted'),
        (sample(GROUND, 94.9, 8.1, receive_s=101.0), 'late'),
        (sample(GROUND, 95.0, 8.1, receive_s=101.0), 'accepted'),
        (sample(LOG, 101.0, np.nan), 'nan'),
        (sample(LOG, 101.0, np.inf), 'infinite'),
        (sample(LOG, 101.0, -np.inf), 'infinite'),
        (sample(LOG, 101.0, 40.1), 'absurd'),
        (sample(LOG, 101.0, -40.1), 'absurd'),
        (sample(LOG, 101.0, -39.9), 'accepted'),
        (sample(GROUND, 101.0, 40.1), 'absurd'),
        (sample(METRES, 101.0, [0.0, np.nan]), 'nan'),
        (sample(METRES, 101.0, [np.inf, 0.0]), 'infinite'),
        (sample(METRES, 101.0, [5e5, 6e6]), 'accepted'),
        (sample(DEGREES, 101.0, [90.1, 0.0]), 'absurd'),
        (sample(DEGREES, 101.0, [0.0, 360.1]), 'absurd'),
        (sample(DEGREES, 101.0, [-89.0, 359.0]), 'accepted'),
        (sample(Channel.WIND_APPARENT, 101.0, [1.0, np.nan]), 'nan'),
        (sample(Channel.SHAFT, 101.0, 41.0), 'accepted'),
    ],
)
def test_each_reason(bad: Block, expected: str) -> None:
    assert reasons(sample(LOG, 100.0, 8.0), bad) == ['accepted', expected]


def test_the_unused_column_does_not_matter() -> None:
    block = sample(LOG, 100.0, [8.0, np.nan])
    assert reasons(block) == ['accepted']


def test_a_stamp_is_judged_before_its_value() -> None:
    stale = sample(LOG, 99.0, np.nan, receive_s=101.0)
    assert reasons(sample(LOG, 100.0, 8.0), stale)[1] == 'out_of_order'
    ahead = sample(LOG, 109.0, np.nan, receive_s=101.0)
    assert reasons(sample(LOG, 100.0, 8.0), ahead)[1] == 'future'


def test_a_rejected_sample_leaves_no_trace() -> None:
    ahead = sample(LOG, 500.0, 8.0, receive_s=101.0)
    after = sample(LOG, 101.0, 8.0)
    assert reasons(sample(LOG, 100.0, 8.0), ahead, after) == ['accepted', 'future', 'accepted']


def test_stamps_far_back_that_agree_start_afresh() -> None:
    old = [sample(LOG, 100.0, 8.0), sample(GROUND, 100.0, 8.0)]
    back = [sample(LOG, 80.0 + i, 8.0, receive_s=101.0 + i) for i in range(SET_BACK)]
    after = [sample(GROUND, 83.5, 8.0, receive_s=104.5), sample(LOG, 84.0, 8.0, receive_s=105.0)]
    late = ['late'] * (SET_BACK - 1)
    assert reasons(*old, *back, *after) == ['accepted'] * 2 + late + ['accepted'] * 3


@pytest.mark.parametrize('slips', [1, 2, 40])
def test_a_few_stamps_far_back_are_late_and_no_clock_that_was_set(slips: int) -> None:
    log = [sample(LOG, 100.0 + i, 8.0 + 0.01 * (i % 7)) for i in range(200)]
    expected = ['accepted'] * 200
    for slip in range(slips):
        at = 20 + 4 * slip
        log.insert(
            at, sample(LOG, 50.0 + slip, 8.0, receive_s=(int(log[at].stamp_ns[0]) - NOW) / S)
        )
        expected.insert(at, 'late')
    assert reasons(*log) == expected


def test_an_arrival_far_back_starts_afresh() -> None:
    old = sample(LOG, 100.0, 8.0)
    # the stamps of another sensor may go on as if nothing had happened
    back = sample(GROUND, 80.0, 8.0, receive_s=89.0)
    assert reasons(old, back) == ['accepted', 'accepted']
    not_far = sample(GROUND, 80.0, 8.0, receive_s=90.0)
    assert reasons(old, not_far) == ['accepted', 'late']


def test_late_s_says_what_is_late() -> None:
    block = [sample(LOG, 100.0, 8.0), sample(GROUND, 93.0, 8.0, receive_s=100.0)]
    assert reasons(*block)[1] == 'late'
    assert reasons(*block, late_s=8.0)[1] == 'accepted'


@pytest.mark.parametrize('channel', [LOG, GROUND, METRES, DEGREES])
def test_motion_that_does_not_change_is_frozen(channel: Channel) -> None:
    # frozen at t = 1..: accepted for frozen_s, then not, until it changes
    samples = [sample(channel, 0.0, [3.0001, 4.0])]
    samples += [sample(channel, t, [3.0, 4.0]) for t in range(1, 20)]
    samples += [sample(channel, t, [3.000001, 4.0]) for t in (20.0, 21.0)]
    found = reasons(*samples, frozen_s=10.0)
    assert found[:12] == ['accepted'] * 12
    assert found[12:20] == ['frozen'] * 8
    assert found[20:] == ['accepted'] * 2


def test_a_position_is_frozen_only_in_both_columns() -> None:
    samples = [sample(METRES, t, [3.0, float(t)]) for t in range(20)]
    assert set(reasons(*samples, frozen_s=10.0)) == {'accepted'}


@pytest.mark.parametrize(
    'channel', [Channel.HEADING, Channel.SHAFT, Channel.RUDDER, Channel.DEPTH]
)
def test_what_may_stand_still_is_not_frozen(channel: Channel) -> None:
    samples = [sample(channel, t, 0.0) for t in range(20)]
    assert set(reasons(*samples, frozen_s=10.0)) == {'accepted'}


def test_strided_and_read_only_blocks_are_taken() -> None:
    block = concatenate([sample(LOG, t, 8.0 + 0.1 * t) for t in range(10)])
    expected = validate(block, Parameters(), LENGTH_M)[::2]
    for part in (block[::2], block[np.arange(0, 10, 2)]):
        for array in (part.channel, part.stamp_ns, part.receive_ns, part.value, part.variance):
            array.flags.writeable = False
        assert np.array_equal(validate(part, Parameters(), LENGTH_M), expected)
