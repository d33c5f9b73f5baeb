# SPDX-License-Identifier: Apache-2.0
"""Rows of measurements: which input each is of, when, and what it reads."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.samples import FURTHER, Float64, Int64


class Input(IntEnum):
    """A kind of input of motion; its number is the code of the rows of the first of the kind."""

    SPEED_THROUGH_WATER = 0
    SPEED_OVER_GROUND = 1
    POSITION = 2

    @property
    def key(self) -> str:
        """Its name in a window, in parameters and in results."""
        return self.name.lower()


# the same as plain integers, for compiled code
LOG = int(Input.SPEED_THROUGH_WATER)
OVER_GROUND = int(Input.SPEED_OVER_GROUND)
POSITION = int(Input.POSITION)
KIND_COUNT = len(Input)
CODES = {input_.key: int(input_) for input_ in Input} | {
    name: int(Input[kind.upper()]) + KIND_COUNT * (int(name[-1]) - 1)
    for name, kind in FURTHER.items()
}
"""Of the rows of each instrument: its kind, and `KIND_COUNT` times how many are before it."""


class Rows(NamedTuple):
    """
    Measurements in ascending time.

    Attributes
    ----------
    time_s : (n,)
        After the engine stop, as far as that is known, or of the record.
    kind : (n,)
        Of `CODES`; LOG, OVER_GROUND or POSITION modulo `KIND_COUNT`.
    value : (n,)
        [m/s], or the distance along the track [m].
    """

    time_s: Float64
    kind: Int64
    value: Float64

    def of(self, kind: int) -> NDArray[np.bool_]:
        """
        Say which rows are of a kind, of any instrument.
        """
        result: NDArray[np.bool_] = self.kind % KIND_COUNT == kind
        return result


def bin_means(time_s: Float64, value: Float64, edges: Float64) -> tuple[Float64, Float64, Int64]:
    """
    Average samples over bins; a bin without any is left out.

    Parameters
    ----------
    time_s : (n,)
        In any order, n >= 1.
    value : (n, ...)
    edges : (b,)
        Ascending.

    Returns
    -------
    time_s, value, count : (k,), (k, ...), (k,)
    """
    order = np.argsort(time_s, kind='stable')
    cell = np.searchsorted(edges, time_s[order])
    first = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
    count = np.diff(np.concatenate([first, [len(order)]]))
    total = np.add.reduceat(value[order], first, axis=0)
    mean = (total.T / count).T
    return np.add.reduceat(time_s[order], first) / count, mean, count


MAD_TO_SD = 1.482602218505602
"""Standard deviation of normal noise over the median of its size."""
OUTLIER = 5.0
"""Robust standard deviations, from which a reading is none of what is looked at."""
