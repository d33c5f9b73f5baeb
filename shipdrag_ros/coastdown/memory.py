# SPDX-License-Identifier: Apache-2.0
"""
All that a monitor remembers, in arrays that compiled code writes to.

One tuple, so that a reset is a new one; apart from the walk, so that what only
reads it need not compile the walk.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.coastdown.bins import Bins
from shipdrag_ros.coastdown.past import CHANNELS, NEVER
from shipdrag_ros.coastdown.ring import FIRST_CAPACITY, RingBuffer
from shipdrag_ros.coastdown.steadiness import Slopes, Steadiness
from shipdrag_ros.coastdown.validate import CheckMemory, Limits
from shipdrag_ros.samples import Int64, Reason

ALWAYS = 2**62  # a stamp after all stamps
RECENT = 16  # samples of each channel that its rate and clock offset are taken from


WATCH = np.dtype(
    [
        ('source', 'i8'),  # that the regimes follow; NEVER while they sleep
        ('update_ns', 'i8'),  # when the next estimate is due; ALWAYS if none is
        ('armed', 'i8'),  # 0 after the regimes were awake until the speed has been steady again
        ('seen_source', 'i8'),  # speed source looked at last
        ('seen', 'i8'),  # and number of its bin
        ('level', 'f8'),  # speed there [m/s]
        ('steady_since', 'i8'),  # bin; NEVER if she is not
        ('steady_most', 'i8'),  # the longest that she was [bins]
        ('silent_ns', 'i8'),  # when the source watched was found silent last; NEVER if it was not
        ('look', 'i8'),  # bin at whose first sample log and track are compared next
        ('doubted', 'i8', (CHANNELS,)),  # up to which each source is not used: another contradicts
    ],
    align=True,
)
"""What the walk looks out for, and what it saw."""


def fresh_watch() -> NDArray[np.void]:
    """
    Return the watch of a monitor that knows nothing.
    """
    watch = np.zeros(1, np.dtype((np.record, WATCH)))
    made = watch[0]
    made.source = made.seen_source = made.seen = made.steady_since = made.look = NEVER
    made.silent_ns = NEVER
    made.doubted[:] = NEVER
    made.update_ns, made.armed, made.level = ALWAYS, 1, np.nan
    return watch


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
    watch: NDArray[np.void]
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
            fresh_watch(),
            tally,
            RingBuffer.fresh(FIRST_CAPACITY),
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
