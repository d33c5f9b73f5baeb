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
from shipdrag_ros.coastdown.events import InputCounts
from shipdrag_ros.coastdown.past import CHANNELS, NEVER
from shipdrag_ros.coastdown.ring import FIRST_CAPACITY, RingBuffer
from shipdrag_ros.coastdown.steadiness import Slopes, Steadiness
from shipdrag_ros.coastdown.validate import CheckMemory, Limits
from shipdrag_ros.samples import FURTHER, INPUTS, Channel, Int64, Reason

ALWAYS = 2**62  # a stamp after all stamps
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
    What became of the samples; a reset of the clock spares it.

    Attributes
    ----------
    reasons : (channels, reasons) int64
        Samples by `Reason`.
    clock_ns : (channels,) int64
        Stamp less arrival of the last accepted sample.
    """

    reasons: Int64
    clock_ns: Int64

    @classmethod
    def fresh(cls) -> InputTally:
        """
        Return the counts before the first sample.
        """
        return cls(np.zeros((CHANNELS, len(Reason)), np.int64), np.zeros(CHANNELS, np.int64))

    def counts(self) -> dict[str, InputCounts]:
        """
        Return what became of the samples of every input; of further instruments, of those heard.
        """
        found = {}
        for name in INPUTS:
            channels = [channel for channel in Channel if channel.input == name]
            times = self.reasons[channels].sum(axis=0).tolist()
            if any(times) or name not in FURTHER:
                why = {r.name.lower(): n for r, n in zip(Reason, times, strict=True) if n}
                used = why.pop(Reason.ACCEPTED.name.lower(), 0)
                found[name] = InputCounts(sum(times), used, why)
        return found


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
