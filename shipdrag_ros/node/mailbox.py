# SPDX-License-Identifier: Apache-2.0
"""
What waits at all inputs, in the order in which it came.

An executor takes one message of each topic in turn. After a pause, a topic at
1 Hz would so be ten times further in time than one at 10 Hz, whose readings
would then be rejected as late.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from shipdrag_ros.node.inputs import HeardMessage, InputTopic

MOST = 200  # messages of a topic at once: some tens of ms, so that timers are kept


class Mailbox:
    """
    The messages of some topics, merged.

    Parameters
    ----------
    topics
        Where they wait.
    ahead
        Whether to take what the executor has not come to. Not under simulated time: /clock
        waits among its messages, and what overtakes it seems to come from the future.
    """

    def __init__(self, topics: Sequence[InputTopic], *, ahead: bool) -> None:
        self._topics = topics
        self._ahead = ahead
        self._waiting: list[HeardMessage] = []

    def take(self) -> list[HeardMessage]:
        """
        Return what has come so far, or the older part of it where that is much.
        """
        until_ns = sys.maxsize
        for topic in self._topics:
            taken = topic.take(MOST, ahead=self._ahead)
            self._waiting += taken
            if len(taken) == MOST:  # there may be more, that the others must wait for
                until_ns = min(until_ns, taken[-1].received_ns)
        self._waiting.sort(key=lambda heard: heard.received_ns)
        ready = sum(heard.received_ns <= until_ns for heard in self._waiting)
        taken, self._waiting = self._waiting[:ready], self._waiting[ready:]
        return taken
