# SPDX-License-Identifier: Apache-2.0
"""
The outputs in a bag against the replayed ones, byte by byte.

Both are read in step, so that little is held however long the bag is.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.messages import MalformedMessage, OutputMessage, types
from shipdrag_ros.messages.topics import (
    FORECAST,
    FORECAST_PATH,
    RESISTANCE,
    RESISTANCE_CURVE,
    SPEED,
)
from shipdrag_ros.samples import Float64

COMPARED = (SPEED, RESISTANCE, RESISTANCE_CURVE, FORECAST, FORECAST_PATH)


@dataclass
class Recorded:
    """
    The bag's own outputs against the replayed ones.

    Attributes
    ----------
    compared
        Messages that are in the bag, or should be.
    identical
        Of these, those that the replay gave to the last bit.
    beside
        Of these, those that both have.
    first_difference
        Topic, stamp and both contents; None if all are identical.
    largest_difference
        Of a figure, in parts of the larger of the two; infinite where a
        message is missing or of another shape, 0 if all are identical.
    largest_difference_sigma
        Of an estimate, in the larger of its two standard deviations; of messages that both
        have, and points of the curve at the same speed.
    by
        Version of this package that recorded the bag; None if that is not known.
    """

    compared: int = 0
    identical: int = 0
    first_difference: str | None = None
    largest_difference: float = 0.0
    largest_difference_sigma: float = 0.0
    by: str | None = None
    beside: int = 0


class Comparison:
    """
    Compares topic by topic, in order.

    Parameters
    ----------
    recorded
        Outputs as recorded, in order of arrival.
    by
        Version that recorded them.

    Notes
    -----
    A recording that began when the node had been running for a while lacks
    what was published before; one that was stopped lacks what came after. What
    the replay gives before the first and after the last recorded message of a
    topic is therefore no difference.
    """

    def __init__(self, recorded: Iterator[OutputMessage], *, by: str | None = None) -> None:
        self._recorded = recorded
        self._found = Recorded(by=by)
        self._queues: dict[str, deque[OutputMessage]] = {topic.name: deque() for topic in COMPARED}
        self._begun: set[str] = set()

    def add(self, replayed: OutputMessage) -> None:
        """
        Take the next message of the replay.
        """
        name = _name(replayed)
        queue = self._queues.get(name)
        if queue is None:
            return
        while True:
            while not queue and self._read_one():
                pass
            if not queue:
                return
            if queue[0].stamp_ns >= replayed.stamp_ns:
                break
            self._differ(queue.popleft(), None)
        if queue[0].stamp_ns == replayed.stamp_ns:
            self._begun.add(name)
            self._compare(queue.popleft(), replayed)
        elif name in self._begun:
            self._differ(None, replayed)

    def finish(self) -> Recorded:
        """
        Take note that the replay has ended, and return what was found.
        """
        while self._read_one():
            pass
        for queue in self._queues.values():
            for message in queue:
                self._differ(message, None)
            queue.clear()
        return self._found

    def _read_one(self) -> bool:
        """Put one more recorded message into its queue; False behind the last."""
        message = next(self._recorded, None)
        if message is None:
            return False
        if _name(message) in self._queues:
            self._queues[_name(message)].append(message)
        return True

    def _compare(self, recorded: OutputMessage, replayed: OutputMessage) -> None:
        self._found.beside += 1
        if recorded.payload != replayed.payload:
            self._differ(recorded, replayed)
        else:
            self._found.compared += 1
            self._found.identical += 1

    def _differ(self, recorded: OutputMessage | None, replayed: OutputMessage | None) -> None:
        found = self._found
        found.compared += 1
        difference, sigmas = _relative_difference(recorded, replayed), _sigmas(recorded, replayed)
        found.largest_difference = max(found.largest_difference, difference)
        found.largest_difference_sigma = max(found.largest_difference_sigma, sigmas)
        message = recorded or replayed
        if found.first_difference is None and message is not None:
            found.first_difference = (
                f'{message.topic} at {message.stamp_ns} ns: recorded {_read(recorded)[1]}, '
                f'replayed {_read(replayed)[1]}'
            )


def _name(message: OutputMessage) -> str:
    return message.topic.rpartition('/')[2]


def _relative_difference(one: OutputMessage | None, other: OutputMessage | None) -> float:
    """Return the largest of all figures of two messages, in parts of the larger figure."""
    first, second = _read(one)[0], _read(other)[0]
    if len(first) != len(second) or not len(first):
        return math.inf
    scale = np.maximum(np.abs(first), np.abs(second))
    differs = (first != second) & ~(np.isnan(first) & np.isnan(second))
    return float(np.max(np.abs(first - second)[differs] / scale[differs], initial=0.0))


def _read(message: OutputMessage | None) -> tuple[Float64, str]:
    """Return the figures of a message, and describe it so that it can be known from another."""
    none = np.empty(0)
    if message is None:
        return none, 'nothing'
    try:
        content = types.deserialize(message.type, message.payload)
    except MalformedMessage:
        return none, f'{len(message.payload)} bytes that are no {message.type}'
    match message.type:
        case SPEED.type:
            value, variance = content.twist.twist.linear.x, content.twist.covariance[0]
            return np.array([value, variance]), f'{value!r} m/s (variance {variance})'
        case RESISTANCE.type:
            value, variance = content.accel.accel.linear.x, content.accel.covariance[0]
            return np.array([value, variance]), f'{value!r} m/s^2 (variance {variance})'
        case FORECAST_PATH.type:
            places = [each.pose.position for each in content.poses]
            axes = np.array([axis for place in places for axis in (place.x, place.y)])
            return axes, f'{len(places)} positions'
        case _:
            text = f'{content.width} points (sum of bytes {np.sum(content.data, dtype=np.int64)})'
            whole = content.data.nbytes % 8 == 0
            return np.frombuffer(content.data.tobytes(), '<f8') if whole else none, text


def _sigmas(one: OutputMessage | None, other: OutputMessage | None) -> float:
    """Return the largest difference of two estimates in the larger standard deviation."""
    first, second = _estimates(one), _estimates(other)
    same = sorted(first.keys() & second.keys())
    pairs = np.array([(*first[key], *second[key]) for key in same]).reshape(-1, 4)
    apart, sigma = np.abs(pairs[:, 0] - pairs[:, 2]), np.fmax(pairs[:, 1], pairs[:, 3])
    known = (apart > 0.0) & (sigma > 0.0)
    return float(np.max(apart[known] / sigma[known], initial=0.0))


def _estimates(message: OutputMessage | None) -> dict[float, tuple[float, float]]:
    """Return value and standard deviation of an output; of a curve, by speed."""
    figures, _ = _read(message)
    if message is not None and message.type == RESISTANCE_CURVE.type:
        table = figures[: len(figures) // 4 * 4].reshape(-1, 4).tolist()
        return {speed: (value, sigma) for speed, value, sigma, _ in table}
    return {0.0: (figures[0], math.sqrt(max(figures[1], 0.0)))} if len(figures) == 2 else {}
