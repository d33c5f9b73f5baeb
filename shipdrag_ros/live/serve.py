# SPDX-License-Identifier: Apache-2.0
"""The process of the page: a socket, a server, an orderly end; Signal K over TCP beside it."""

from __future__ import annotations

import asyncio
import json
import resource
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import uvicorn

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.live.app import LivePage
from shipdrag_ros.live.guard import Connection
from shipdrag_ros.live.signal_k import hello, units

_FILES = 4096
_BACKLOG = 4096
_GOODBYE_S = 0  # a stream has no end to wait for
_LOOK_S = 0.05
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
            try:
                found = b''.join(_line(each) for each in latest())
            except Exception as error:  # a task that ends unseen would leave all without figures
                about = {'message': 'no Signal K deltas now', 'exception': error}
                asyncio.get_running_loop().call_exception_handler(about)
                found = b''
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


def listen(address: str, port: int) -> socket.socket:
    """
    Return a socket that listens.

    Raises
    ------
    ShipdragError
        If the address or the port cannot be had.
    """
    family = socket.AF_INET6 if ':' in address else socket.AF_INET
    found = socket.socket(family, socket.SOCK_STREAM)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind((address, port))
        found.listen(_BACKLOG)
    except OSError as error:
        found.close()
        raise ShipdragError(
            f'{address} port {port} cannot be listened on: {error.strerror}; choose another with '
            '--port, or end what uses it'
        ) from error
    return found


def serve(
    page: LivePage,
    sockets: list[socket.socket],
    *,
    deltas: socket.socket | None = None,
    until: threading.Event | None = None,
) -> None:
    """
    Serve until a signal.

    Parameters
    ----------
    sockets
        That listen, for the page.
    deltas
        The same for Signal K; None for none.
    until
        Ends it too, for a caller in another thread.
    """
    _allow_files()
    config = uvicorn.Config(
        page.app,
        http=Connection,
        ws='none',
        log_level='critical',
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=_GOODBYE_S,
        timeout_keep_alive=5,
    )
    server = uvicorn.Server(config)

    async def run() -> None:
        sending = None
        if deltas is not None:
            sending = asyncio.create_task(serve_deltas(page.deltas, deltas))
        if until is not None:
            asyncio.create_task(_end_when(until, server))  # noqa: RUF006
        await server.serve(sockets=sockets)
        if sending is not None:
            sending.cancel()

    with _signals_to(server):
        asyncio.run(run())


@contextmanager
def _signals_to(server: uvicorn.Server) -> Iterator[None]:
    """Let a signal end the server and return; uvicorn raises it again for whoever was before."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: FrameType | None) -> None:
        server.should_exit = True

    before = {kind: signal.signal(kind, end) for kind in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


async def _end_when(event: threading.Event, server: uvicorn.Server) -> None:
    while not event.is_set():
        await asyncio.sleep(_LOOK_S)
    server.should_exit = True


def _allow_files() -> None:
    """A limit of 1024 open files would be used up by connections that wait to be refused."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _FILES if hard == resource.RLIM_INFINITY else min(_FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
