# SPDX-License-Identifier: Apache-2.0
"""Several shafts and pitches in one message, beside the rule written down in Python."""

from __future__ import annotations

import math
import re
import time
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.messages import MalformedMessage, Source, Unreadable, decode, decoding, types
from shipdrag_ros.messages.decoding import decode_batch
from shipdrag_ros.samples import PITCHES, SHAFTS, Block, Channel, concatenate
from tests.messages.conftest import broken, reference

SHAFT = Source('shaft', types.JOINT_STATE)
RUDDER = Source('rudder', types.JOINT_STATE)
POINT = Source('position', types.POINT)
SIDES = {'port': 1, 'starboard': 2, 'stbd': 2, 'centre': 3, 'center': 3}

kinds = st.sampled_from(['shaft', 'pitch', 'Shaft', 'rudder', 'shaf', ''])
rests = st.one_of(
    st.sampled_from(['', '_', 'ä', ' ', '_1', '2', '_3', '4', '_0', '_5', '77', f'_{1:024}']),
    st.sampled_from(['_port', 'Port', '_stbd', '/starboard', '_centre_rpm', '_port_inner']),
    st.sampled_from(['_portal', '_a', '_b']),
)
joint_names = st.lists(st.builds(str.__add__, kinds, rests), max_size=12)
numbers = st.lists(st.floats(), max_size=12)
stamps = st.integers(0, 2**31 * 10**9 - 1)


def places(names: list[str], kind: str) -> tuple[dict[int, int], int]:
    """Return which joint has each place from 1, and how many have none."""
    given: dict[int, int] = {}
    waiting, surplus = [], 0
    for number, name in enumerate(names):
        if not name.lower().startswith(kind):
            continue
        rest = name[len(kind) :].lower()
        digits = re.search(r'[0-9]+$', rest)
        word = re.sub(r'^[^a-z]*', '', rest)
        side = re.match('(port|starboard|stbd|centre|center)(?![a-z])', word)
        place = None
        if digits:
            place = int(digits[0]) or 4
        elif not word:
            place = 1
        elif side:
            place = SIDES[side[1]]
        if place is not None and place > 4:
            surplus += 1
        elif place is None or place in given:
            waiting.append(number)
        else:
            given[place] = number
    for place in range(1, 5):
        if place not in given and waiting:
            given[place] = waiting.pop(0)
    return given, surplus + len(waiting)


def expected(message: Any) -> tuple[list[tuple[int, float]], int]:
    """Return channel and value of each sample of a message, and how many are surplus."""
    found, surplus = [], 0
    for kind, channels, values in (
        ('shaft', SHAFTS, message.velocity),
        ('pitch', PITCHES, message.position),
    ):
        given, beyond = places(list(message.name), kind)
        surplus += beyond
        for place in sorted(given):
            if given[place] < len(values):
                found.append((int(channels[place - 1]), float(values[given[place]])))
    return sorted(found, key=lambda item: item[0]), surplus


def message(
    reference: Any,
    names: list[str],
    velocity: list[float],
    position: list[float] | None = None,
    *,
    stamp_ns: int = 7,
) -> Any:
    return reference.make(
        types.JOINT_STATE,
        header=reference.header(stamp_ns),
        name=names,
        position=np.array(position or [], np.float64),
        velocity=np.array(velocity, np.float64),
        effort=np.empty(0),
    )


def same_bits(one: Block, other: Block) -> bool:
    return all(
        np.ascontiguousarray(getattr(one, name)).tobytes()
        == np.ascontiguousarray(getattr(other, name)).tobytes()
        for name in ('channel', 'stamp_ns', 'receive_ns', 'value', 'variance')
    )


def channels(reference: Any, *names: str) -> dict[str, Channel]:
    """Say which channel each joint of a message becomes."""
    numbers = [float(i) for i in range(len(names))]
    payload = reference.serialize(
        types.JOINT_STATE, message(reference, [*names], numbers, numbers)
    )
    block = decode(SHAFT, [payload], [0]).block
    return {
        names[int(value)]: Channel(code)
        for code, value in zip(block.channel, block.value[:, 0], strict=True)
    }


