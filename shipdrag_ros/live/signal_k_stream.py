# SPDX-License-Identifier: Apache-2.0
"""Deltas over TCP, one JSON object a line: what a Signal K server reads from a data connection."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Callable
from typing import Any

from shipdrag_ros.live.signal_k import hello, units

LISTENERS = 20
EVERY_S = 1.0
_BEHIND_BYTES = 65536  # a listener who is further behind is let go


async def serve_deltas(
    latest: Callable[[], list[dict[str, Any]]], listening: socket.socket
) -> None:
    """
    Send deltas to whoever connects, until cancelled.

    Parameters
    ----------
    latest
        Returns the latest figures, none before there are any.
    listening
        A socket that listens.
    """
    listeners: set[asyncio.StreamWriter] = set()

    async def welcome(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(listeners) >= LISTENERS:
            writer.close()
            return
        writer.write(_line(hello()) + _line(units()))
        listeners.add(writer)

    server = await asyncio.start_server(welcome, sock=listening)
    try:
        while True:
            await asyncio.sleep(EVERY_S)
            found = b''.join(_line(each) for each in latest())
            if not found:
                continue
            for writer in list(listeners):
                transport = writer.transport
                if transport.is_closing() or transport.get_write_buffer_size() > _BEHIND_BYTES:
                    transport.abort()
                    listeners.discard(writer)
                else:
                    writer.write(found)
    finally:
        server.close()
        for writer in listeners:
            writer.transport.abort()


def _line(message: dict[str, Any]) -> bytes:
    return json.dumps(message, allow_nan=False).encode() + b'\n'
