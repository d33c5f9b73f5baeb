# SPDX-License-Identifier: Apache-2.0
"""Receivers of progress and lines during long work: a terminal, or a list."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Protocol

from shipdrag_ros.progress import PartDone


class Listener(Protocol):
    """Receives lines, and how far the work is."""

    def log(self, text: str) -> None:
        """
        Take a line that is not part of the result.
        """

    def progress(self, text: str) -> AbstractContextManager[PartDone]:
        """
        Receive how far the work is that `text` names.
        """


class Notes:
    """
    A listener that shows nothing and keeps the lines.

    Attributes
    ----------
    lines
        In the order they came.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []

    def log(self, text: str) -> None:
        """
        Keep a line.
        """
        self.lines.append(text)

    def progress(self, text: str) -> AbstractContextManager[PartDone]:
        """
        Show nothing.
        """
        return nullcontext(_ignore)


def _ignore(done: int, total: int) -> None:
    pass