@pytest.mark.parametrize(
    ('names', 'found'),
    [
        (('shaft',), (1,)),
        (('shaft_1', 'shaft_2'), (1, 2)),
        (('shaft2', 'shaft1'), (2, 1)),
        (('shaft_0', 'shaft_1'), (4, 1)),
        (('shaft_starboard', 'shaft_port'), (2, 1)),
        (('shaft_port', 'shaft_centre', 'shaft_stbd'), (1, 3, 2)),
        (('shaft_port_inner', 'shaft_port_outer', 'shaft_stbd_inner'), (1, 3, 2)),
        (('shaft_fore', 'shaft_aft'), (1, 2)),
        (('shaft_left', 'shaft_1'), (2, 1)),
        (('shaft', 'shaft'), (1, 2)),
    ],
)
def test_place_of_a_joint(names: tuple[str, ...], found: tuple[int, ...]) -> None:
    numbers = [float(i) for i in range(len(names))]
    payload = reference.serialize(types.JOINT_STATE, message(reference, [*names], numbers))
    block = decode(SHAFT, [payload], [0]).block
    by_joint = dict(
        zip(block.value[:, 0].astype(int).tolist(), block.channel.tolist(), strict=True)
    )
    assert [SHAFTS.index(by_joint[i]) + 1 for i in range(len(names))] == list(found)


def test_a_pitch_is_that_of_the_shaft_with_its_name() -> None:
    assert channels(reference, 'pitch_stbd', 'shaft_port', 'pitch_port', 'shaft_stbd') == {
        'shaft_port': Channel.SHAFT,
        'shaft_stbd': Channel.SHAFT_2,
        'pitch_port': Channel.PITCH,
        'pitch_stbd': Channel.PITCH_2,
    }


def test_joints_of_their_own_messages_have_the_same_places() -> None:
    names = ['shaft_0', 'shaft_1', 'shaft_2', 'shaft_3', 'pitch_1']
    together = channels(reference, *names)
    assert {name: channels(reference, name)[name] for name in names} == together
    assert len(set(together.values())) == len(names)


def test_more_than_four_are_counted() -> None:
    names = [f'shaft_{c}' for c in 'abcdef'] + ['shaft_9', 'pitch_12']
    payload = reference.serialize(
        types.JOINT_STATE, message(reference, names, [1.0] * 8, [2.0] * 8)
    )
    decoded = decode(SHAFT, [payload] * 3, [1, 2, 3])
    assert decoded.block.channel.tolist() == [*SHAFTS] * 3
    assert decoded.unreadable == {Unreadable.SURPLUS_JOINT: 3 * (2 + 1 + 1)}


def test_a_pitch_alone_is_read() -> None:
    payload = reference.serialize(types.JOINT_STATE, message(reference, ['pitch'], [], [-0.25]))
    decoded = decode(SHAFT, [payload], [0])
    assert decoded.block.channel.tolist() == [Channel.PITCH]
    assert decoded.block.value.tolist() == [[-0.25, 0.0]]
    assert not decoded.unreadable


@settings(max_examples=150, deadline=None)
@given(
    names=joint_names, velocity=numbers, position=numbers, stamp_ns=stamps, little=st.booleans()
)
def test_samples_of_a_message_are_those_of_the_rule(names, velocity, position, stamp_ns, little):
    sent = message(reference, names, velocity, position, stamp_ns=stamp_ns)
    payload = reference.serialize(types.JOINT_STATE, sent, little_endian=little)
    found, surplus = expected(sent)
    decoded = decode(SHAFT, [payload], [5])
    block = decoded.block
    assert block.channel.tolist() == [code for code, _ in found]
    np.testing.assert_array_equal(block.value[:, 0], [value for _, value in found])
    assert not block.value[:, 1].any()
    assert np.isnan(block.variance).all()
    assert set(block.stamp_ns.tolist()) <= {stamp_ns}
    assert set(block.receive_ns.tolist()) <= {5}
    assert decoded.kept.tolist() == [0] * len(found)
    counts = {Unreadable.NO_JOINT: 1} if not found else {}
    assert decoded.unreadable == counts | ({Unreadable.SURPLUS_JOINT: surplus} if surplus else {})


