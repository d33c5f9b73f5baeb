# SPDX-License-Identifier: Apache-2.0
"""The coastdowns of one ship, from all bags, as one result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.reciprocal import Combined, combine
from shipdrag_ros.replay.run_result import RunResult


@dataclass(frozen=True)
class Together:
    """
    Several coastdowns together.

    Attributes
    ----------
    combined
        Their one r(v); None where there is none.
    why_not
        Why there is none; empty where there was nothing to combine.
    """

    combined: Combined | None
    why_not: str = ''


def together(runs: Sequence[RunResult]) -> Together:
    """
    Combine all coastdowns that gave an estimate, if they are of one ship.
    """
    found = [
        (coastdown.estimate, coastdown.heading_rad)
        for run in runs
        for coastdown in run.coastdowns
        if coastdown.estimate is not None
    ]
    if len(found) < 2:
        return Together(None)
    if len({run.ship for run in runs}) > 1:
        return Together(None, 'the bags are of different ships, so nothing is combined')
    twice = _twice(runs)
    if twice:
        return Together(None, f'windows of {twice!r} overlap, and what they share is one run')
    try:
        return Together(combine([part[0] for part in found], [part[1] for part in found]))
    except EstimationError as error:
        return Together(None, str(error))


def _twice(runs: Sequence[RunResult]) -> str:
    """Return a bag of which two windows share a part; '' for none."""
    seen: list[tuple[str, int, int]] = []
    for run in runs:
        for each in run.coastdowns:
            if each.estimate is None:
                continue
            for bag, start_ns, end_ns in seen:
                if bag == run.bag and each.start_ns < end_ns and start_ns < each.end_ns:
                    return bag
            seen.append((run.bag, each.start_ns, each.end_ns))
    return ''
