# SPDX-License-Identifier: Apache-2.0
"""Runs of which a part is taken."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from shipdrag_ros.bags import Run
from shipdrag_ros.errors import BagError

WindowSpan = tuple[float, float]


class WindowedRun(NamedTuple):
    """A run, and the window of it that was given, [s] from its start."""

    run: Run
    window: WindowSpan | None


def refuse_overlaps(runs: Sequence[WindowedRun]) -> None:
    """
    Refuse windows of one bag that overlap: what they share would count twice.

    Raises
    ------
    BagError
        If two runs hold the same part of a recording.
    """
    for number, one in enumerate(runs):
        for other in runs[:number]:
            if set(one.run.paths).isdisjoint(other.run.paths):
                continue
            first, second = (each.window or (0.0, math.inf) for each in (other, one))
            if first[0] < second[1] and second[0] < first[1]:
                raise BagError(
                    f'{one.run.name!r} is given twice, {_told(first)} and {_told(second)}: they '
                    'share a part, which is one run and not two; give windows that do not overlap'
                )


def _told(window: WindowSpan) -> str:
    return 'whole' if math.isinf(window[1]) else f'{window[0]:g} to {window[1]:g} s'
