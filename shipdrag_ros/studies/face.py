# SPDX-License-Identifier: Apache-2.0
"""The face that the studies share: one result on the terminal and on a page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Section, Table
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Presentation:
    """
    A result as its verb prints it and its page shows it.

    Attributes
    ----------
    title
        Of the page.
    sentence
        What was found.
    sections
        With their headings, without pictures.
    pictures
        Heading of the section, figure and caption of each; drawn one by one, for a page alone.
    source, foot
        Of the page: where the data come from, and the formulas.
    """

    title: str
    sentence: str
    sections: Sequence[Section]
    pictures: Iterator[tuple[str, Figure, str]]
    source: str = ''
    foot: str = ''


def show(output: Output, shown: Presentation, report: Path | None) -> None:
    """
    Print a result, and write its page where one was asked for.
    """
    output.say(shown.sentence)
    for part in shown.sections:
        for text in part.text:
            output.say(text)
        for caption, table in part.tables:
            output.heading(caption)
            output.table(table)
        for line in part.lines:
            output.say(f'- {line}')
    if report is None:
        return
    drawn = [(heading, picture(figure, caption)) for heading, figure, caption in shown.pictures]
    sections = [
        replace(part, pictures=[each for heading, each in drawn if heading == part.heading])
        for part in shown.sections
    ]
    about = {'sentence': shown.sentence, 'source': shown.source, 'foot': shown.foot}
    write_page(report, shown.title, sections, **about)
    output.log(f'report in {report}')


def by_columns(columns: Mapping[str, Iterable[str]]) -> Table:
    """
    Return a table from the cells of each column, by its head.
    """
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)))
