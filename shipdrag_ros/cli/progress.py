# SPDX-License-Identifier: Apache-2.0
"""How far something long is: a bar in a terminal, else a line now and then; always on stderr."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import duration
from shipdrag_ros.progress import Progress

_EVERY_S = 3.0  # between lines
_COMPILES = 'compiling, once after an installation or an update; this takes about a minute'


@contextmanager
def stages(output: Output) -> Iterator[Progress]:
    """
    Show one stage after the other, and compiling where that is really done.

    Parameters
    ----------
    output
        Whose log it goes to.

    Yields
    ------
    Progress
        Called with each stage, how much of it is done, and of how much.
    """
    with output.bar() as bar, compiling_said(output.log):
        yield bar or ProgressLines(output.log, every_s=_EVERY_S, at_once=True).show


@contextmanager
def compiling_said(log: Callable[[str], None]) -> Iterator[None]:
    """
    Say once that something is compiled, when the first function is.

    Parameters
    ----------
    log
        Where it is said; not of what is kept from an earlier start.
    """
    from numba.core import event  # long to import, and help must come at once

    class Notice(event.Listener):  # type: ignore[misc]
        said = False

        def on_start(self, event: object) -> None:
            if not self.said:
                log(_COMPILES)
            self.said = True

        def on_end(self, event: object) -> None:
            pass

    with event.install_listener('numba:compile', Notice()):
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

    def show(self, text: str, done: int, total: int) -> None:
        """
        Say how far a stage is, with the time left in it, unless a line was said just now.
        """
        now_s = time.monotonic()
        if text != self._text:
            self._text, self._begun_s = text, now_s
        if self._waits and (not done or now_s - self._said_s < self._every_s):
            return
        self._waits, self._said_s = True, now_s
        if not done:
            self._log(text if total < 2 else f'{text}: 0 of {total}')
            return
        left_s = (now_s - self._begun_s) / done * (total - done)
        self._log(f'{text}: {done} of {total}, {duration(round(left_s))} left')
