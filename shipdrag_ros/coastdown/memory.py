# SPDX-License-Identifier: Apache-2.0
"""
All that a monitor remembers, in arrays that compiled code writes to.

One tuple, so that a reset is a new one; apart from the walk, so that what only
reads it need not compile the walk.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.bins import Bins
from shipdrag_ros.coastdown.past import CHANNELS, NEVER
from shipdrag_ros.coastdown.ring import RingBuffer, first_store
from shipdrag_ros.coastdown.steadiness import Slopes, Steadiness
from shipdrag_ros.coastdown.validate import CheckMemory, Limits
from shipdrag_ros.samples import Float64, Int64, Reason

ALWAYS = 2**62  # a stamp after all stamps
RECENT = 16  # samples of each channel that its rate and clock offset are taken from


class Watch(NamedTuple):
    """
    What the walk looks out for, and what it saw; arrays of one but for those with a shape.

    Attributes
    ----------
    source : int64
        The speed source that the regimes follow; NEVER while they sleep.
    update_ns : int64
        When the next estimate is due; ALWAYS if none is.
    armed : int64
        0 after the regimes were awake until the speed has been steady again.
    seen_source, seen : int64
        Speed source and number of the bin looked at last.
    level : float64
        Speed there [m/s].
    lead : (2,) int64
        Since which bin the ship has been steady, NEVER if it is not; the longest that it was
        [bins].
    look : int64
        The bin at whose first sample log and track are compared next.
    doubted : (channels,) int64
        Bin up to which each source is not used: another contradicts it.
    """

    source: Int64
    update_ns: Int64
    armed: Int64
    seen_source: Int64
    seen: Int64
    level: Float64
    lead: Int64
    look: Int64
    doubted: Int64

    @classmethod
    def fresh(cls) -> Watch:
        """
        Return the watch of a monitor that knows nothing.
        """
        return cls(
            np.full(1, NEVER),
            np.full(1, ALWAYS),
            np.ones(1, np.int64),
            np.full(1, NEVER),
            np.full(1, NEVER),
            np.full(1, np.nan),
            np.array([NEVER, 0]),
            np.full(1, NEVER),
            np.full(CHANNELS, NEVER),
        )


class InputTally(NamedTuple):
    """
    What the health of the inputs is known from; a reset of the clock spares it.

    Attributes
    ----------
    reasons : (channels, reasons) int64
        Samples by `Reason`.
    stamp_ns, arrival_ns : (channels, RECENT) int64
        Of the last accepted samples.
    """

    reasons: Int64
    stamp_ns: Int64
    arrival_ns: Int64

    @classmethod
    def fresh(cls) -> InputTally:
        """
        Return the counts before the first sample.
        """
        return cls(
            np.zeros((CHANNELS, len(Reason)), np.int64),
            np.full((CHANNELS, RECENT), NEVER),
            np.full((CHANNELS, RECENT), NEVER),
        )


class Memory(NamedTuple):
    """All that a monitor remembers, besides a coastdown that runs."""

    guard: CheckMemory
    bins: Bins
    steadiness: Steadiness
    watch: Watch
    tally: InputTally
    store: RingBuffer

    @classmethod
    def fresh(cls, slopes: Slopes, *, seconds: int, tally: InputTally) -> Memory:
        """
        Return the memory before the first sample, with bins for the last `seconds`.
        """
        return cls(
            CheckMemory.fresh(),
            Bins.fresh(seconds),
            Steadiness.fresh(slopes),
            Watch.fresh(),
            tally,
            first_store(),
        )


class Tuning(NamedTuple):
    """
    What the walk needs of ship and parameters.

    Attributes
    ----------
    limits, slopes
        Of the tests and of the slopes.
    data_stop_ns
        Silence that stops a source [ns].
    speed_min
        Speed below which nothing starts [m/s].
    """

    limits: Limits
    slopes: Slopes
    data_stop_ns: int
    speed_min: float