@settings(max_examples=80, deadline=None)
@given(
    rows=st.lists(
        st.tuples(joint_names, numbers, numbers, st.sampled_from([0, 0, 1, 2, 3]), st.booleans()),
        max_size=20,
    )
)
def test_a_batch_of_several_sources_gives_the_bits_of_single_messages(rows):
    sources = (SHAFT, RUDDER, POINT)
    payloads = []
    for i, (names, velocity, position, number, little) in enumerate(rows):
        if number == 2:
            kind, sent = types.POINT, reference.message(types.POINT, i, 'f', [0.5 * i] * 8)
        else:
            kind = types.JOINT_STATE
            sent = message(reference, names, velocity, position, stamp_ns=i)
        payloads.append(reference.serialize(kind, sent, little_endian=little))
    ends = np.cumsum([0, *map(len, payloads)])
    number = np.array([row[3] for row in rows], np.uint16)
    batch = decode_batch(
        sources,
        number,
        np.frombuffer(b''.join(payloads), np.uint8),
        ends[:-1],
        ends[1:],
        np.arange(len(rows)) + 100,
    )
    # 3: of no source
    heard = [i for i, row in enumerate(rows) if row[3] < 3]
    singles = {i: decode(sources[rows[i][3]], [payloads[i]], [i + 100]) for i in heard}
    assert same_bits(batch.block, concatenate([singles[i].block for i in heard]))
    assert batch.kept.tolist() == [i for i in heard for _ in range(len(singles[i].block))]
    for place, counts in enumerate(batch.unreadable):
        of_it = [singles[i].unreadable for i in heard if rows[i][3] == place]
        assert counts == sum(of_it, type(counts)())


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_broken_bytes_are_malformed_to_both_readers_and_spoil_no_neighbour(data):
    names = data.draw(joint_names)
    good = reference.serialize(
        types.JOINT_STATE,
        message(reference, [*names, 'shaft_2'], [1.0] * (len(names) + 1), data.draw(numbers)),
        little_endian=data.draw(st.booleans()),
    )
    payloads = [good, *broken(data.draw, good, 200), good]
    batch = decode(SHAFT, payloads, np.arange(len(payloads)))
    malformed = 0
    for i, payload in enumerate(payloads):
        try:
            theirs = types.deserialize(types.JOINT_STATE, payload)
        except MalformedMessage:
            malformed += 1
            assert i not in batch.kept
        else:
            values = batch.block.value[batch.kept == i, 0]
            np.testing.assert_array_equal(values, [value for _, value in expected(theirs)[0]])
    assert batch.unreadable[Unreadable.MALFORMED] == malformed


@pytest.mark.parametrize('little', [True, False])
def test_a_giant_length_is_malformed_and_nothing_is_read_beyond(little: bool) -> None:
    order = 'little' if little else 'big'
    sent = message(reference, ['shaft_1', 'shaft_2', 'pitch'], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0])
    good = reference.serialize(types.JOINT_STATE, sent, little_endian=little)
    for at in range(12, len(good) - 3, 4):
        for length in (2**32 - 1, 2**31, 2**29, len(good)):
            giant = good[:at] + length.to_bytes(4, order) + good[at + 4 :]
            # followed by what would be joints and numbers, were it read
            data = np.frombuffer(giant + good * 3, np.uint8)
            decoded = decode_batch(
                (SHAFT,),
                np.zeros(1, np.uint16),
                data,
                np.zeros(1, np.int64),
                np.array([len(giant)]),
                np.zeros(1, np.int64),
            )
            decode(RUDDER, [giant], [0])
            alone = decode(SHAFT, [giant], [0])
            assert decoded.unreadable == (alone.unreadable,)
            assert same_bits(decoded.block, alone.block)
    assert math.isclose(decode(SHAFT, [good], [0]).block.value[1, 0], 2.0)


def test_a_long_name_takes_no_time_and_its_layout_is_not_kept() -> None:
    name = 'shaft' + '0' * 200_000 + 'x'
    payload = reference.serialize(types.JOINT_STATE, message(reference, [name], [1.0]))
    known = len(decoding._known)
    begun_s = time.process_time()
    assert decode(SHAFT, [payload], [0]).block.value[:, 0].tolist() == [1.0]
    assert time.process_time() - begun_s < 2.0
    assert len(decoding._known) == known
