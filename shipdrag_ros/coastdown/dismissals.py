# SPDX-License-Identifier: Apache-2.0
"""
What was nearly a coastdown, said without flooding the log.

A rough sea, or a ship that manoeuvres, may give many dismissals. Of each reason one is
said in each span of absolute time; the rest of the span is counted and stated as one.
"""

from __future__ import annotations

from dataclasses import dataclass

from shipdrag_ros.coastdown.events import Dismissal, Event, NotCoastdown


@dataclass(frozen=True)
class _More:
    """Dismissals of one reason that were not said yet: how many, and all as one."""

    count: int
    as_one: NotCoastdown


class Dismissals:
    """
    Says the first dismissal of each reason in a span, and the rest together.

    Parameters
    ----------
    span_ns
        Length of a span [ns].
    """

    def __init__(self, span_ns: int) -> None:
        self._span_ns = span_ns
        self._said: dict[Dismissal, int] = {}
        self._more: dict[Dismissal, _More] = {}

    def take(self, dismissed: NotCoastdown) -> list[Event]:
        """
        Take a dismissal and return what is to be said now.
        """
        span = dismissed.end_ns // self._span_ns
        if self._said.get(dismissed.reason) != span:
            self._said[dismissed.reason] = span
            return [*self._flush(dismissed.reason), dismissed]
        more = self._more.get(dismissed.reason)
        count, start_ns = 1, dismissed.start_ns
        if more is not None:
            count, start_ns = more.count + 1, more.as_one.start_ns
        as_one = NotCoastdown(start_ns, dismissed.end_ns, dismissed.reason, dismissed.text)
        self._more[dismissed.reason] = _More(count, as_one)
        return []

    def flush(self) -> list[Event]:
        """
        Return what was counted and not said, and forget everything.
        """
        events = [event for reason in list(self._more) for event in self._flush(reason)]
        self._said.clear()
        return events

    def _flush(self, reason: Dismissal) -> list[Event]:
        more = self._more.pop(reason, None)
        if more is None:
            return []
        one = more.as_one
        text = one.text if more.count == 1 else f'{more.count} times, the last: {one.text}'
        return [NotCoastdown(one.start_ns, one.end_ns, one.reason, text)]
