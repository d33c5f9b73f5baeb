# SPDX-License-Identifier: Apache-2.0
"""What one bag gave: the input of a page, of the terminal and of the JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from shipdrag_ros.coastdown.events import Coastdown
from shipdrag_ros.report.truth import TrueCurve
from shipdrag_ros.ship import Ship


@dataclass(frozen=True)
class InputCounts:
    """Messages of one input: how many came, were used, and were rejected why."""

    messages: int
    used: int
    rejected: Mapping[str, int]


@dataclass(frozen=True)
class Recorded:
    """The bag's own outputs against the replayed ones."""

    compared: int
    identical: int
    first_difference: str | None


@dataclass(frozen=True)
class RunResult:
    """
    Everything one run gave.

    Attributes
    ----------
    bag
        Name of the bag, as the user gave it.
    ship
        The ship that was used.
    coastdowns
        In the order of their start.
    inputs
        Messages counted, by input.
    recorded
        Comparison with the outputs in the bag.
    truth
        The true curve, where the record is simulated.
    """

    bag: str
    ship: Ship
    coastdowns: tuple[Coastdown, ...]
    inputs: Mapping[str, InputCounts]
    recorded: Recorded
    truth: TrueCurve | None = None
