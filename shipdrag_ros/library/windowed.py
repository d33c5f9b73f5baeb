# SPDX-License-Identifier: Apache-2.0
"""Runs of which a part is taken."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from shipdrag_ros.bags import Run
from shipdrag_ros.errors import BagError
from shipdrag_ros.replay.playback import SHIP_FILE
from shipdrag_ros.ship import Ship

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
                    f'{one.run.name!r} is given twice, {_text(first)} and {_text(second)}: they '
                    'share a part, which is one run and not two; give windows that do not overlap'
                )


def refuse_two_ships(runs: Iterable[tuple[Run, Ship | None]]) -> None:
    """
    Refuse runs that name different ships; one without a name may be any.

    Parameters
    ----------
    runs
        Each with the ship that was given for it; None: the one attached.

    Raises
    ------
    BagError
        If two names are found.
    """
    named: dict[str, str] = {}
    for run, given in runs:
        text = run.attachments.get(SHIP_FILE)
        if given is None and text is not None:
            given = Ship.from_yaml(text, subject=f'{run.name}: {SHIP_FILE}')
        if given is not None and given.name:
            named.setdefault(given.name, run.name)
    if len(named) > 1:
        (one, first), (other, second), *_ = named.items()
        raise BagError(
            f'{first!r} is of {one!r} and {second!r} of {other!r}; take the runs of each ship by '
            'themselves, or say which ship it is with --ship FILE'
        )


def _text(window: WindowSpan) -> str:
    return 'whole' if math.isinf(window[1]) else f'{window[0]:g} to {window[1]:g} s'
