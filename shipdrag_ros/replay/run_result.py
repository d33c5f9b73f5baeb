# SPDX-License-Identifier: Apache-2.0
"""
What one bag gave, as the page, the terminal and the JSON show it.

Also the true curve of a simulation, as its bag carries it in `truth.yaml`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros import strict_yaml
from shipdrag_ros.coastdown.events import NotCoastdown
from shipdrag_ros.display import Table, short_repr
from shipdrag_ros.errors import BagError
from shipdrag_ros.replay import ReplayResult
from shipdrag_ros.replay.coasts import why_no_coastdown
from shipdrag_ros.replay.words import run_warnings
from shipdrag_ros.samples import Float64

ATTACHMENT = 'truth.yaml'
_READ_AGAIN = 2_000_000  # messages: all their samples are held at once


@dataclass(frozen=True)
class TrueCurve:
    """
    Specific resistance that the simulation used, ascending in speed.

    Attributes
    ----------
    speed_m_s : (m,)
    resistance_m_s2 : (m,)
        r = R / m, retarding positive [m/s^2 = N/kg].
    settings
        What the simulation was asked for, names carrying their units.
    """

    __repr__ = short_repr

    speed_m_s: Float64
    resistance_m_s2: Float64
    settings: Mapping[str, Any]

    def at(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return r at these speeds [m/s^2]; NaN outside the curve.
        """
        return np.interp(
            np.asarray(speed_m_s, np.float64),
            self.speed_m_s,
            self.resistance_m_s2,
            left=np.nan,
            right=np.nan,
        )

    def to_yaml(self) -> str:
        """
        Return the text that `from_yaml` reads back, digit for digit.
        """
        return strict_yaml.dump(
            {
                'settings': dict(self.settings),
                'speed_m_s': self.speed_m_s.tolist(),
                'resistance_m_s2': self.resistance_m_s2.tolist(),
            },
        )

    @classmethod
    def from_yaml(cls, text: str, *, subject: str) -> TrueCurve:
        """
        Read the text of a `truth.yaml`.

        Raises
        ------
        BagError
            If it is not one.
        """
        try:
            values = strict_yaml.load(text)
            speed = np.array(values['speed_m_s'], np.float64)
            resistance = np.array(values['resistance_m_s2'], np.float64)
            settings = dict(values['settings'])
        except (KeyError, TypeError, ValueError) as error:
            raise BagError(
                f'{subject}: {ATTACHMENT} cannot be read ({error}); '
                'write the bag anew with `shipdrag simulate`'
            ) from error
        if speed.ndim != 1 or speed.shape != resistance.shape or not np.all(np.diff(speed) > 0):
            raise BagError(
                f'{subject}: {ATTACHMENT} has {speed.shape} speeds and {resistance.shape} '
                'resistances, expected as many of each, the speeds ascending'
            )
        return cls(speed, resistance, settings)


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
