# SPDX-License-Identifier: Apache-2.0
"""What one bag gave, as the page, the terminal and the JSON show it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from shipdrag_ros.coastdown.events import EndedCoastdown, NotCoastdown
from shipdrag_ros.display import Table, short_repr
from shipdrag_ros.replay import InputCounts, Recorded, ReplayResult
from shipdrag_ros.replay.no_coastdown import why_no_coastdown
from shipdrag_ros.replay.truth import ATTACHMENT, TrueCurve
from shipdrag_ros.replay.words import run_warnings
from shipdrag_ros.ship import Ship

_READ_AGAIN = 2_000_000  # messages: all their samples are held at once


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
    warnings
        What is wrong with the run, a sentence each.
    truth
        The true curve, where the record is simulated.
    span_ns
        First and last time of arrival in the bag [ns]; None where it is empty.
    not_coastdowns
        What was nearly a coastdown, and what was cut, with why.
    steady_lead_s
        The longest that the ship was steady; None where no coastdown was looked for.
    why_none
        What the speed did where nothing was even nearly a coastdown; '' where there is
        something.
    """

    __repr__ = short_repr

    bag: str
    ship: Ship
    coastdowns: tuple[EndedCoastdown, ...]
    inputs: Mapping[str, InputCounts]
    recorded: Recorded
    warnings: tuple[str, ...] = ()
    truth: TrueCurve | None = None
    span_ns: tuple[int, int] | None = None
    not_coastdowns: tuple[NotCoastdown, ...] = ()
    steady_lead_s: float | None = None
    why_none: str = ''
    replayed: ReplayResult | None = field(default=None, repr=False)

    @property
    def dismissed(self) -> tuple[NotCoastdown, ...]:
        """What is no coastdown, without what is named as cut off one."""
        cuts = [cut for coastdown in self.coastdowns for cut in coastdown.cuts]
        return tuple(one for one in self.not_coastdowns if one not in cuts)

    def summary(self) -> tuple[str, ...]:
        """
        Say what each coastdown gave, or why there is none.

        Returns
        -------
        tuple of str
            A paragraph each, the engineer's units first.
        """
        from shipdrag_ros.replay import words  # it shows what this module holds

        if not self.coastdowns:
            dismissed = len(self.not_coastdowns)
            return (words.no_coastdown_sentence(self.steady_lead_s, dismissed, self.why_none),)
        return tuple(line for part in self.coastdowns for line in words.summary(part, self.ship))

    def table(self) -> Table:
        """
        Show the coastdowns, a line each.
        """
        from shipdrag_ros.replay import tables

        return tables.coastdowns_table([self])

    @classmethod
    def of(cls, result: ReplayResult) -> RunResult:
        """
        Take what a replay gave, and the truth if the bag holds it.

        Raises
        ------
        BagError
            If the truth in the bag cannot be read.
        """
        run = result.run
        text = run.attachments.get(ATTACHMENT)
        return cls(
            bag=run.name,
            ship=result.ship,
            coastdowns=result.coastdowns,
            inputs=result.inputs,
            recorded=result.recorded,
            warnings=run_warnings(result),
            truth=None if text is None else TrueCurve.from_yaml(text, subject=run.name),
            span_ns=run.span_ns,
            not_coastdowns=result.not_coastdowns,
            steady_lead_s=result.steady_lead_s,
            why_none=_why_none(result),
            replayed=result,
        )


def _why_none(result: ReplayResult) -> str:
    """Say what the speed did, where that is not said by anything else."""
    messages = sum(counts.messages for counts in result.inputs.values())
    if result.coastdowns or result.not_coastdowns:
        return ''
    if messages > _READ_AGAIN:
        return (
            f'nothing in it looked like one; what the speed did was not looked at, as {messages} '
            'messages are too many to be read twice: give a part of it, BAG@START:END'
        )
    return why_no_coastdown(result)
