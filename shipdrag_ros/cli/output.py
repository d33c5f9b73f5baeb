# SPDX-License-Identifier: Apache-2.0
"""Where results and logs go: one to stdout, the other and all progress to stderr, never mixed."""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress
from rich.table import Table as RichTable

from shipdrag_ros.cli.arguments import STDOUT
from shipdrag_ros.compiled import when_compiling
from shipdrag_ros.display import Section, Table, duration, json_text
from shipdrag_ros.progress import PartDone, Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_EVERY_S = 3.0  # between lines
_COMPILES = 'compiling, once after an installation or an update; this takes about a minute'


@contextmanager
def stages(
    output: Output, *, every_s: float = _EVERY_S, at_once: bool = True
) -> Iterator[Progress]:
    """
    Show one stage after the other, and compiling where that is really done.

    Parameters
    ----------
    output
        Whose log it goes to.
    every_s, at_once
        Of `ProgressLines`, where no terminal shows it.

    Yields
    ------
    Progress
        Called with each stage, how much of it is done, and of how much.
    """
    with output.bar() as bar, compiling_said(output.log):
        yield bar or ProgressLines(output.log, every_s=every_s, at_once=at_once).show


@contextmanager
def compiling_said(log: Callable[[str], None]) -> Iterator[None]:
    """
    Say once that something is compiled, when the first function is.

    Parameters
    ----------
    log
        Where it is said; not of what is kept from an earlier start.
    """
    said: list[str] = []

    def say() -> None:
        if not said:
            log(_COMPILES)
        said.append(_COMPILES)

    with when_compiling(say):
        yield


class ProgressLines:
    """
    A line of progress now and then.

    Parameters
    ----------
    log
        Where the lines go.
    every_s
        Between two of them, at least [s].
    at_once
        Whether the first word is printed without waiting.
    """

    def __init__(self, log: Callable[[str], None], *, every_s: float, at_once: bool) -> None:
        self._log = log
        self._every_s = every_s
        self._text = ''
        self._begun_s = self._said_s = time.monotonic()
        self._waits = not at_once
        self._first = 0  # that was done when the stage was first seen

    def show(self, text: str, done: int, total: int) -> None:
        """
        Say how far a stage is, with the time left in it, unless a line was said just now.
        """
        now_s = time.monotonic()
        if text != self._text:
            self._text, self._begun_s, self._first = text, now_s, done
        if self._waits and (not done or now_s - self._said_s < self._every_s):
            return
        self._waits, self._said_s = True, now_s
        if done == self._first:
            self._log(text if total < 2 else f'{text}: {done} of {total}')
            return
        left_s = (now_s - self._begun_s) / (done - self._first) * (total - done)
        self._log(f'{text}: {done} of {total}, {duration(round(left_s))} left')


_PIPE_WIDTH = 160  # a file or a pipe has no width of its own; tables must not be cut there


class _Console(Console):
    def on_broken_pipe(self) -> None:
        raise BrokenPipeError  # `main` ends quietly; rich would exit with status 1


class Output:
    """
    The two streams of a verb.

    Parameters
    ----------
    json_to
        Argument of `--json`: None, a file, or '-' for stdout, which then
        belongs to the JSON alone.
    """

    def __init__(self, json_to: str | None = None) -> None:
        self._json_to = json_to
        self._result = _console(sys.stderr if json_to == STDOUT else sys.stdout)
        self._log = _console(sys.stderr)

    @property
    def width(self) -> int:
        """Characters in a line of the result."""
        return self._result.width

    def say(self, *texts: str, lead: str = '') -> None:
        """
        Print lines of the result, each behind a lead.
        """
        for text in texts:
            self._result.print(f'{lead}{text}', soft_wrap=True)

    def heading(self, text: str) -> None:
        """
        Print a heading of the result.
        """
        self._result.print(f'\n{text}', style='bold', soft_wrap=True)

    def table(self, table: Table, heading: str | None = None) -> None:
        """
        Print a table of the result, under a heading; words to the left, figures to the right.
        """
        if heading is not None:
            self.heading(heading)
        heads = any(table.columns)
        shown = RichTable(box=None, show_header=heads, header_style='bold', pad_edge=False)
        for number, name in enumerate(table.columns):
            words = number == 0 or any(row[number][:1].isalpha() for row in table.rows)
            shown.add_column(
                name, justify='left' if words or not heads else 'right', overflow='fold'
            )
        for row in table.rows:
            shown.add_row(*row)
        self._result.print(shown)

    def log(self, *texts: str) -> None:
        """
        Print lines that are not part of the result.
        """
        for text in texts:
            self._log.print(text, soft_wrap=True, style='dim')

    @contextmanager
    def progress(self, text: str) -> Iterator[PartDone]:
        """
        Show a bar while something long is done; only to a terminal.

        Yields
        ------
        callable
            Called with how much is done, and of how much.
        """
        with self.bar() as bar:
            yield lambda done, total: bar(text, done, total) if bar else None

    @contextmanager
    def bar(self) -> Iterator[Progress | None]:
        """
        Show a bar that goes on from one stage to the next.

        Yields
        ------
        Progress
            Called with each stage, how much of it is done, and of how much; None
            where no terminal shows it.
        """
        if not self._log.is_terminal:
            yield None
            return
        bar = RichProgress(
            TextColumn('{task.description}', markup=False),
            BarColumn(),
            TextColumn('{task.percentage:.0f} %'),
            TimeRemainingColumn(),
            console=self._log,
            transient=True,
        )
        shown = ''

        def show(text: str, done: int, total: int) -> None:
            nonlocal shown
            if text != shown:
                shown = text
                bar.reset(task, description=text)
            bar.update(task, completed=done, total=total or None)

        with bar:
            task = bar.add_task('', total=None)
            yield show

    def json(self, document: Mapping[str, Any]) -> None:
        """
        Write the result for the machine, if that was asked for.
        """
        if self._json_to is None:
            return
        text = json_text(document)
        if self._json_to == STDOUT:
            sys.stdout.write(text)
        else:
            Path(self._json_to).write_text(text, encoding='utf-8')
            self.log(f'JSON in {self._json_to}')


def _console(stream: TextIO) -> _Console:
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors='replace')  # a terminal without ± must not end the program
    width = None if stream.isatty() else _PIPE_WIDTH
    # names from outside are text, whatever brackets and colons they hold
    return _Console(file=stream, width=width, markup=False, highlight=False, emoji=False)


class CheckState(Enum):
    """How a thing is."""

    FINE = 'fine'
    LOOK = 'look'
    BROKEN = 'BROKEN'


class CheckResult(NamedTuple):
    """What was looked at, how it is, and what to do; '' where nothing is to be done."""

    what: str
    state: CheckState
    found: str
    do: str = ''


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
        output.say(*part.text)
        for caption, table in part.tables:
            output.table(table, caption)
        output.say(*part.lines, lead='- ')
    if report is None:
        return
    from shipdrag_ros.report.document import write_page  # takes long to import
    from shipdrag_ros.report.drawing import picture

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
