# SPDX-License-Identifier: Apache-2.0
"""What became of a table, in words."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shipdrag_ros import display
from shipdrag_ros.sources.log import Rejected, Understood


@dataclass(frozen=True)
class TableResult:
    """
    What became of a table.

    Attributes
    ----------
    rows
        Below the header.
    left_out
        Rows that `where` does not choose.
    written
        Samples by input; pitches are of `shaft`.
    rejected
        By input, or 'time' for a whole row, and reason.
    start_ns, end_ns
        First and last time written [ns].
    base_ns
        What was added to the times of the table [ns]; None if they are dates.
    backward
        Rows whose time is before that of an earlier row; a replay rejects
        them and says so.
    repeated
        Rows whose time is that of the newest row before; a replay rejects them
        too.
    delimiter
        That of the table.
    header
        Whether the table has one.
    understood
        What each input was taken from.
    notes
        What is to be known of it, a sentence each.
    not_used
        Columns that nothing is taken from.
    """

    rows: int
    left_out: int
    written: dict[str, int]
    rejected: dict[str, dict[str, Rejected]]
    start_ns: int
    end_ns: int
    base_ns: int | None
    backward: int
    repeated: int
    delimiter: str
    header: bool
    understood: tuple[Understood, ...]
    notes: tuple[str, ...]
    not_used: tuple[str, ...]

    def summary(self, bag: Path) -> list[str]:
        """
        Say how much was read, and what is to be known of it.
        """
        length_s = (self.end_ns - self.start_ns) * 1e-9
        lines = [
            f'{bag}: {sum(self.written.values())} messages of {self.rows - self.left_out} rows, '
            f'{display.duration(length_s)}, from {display.utc(self.start_ns)}'
        ]
        if self.base_ns is not None:
            lines.append(
                f'The times count from a start; it was put at {display.utc(self.base_ns)}.'
            )
        lines += self.notes
        if self.left_out:
            lines.append(f'{self.left_out} rows were not chosen by --where.')
        if self.backward:
            lines.append(
                f'In {self.backward} rows the time is before that of an earlier row; a replay '
                'rejects those.'
            )
        if self.repeated:
            lines.append(
                f'In {self.repeated} rows the time is that of an earlier row; a replay rejects '
                'those.'
            )
        return lines

    def table(self) -> display.Table:
        """
        Return messages by input.
        """
        return display.Table(
            ('input', 'messages'), tuple((name, f'{n}') for name, n in self.written.items())
        )

    def details(self) -> list[str]:
        """
        Say what was not used, and why.
        """
        lines = [
            f'{name}: {rejected.count} cell(s) rejected, {reason}: {", ".join(rejected.first)}'
            for name, reasons in self.rejected.items()
            for reason, rejected in reasons.items()
        ]
        if self.not_used:
            lines.append(f'Columns not used: {", ".join(map(repr, self.not_used))}')
        return lines
