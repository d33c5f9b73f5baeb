# SPDX-License-Identifier: Apache-2.0
"""
Samples and blocks: what comes in at the door.

A `Block` is a piece of ONE sequence of samples in arrival order, all inputs
interleaved. Cutting the sequence into other blocks changes nothing downstream.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

Int64 = NDArray[np.int64]
UInt8 = NDArray[np.uint8]
Float64 = NDArray[np.float64]

SECOND_NS = 1_000_000_000
FUTURE_NS = 2_000_000_000  # a stamp this far after its arrival is not a measurement
BACKWARD_JUMP_NS = 10_000_000_000  # a stamp this far back means that the clock was set
SET_BACK = 3  # stamps in a row so far back that make it so: two may be a slip
ABSURD_SPEED_M_S = 40.0  # faster than any displacement ship
ABSURD_POSITION_M = 4.1e7  # farther than once around the Earth


class Channel(IntEnum):
    """
    What a sample measures; the columns of its value are given.

    `POSITION` and `POSITION_GEODETIC` are two encodings of the one input
    `position`: only the window that uses a position knows where to put the
    origin of its plane. The input `shaft` carries up to four shafts, and the
    pitch of each. `..._2` and `..._3` are further instruments of the kind.
    """

    SPEED_THROUGH_WATER = 0  # forward [m/s], unused
    SPEED_OVER_GROUND = 1  # magnitude [m/s], unused
    POSITION = 2  # x, y [m] in a fixed frame
    POSITION_GEODETIC = 3  # latitude, longitude [deg]
    HEADING = 4  # yaw as sent [rad], unused
    SHAFT = 5  # rate of turn [rad/s], negative astern, unused
    RUDDER = 6  # angle [rad], unused
    WIND_APPARENT = 7  # forward, to port [m/s], of the air relative to the ship
    DEPTH = 8  # from the surface [m], unused
    SHAFT_2 = 9  # as SHAFT, of further shafts
    SHAFT_3 = 10
    SHAFT_4 = 11
    PITCH = 12  # of a controllable propeller, ratio or angle, 0 no thrust, unused
    PITCH_2 = 13  # of the propeller of SHAFT_2, and so on
    PITCH_3 = 14
    PITCH_4 = 15
    SPEED_THROUGH_WATER_2 = 16  # as those without a number
    SPEED_THROUGH_WATER_3 = 17
    SPEED_OVER_GROUND_2 = 18
    SPEED_OVER_GROUND_3 = 19
    POSITION_2 = 20
    POSITION_3 = 21
    POSITION_GEODETIC_2 = 22
    POSITION_GEODETIC_3 = 23

    @property
    def kind(self) -> Channel:
        """The channel of the first one of its kind."""
        return Channel[self.name.rstrip('_234')]

    @property
    def input(self) -> str:
        """The name of the input (topic) that carries this channel."""
        if self.kind in (Channel.SHAFT, Channel.PITCH):
            return 'shaft'
        return self.name.lower().replace('_geodetic', '')


SHAFTS = (Channel.SHAFT, Channel.SHAFT_2, Channel.SHAFT_3, Channel.SHAFT_4)
PITCHES = (Channel.PITCH, Channel.PITCH_2, Channel.PITCH_3, Channel.PITCH_4)
"""The pitch of each of `SHAFTS`, in their order."""
INPUTS: tuple[str, ...] = tuple(dict.fromkeys(channel.input for channel in Channel))
MOTION_INPUTS: tuple[str, ...] = ('speed_through_water', 'position', 'speed_over_ground')
GEODETIC: Mapping[Channel, Channel] = {
    each: Channel[each.name.replace('POSITION', 'POSITION_GEODETIC')]
    for each in (Channel.POSITION, Channel.POSITION_2, Channel.POSITION_3)
}
"""The other encoding of each position in metres."""
KIND = np.array([int(channel.kind) for channel in Channel])
"""Of each channel, that of the first one of its kind; for compiled code."""
FURTHER: Mapping[str, str] = {
    channel.input: channel.kind.input for channel in Channel if channel.input != channel.kind.input
}
"""Inputs of further instruments, and the input of the first one of the kind."""


def kind_of(name: str) -> str:
    """
    Return the first input of the kind of one: of `position_2` that is `position`.
    """
    return FURTHER.get(name, name)


ALL_MOTION: tuple[str, ...] = (*MOTION_INPUTS, *FURTHER)
"""Inputs that show how the ship moves, those of further instruments too."""


class Reason(IntEnum):
    """Why a sample was not used; `ACCEPTED` if it was."""

    ACCEPTED = 0
    DUPLICATE = 1
    OUT_OF_ORDER = 2
    LATE = 3
    FUTURE = 4
    NAN = 5
    INFINITE = 6
    ABSURD = 7
    FROZEN = 8
    OUTLIER = 9  # what the readings before it, or its stated variance, make impossible


@dataclass(frozen=True)
class Block:
    """
    Consecutive samples in arrival order.

    Attributes
    ----------
    channel : (n,) uint8
        `Channel` of each sample.
    stamp_ns : (n,) int64
        Time of measurement [ns since the epoch].
    receive_ns : (n,) int64
        Time of arrival, log time in a bag [ns since the epoch].
    value : (n, 2) float64
        See `Channel`; an unused column is 0.
    variance : (n, 2) float64
        Variance of each value, in its unit squared; NaN where unknown.
    """

    channel: UInt8
    stamp_ns: Int64
    receive_ns: Int64
    value: Float64
    variance: Float64

    def __post_init__(self) -> None:
        n = len(self.channel)
        for name, dtype, shape in (
            ('channel', np.uint8, (n,)),
            ('stamp_ns', np.int64, (n,)),
            ('receive_ns', np.int64, (n,)),
            ('value', np.float64, (n, 2)),
            ('variance', np.float64, (n, 2)),
        ):
            array = getattr(self, name)
            if array.dtype != dtype or array.shape != shape:
                raise ValueError(
                    f'{name} is {array.dtype}{array.shape}, expected {np.dtype(dtype)}{shape}'
                )

    def __len__(self) -> int:
        return len(self.channel)

    def __getitem__(self, part: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Block:
        return Block(*(getattr(self, field.name)[part] for field in fields(self)))

    @classmethod
    def empty(cls) -> Block:
        """
        Return a block without samples.
        """
        return cls.of(Channel.SPEED_THROUGH_WATER, [], [])

    @classmethod
    def of_samples(cls, samples: Sequence[tuple[int, int, int, float, float]]) -> Block:
        """
        Build a block of single samples.

        Parameters
        ----------
        samples
            Channel, stamp and arrival [ns], and two values each; the variances
            are unknown.
        """
        if not samples:
            return cls.empty()
        channel, stamp_ns, receive_ns, a, b = zip(*samples, strict=True)
        value = np.array([a, b], np.float64).T
        return cls(
            np.array(channel, np.uint8),
            np.array(stamp_ns, np.int64),
            np.array(receive_ns, np.int64),
            np.ascontiguousarray(value),
            np.full(value.shape, np.nan),
        )

    @classmethod
    def of(
        cls,
        channel: Channel,
        stamp_ns: ArrayLike,
        value: ArrayLike,
        *,
        receive_ns: ArrayLike | None = None,
        variance: ArrayLike = np.nan,
    ) -> Block:
        """
        Build a block of one channel.

        Parameters
        ----------
        channel
            What is measured.
        stamp_ns : (n,) integers
            Time of measurement [ns].
        value : (n,) or (n, 2)
            See `Channel`.
        receive_ns : (n,) integers, optional
            Time of arrival [ns]; the stamps where it is not given.
        variance : scalar, (n,) or (n, 2)
            Variance of the value; NaN where unknown.

        Returns
        -------
        Block
            Of n samples, in the order given.

        Raises
        ------
        ValueError
            If the sizes differ.

        Notes
        -----
        Source: docs/architecture.md, one sequence of samples in arrival order.

        Examples
        --------
        >>> from shipdrag_ros.samples import Block, Channel
        >>> block = Block.of(Channel.SPEED_THROUGH_WATER, [0, 1_000_000_000], [6.0, 5.9])
        >>> len(block)
        2
        """
        stamps = np.atleast_1d(np.asarray(stamp_ns, np.int64))
        received = stamps if receive_ns is None else np.asarray(receive_ns, np.int64)
        n = len(stamps)

        def two_columns(data: ArrayLike, fill: float) -> Float64:
            array = np.asarray(data, np.float64)
            if array.ndim == 2:
                return np.ascontiguousarray(np.broadcast_to(array, (n, 2)))
            columns = np.full((n, 2), fill)
            columns[:, 0] = array
            return columns

        return cls(
            np.full(n, channel, np.uint8),
            stamps,
            np.array(np.broadcast_to(received, (n,))),
            two_columns(value, 0.0),
            two_columns(variance, np.nan),
        )


def concatenate(blocks: Sequence[Block]) -> Block:
    """
    Join blocks, in the order given.
    """
    if not blocks:
        return Block.empty()
    if len(blocks) == 1:
        return blocks[0]
    return Block(
        *(
            np.concatenate([getattr(block, field.name) for block in blocks])
            for field in fields(Block)
        )
    )


def in_arrival_order(blocks: Sequence[Block]) -> Block:
    """
    Join blocks and sort by receive time; ties keep the order given.
    """
    joined = concatenate(blocks)
    return joined[np.argsort(joined.receive_ns, kind='stable')]
