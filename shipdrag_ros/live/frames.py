# SPDX-License-Identifier: Apache-2.0
"""
Frames for many viewers: encoded once, and never queued for one who is slow.

The last frames are kept. A viewer who has fallen behind them gets the whole
picture instead, and what he missed is counted; memory does not grow with
viewers, and nobody waits for one.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from shipdrag_ros.display import json_text

KEPT = 50  # frames: five seconds
HISTORY = 'rows'  # part of a frame that adds up; all others replace what was


class Frames:
    """
    The picture as it is now, and the frames that led to it.

    Parameters
    ----------
    history
        Returns all rows of the traces, for a viewer who has none.

    Attributes
    ----------
    number
        Of the last frame.
    viewers
        Who read now.
    dropped
        Frames that a slow viewer did not get.
    """

    def __init__(self, history: Callable[[], list[Any]]) -> None:
        self.number = 0
        self.viewers = 0
        self.dropped = 0
        self._history = history
        self._parts: dict[str, str] = {}
        self._kept: deque[bytes] = deque(maxlen=KEPT)
        self._whole: tuple[int, bytes] | None = None
        self._first = 1  # a viewer who has not seen this frame needs the whole picture
        self._event = asyncio.Event()

    def add(self, parts: Mapping[str, Any], rows: list[Any], *, anew: bool = False) -> None:
        """
        Make a frame of what has changed; nothing changed, no frame.

        Parameters
        ----------
        parts
            Everything but the traces, JSON by name.
        rows
            New rows of the traces.
        anew
            Everybody must forget what was: the picture jumps.
        """
        texts = {name: json_text(part, indent=None) for name, part in parts.items()}
        changed = {name: text for name, text in texts.items() if self._parts.get(name) != text}
        if not changed and not rows and not anew:
            return
        self._parts |= changed
        self.number += 1
        self._kept.append(self._frame('frame', changed, rows))
        if anew:
            self._first = self.number + 1
            self._kept.clear()
        elif len(self._kept) == KEPT:
            self._first = max(self._first, self.number - KEPT + 1)
        self._whole = None
        event, self._event = self._event, asyncio.Event()
        event.set()

    def after(self, number: int | None) -> tuple[int, bytes]:
        """
        Return what a viewer lacks who has seen a frame, and the number he has then.

        Parameters
        ----------
        number
            None for a viewer who has seen nothing.
        """
        if number is None or number + 1 < self._first or number > self.number:
            if number is not None:
                self.dropped += max(self.number - number, 0)
            return self.number, self.whole()
        missing = self.number - number
        return self.number, b''.join(list(self._kept)[len(self._kept) - missing :])

    def whole(self) -> bytes:
        """
        Return the whole picture, as a viewer who comes gets it.
        """
        if self._whole is None or self._whole[0] != self.number:
            self._whole = self.number, self._frame('whole', self._parts, self._history())
        return self._whole[1]

    async def more(self, number: int) -> None:
        """
        Wait until there is a frame after one.
        """
        while self.number <= number:
            await self._event.wait()

    def _frame(self, kind: str, parts: Mapping[str, str], rows: list[Any]) -> bytes:
        body = ','.join(f'{json.dumps(name)}:{text}' for name, text in parts.items())
        if rows or kind == 'whole':
            body += f'{"," if body else ""}"{HISTORY}":{json_text(rows, indent=None)}'
        return f'event: {kind}\nid: {self.number}\ndata: {{{body}}}\n\n'.encode()
