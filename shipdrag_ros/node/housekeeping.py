# SPDX-License-Identifier: Apache-2.0
"""Recordings removed beside the work: a thread, because a disk may take its time."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from pathlib import Path

from shipdrag_ros.bags.retention import Keep, Removed, Retention

EVERY_S = 60.0


class Housekeeping:
    """
    Tidies a directory now and then, from its making to `close`.

    Parameters
    ----------
    directory
        Of the recordings.
    keep
        The limits; without any no thread is started.
    busy
        Returns the files that are still written.
    """

    def __init__(self, directory: Path, keep: Keep, busy: Callable[[], Collection[Path]]) -> None:
        self._retention = Retention(directory, keep)
        self._busy = busy
        self._removed: deque[Removed] = deque(maxlen=1000)
        self._ending = threading.Event()
        # a disk that hangs must not keep the process
        self._thread = threading.Thread(target=self._run, name='housekeeping', daemon=True)
        if not keep.everything:
            self._thread.start()

    def removed(self) -> list[Removed]:
        """
        Return what was removed since the last time.
        """
        return [self._removed.popleft() for _ in range(len(self._removed))]

    def close(self) -> None:
        """
        End; returns at once.
        """
        self._ending.set()

    def _run(self) -> None:
        while True:
            self._removed += self._retention.tidy(busy=self._busy(), now_s=time.time())
            if self._ending.wait(EVERY_S):
                return
