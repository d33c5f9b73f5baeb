# SPDX-License-Identifier: Apache-2.0
"""Holes in sequence numbers, of one publisher and of several."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')

from shipdrag_ros.node.inputs import Sequences


class Graph:
    """Publishers that come and go."""

    def __init__(self, *names: str) -> None:
        self.there = set(names)

    def __call__(self) -> frozenset[str]:
        return frozenset(self.there)


def heard(sequences: Sequences, *numbers: int) -> int:
    for number in numbers:
        sequences.take(number)
    return sequences.lost


def test_every_hole_is_counted_and_what_was_before_is_not() -> None:
    assert heard(Sequences(Graph('a')), 700, 701, 705, 706, 710) == 6


def test_two_publishers_are_two_sequences() -> None:
    assert heard(Sequences(Graph('a', 'b')), 5, 900, 6, 901, 7, 903, 8, 904, 11) == 3


def test_a_publisher_that_comes_later_is_no_hole() -> None:
    graph = Graph('a')
    sequences = Sequences(graph)
    assert heard(sequences, 10, 11) == 0
    graph.there.add('b')
    assert heard(sequences, 400, 12, 401, 13) == 0


def test_a_publisher_that_starts_again_is_no_hole() -> None:
    graph = Graph('a')
    sequences = Sequences(graph)
    assert heard(sequences, 10, 11, 12) == 0
    graph.there = {'b'}
    sequences.look()
    assert heard(sequences, 50, 51, 53) == 1


def test_a_middleware_without_numbers_tells_nothing() -> None:
    sequences = Sequences(Graph('a'))
    sequences.take(None)
    assert not sequences.numbered


@pytest.mark.parametrize('seed', range(8))
def test_the_count_is_exact_however_publishers_interleave(seed: int) -> None:
    rng = np.random.default_rng(seed)
    starts = rng.integers(1, 1000, 3)
    sent = [(int(start) + k, who) for who, start in enumerate(starts) for k in range(60)]
    # at random, but each publisher in its order; the first and last of each arrive
    kept = [
        (number, who)
        for number, who in sent
        if rng.random() > 0.2 or number - starts[who] in (0, 59)
    ]
    queues = [[number for number, by in kept if by == who] for who in range(3)]
    first = [queue.pop(0) for queue in queues]
    sequences = Sequences(Graph('a', 'b', 'c'))
    # all are known before the first hole, as drivers are that run when the node starts
    heard(sequences, *sorted(first))
    while any(queues):
        queue = queues[int(rng.choice([k for k in range(3) if queues[k]]))]
        sequences.take(queue.pop(0))
    assert sequences.lost == len(sent) - len(kept)
