# SPDX-License-Identifier: Apache-2.0
"""Bytes to lines of text, in a memory that nobody outside can fill."""

from __future__ import annotations

import re

LINE_BYTES = 512
"""A sentence has 82 characters; one with a TAG block, or of a careless maker, has more."""

_ENDS = re.compile(rb'[\r\n]+')
_PLAIN = re.compile(rb'[\x20-\x7e]+')


class LineSplitter:
    """
    Cuts a stream of bytes into lines.

    Attributes
    ----------
    too_long
        Lines longer than `LINE_BYTES`; all of such a line is dropped.
    binary
        Lines with anything but printable ASCII.
    """

    def __init__(self) -> None:
        self.too_long = 0
        self.binary = 0
        self._open = b''
        self._skipping = False

    def feed(self, data: bytes) -> list[str]:
        """
        Return the lines that have ended, without their ends; blank ones are left out.
        """
        *ended, rest = _ENDS.split(data)
        lines = []
        for piece in ended:
            line, self._open = self._open + piece, b''
            skipping, self._skipping = self._skipping, False
            if not skipping:
                lines += self._line(line)
        if not self._skipping:
            self._open += rest
            if len(self._open) > LINE_BYTES:
                self.too_long += 1
                self._open, self._skipping = b'', True
        return lines

    def end(self) -> list[str]:
        """
        Take what is open as a line: the datagram, or the connection, has ended.
        """
        line, self._open = self._open, b''
        skipping, self._skipping = self._skipping, False
        return [] if skipping else self._line(line)

    def _line(self, line: bytes) -> list[str]:
        if len(line) > LINE_BYTES:
            self.too_long += 1
        elif line and not _PLAIN.fullmatch(line):
            self.binary += 1
        elif text := line.decode('ascii').strip():
            return [text]
        return []
