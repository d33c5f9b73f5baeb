# SPDX-License-Identifier: Apache-2.0
"""The process of the page: a socket, a server, an orderly end; Signal K over TCP beside it."""

from __future__ import annotations

import asyncio
import json
import resource
import signal
import socket
from collections.abc import Callable
from time import monotonic
from types import FrameType
from typing import Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.live.app import LivePage, signal_k_hello, signal_k_units

CONNECTIONS = 250
ASK_S = 15.0  # a connection that asks for nothing is closed after it
STUCK_S = 30.0  # so is one that reads nothing of what is sent
_FULL = (
    b'HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nRetry-After: 10\r\n'
    b'Connection: close\r\n\r\nToo many viewers; close a page that nobody looks at.\n'
)


_FILES = 4096
_BACKLOG = 4096
_GOODBYE_S = 0  # a stream has no end to wait for
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
        writer.write(_line(signal_k_hello()) + _line(signal_k_units()))
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
    page: LivePage, sockets: list[socket.socket], *, deltas: socket.socket | None = None
) -> None:
    """
    Serve until a signal, in the main thread.

    Parameters
    ----------
    sockets
        That listen, for the page.
    deltas
        The same for Signal K; None for none.
    """
    server = server_of(page)

    async def run() -> None:
        sending = None
        if deltas is not None:
            sending = asyncio.create_task(serve_deltas(page.deltas, deltas))
        await server.serve(sockets=sockets)
        if sending is not None:
            sending.cancel()

    def end(number: int, frame: FrameType | None) -> None:
        server.should_exit = True

    # a signal ends the server and returns; uvicorn raises it again for whoever was before
    before = {kind: signal.signal(kind, end) for kind in (signal.SIGINT, signal.SIGTERM)}
    try:
        asyncio.run(run())
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


def server_of(page: LivePage) -> uvicorn.Server:
    """
    Return the server of a page, to be run on sockets that listen.
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
    return uvicorn.Server(config)


def _allow_files() -> None:
    """A limit of 1024 open files would be used up by connections that wait to be refused."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _FILES if hard == resource.RLIM_INFINITY else min(_FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


class Connection(H11Protocol):
    """
    A connection that may not wait for ever, one of not too many.

    A request must be whole `ASK_S` after the connection or after the answer before it, however
    it drips in. Where there are too many, the oldest one that still owes a request gives its
    place to the next, so that only who asks can hold one.
    """

    _timer: asyncio.TimerHandle | None = None
    since_s = 0.0

    def connection_made(self, transport: Any) -> None:
        """Give it a place, or refuse it where there are too many viewers."""
        super().connection_made(transport)
        self.since_s = monotonic()
        self._expect_request()
        if len(self.connections) <= CONNECTIONS:
            return
        others = [each for each in self.connections if isinstance(each, Connection)]
        waiting = [each for each in others if each is not self and each.owes_request]
        min(waiting, key=lambda each: each.since_s, default=self).leave()

    @property
    def owes_request(self) -> bool:
        """Whether no whole request has come since the last answer."""
        return self.conn.their_state in (h11.IDLE, h11.SEND_BODY)

    def leave(self) -> None:
        """Say that there are too many, and give its place away at once."""
        self.connections.discard(self)
        # its request may have come already, and was not read yet: who waits for an answer gets one
        self.transport.write(_FULL)
        self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._stop_timer()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take what is asked, unless it was refused."""
        if not self.transport.is_closing():
            super().data_received(data)

    def on_response_complete(self) -> None:
        """Wait for the next request, but not for ever."""
        super().on_response_complete()
        self._expect_request()

    def pause_writing(self) -> None:
        """Wait for a reader who is behind, but not for ever."""
        super().pause_writing()
        self._set_timer(STUCK_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on: he reads again."""
        self._expect_request()
        super().resume_writing()

    def _expect_request(self) -> None:
        self._set_timer(ASK_S, self._close_if_late)

    def _set_timer(self, seconds: float, act: Callable[[], object]) -> None:
        self._stop_timer()
        self._timer = self.loop.call_later(seconds, act)

    def _close_if_late(self) -> None:
        if self.owes_request:
            self.transport.abort()

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
