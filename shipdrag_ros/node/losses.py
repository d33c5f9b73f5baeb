# SPDX-License-Identifier: Apache-2.0
"""
What publishers sent and this node never got, from the sequence numbers of DDS.

A middleware says that a queue ran over, if at all, only where it notices; the
numbers that a publisher gives its messages show every hole.
"""

from __future__ import annotations

from collections.abc import Callable

Publishers = Callable[[], frozenset[str]]


class Sequences:
    """
    Holes in the sequence numbers of the publishers of one topic.

    Parameters
    ----------
    publishers
        Returns the identities of the publishers there are now.

    Attributes
    ----------
    lost
        Messages that were sent and not heard.
    numbered
        Whether the middleware gives numbers at all.

    Notes
    -----
    A message does not say who sent it. Its number is taken to follow the nearest one
    below it, which counts right as long as no publisher comes while another loses messages.
    What was sent before the first message heard is not lost: nobody listened.
    """

    def __init__(self, publishers: Publishers) -> None:
        self.lost = 0
        self.numbered = False
        self._publishers = publishers
        self._known: frozenset[str] = frozenset()
        self._last: list[int] = []  # of each stream, the one heard longest ago first

    def take(self, number: int | None) -> None:
        """
        Take the sequence number of the next message, None if it has none.
        """
        if number is None:
            return
        self.numbered = True
        if not self._known:
            self.look()
        before = max((last for last in self._last if last < number), default=None)
        if before is not None and number != before + 1:
            self.look()  # a hole, or a publisher that nobody knew
            if len(self._last) < len(self._known):
                before = None
            else:
                before = max((last for last in self._last if last < number), default=None)
        if before is not None:
            self.lost += number - before - 1
            self._last.remove(before)
        self._last.append(number)

    def look(self) -> None:
        """
        Note which publishers there are.
        """
        now = self._publishers()
        if self._known - now:
            self._last.clear()  # whose stream has ended is not known
        self._known = now
        del self._last[: max(len(self._last) - max(len(now), 1), 0)]
