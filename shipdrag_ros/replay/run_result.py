# SPDX-License-Identifier: Apache-2.0
"""What one bag gave, as the page, the terminal and the JSON show it."""

from __future__ import annotations

from dataclasses import dataclass

from shipdrag_ros.coastdown.events import NotCoastdown
from shipdrag_ros.display import Table, short_repr
from shipdrag_ros.replay import ReplayResult
from shipdrag_ros.replay.no_coastdown import why_no_coastdown
from shipdrag_ros.replay.truth import ATTACHMENT, TrueCurve
from shipdrag_ros.replay.words import run_warnings

_READ_AGAIN = 2_000_000  # messages: all their samples are held at once


@dataclass(frozen=True)
class RunResult(ReplayResult):
    """
    What a run gave, with what is said of it.

    Attributes
    ----------
    warnings
        What is wrong with the run, a sentence each.
    truth
        The true curve, where the record is simulated.
    why_none
        What the speed did where nothing was even nearly a coastdown; '' where there is
        something.
    """

    __repr__ = short_repr

    warnings: tuple[str, ...] = ()
    truth: TrueCurve | None = None
    why_none: str = ''

    @property
    def bag(self) -> str:
        """Name of the bag, as the user gave it."""
        return self.run.name

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
        text = result.run.attachments.get(ATTACHMENT)
        return cls(
            **vars(result),
            warnings=run_warnings(result),
            truth=None if text is None else TrueCurve.from_yaml(text, subject=result.run.name),
            why_none=_why_none(result),
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
