# SPDX-License-Identifier: Apache-2.0
"""
Who may look: addresses, names, the token, and how many connections.

Nobody out there can make the page's process grow: too many connections are
refused; those that owe a request and those that read nothing are closed.
"""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import ipaddress
import socket
from collections.abc import Iterator
from time import monotonic
from typing import Any
from urllib.parse import urlsplit

import h11
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

CONNECTIONS = 250
ASK_S = 15.0  # a connection that asks for nothing is closed after it
STUCK_S = 30.0  # so is one that reads nothing of what is sent
COOKIE = 'shipdrag'
_HEADERS = {
    'Content-Security-Policy': "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' data:; connect-src 'self'; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'",
    'X-Content-Type-Options': 'nosniff',
    'X-Frame-Options': 'DENY',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Opener-Policy': 'same-origin',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Permissions-Policy': 'camera=(), geolocation=(), microphone=()',
}
_WITHOUT_TOKEN = {'/login', '/style.css', '/login.js'}
_FULL = (
    b'HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nRetry-After: 10\r\n'
    b'Connection: close\r\n\r\nToo many viewers; close a page that nobody looks at.\n'
)


class Guard:
    """
    Lets in whom it may: a middleware around everything.

    Parameters
    ----------
    token
        None: nobody is asked for one.
    """

    def __init__(self, app: ASGIApp, *, token: str | None) -> None:
        self._app = app
        self._token = token
        self._names = {'localhost', socket.gethostname().lower(), socket.getfqdn().lower()}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope['type'] != 'http':
            await self._app(scope, receive, send)
            return
        refused = self._refused(scope)

        async def send_guarded(message: Message) -> None:
            if message['type'] == 'http.response.start':
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
                headers.setdefault('Cache-Control', 'no-store')
            await send(message)

        app: ASGIApp = self._app if refused is None else refused
        await app(scope, receive, send_guarded)

    def _refused(self, scope: Scope) -> ASGIApp | None:
        headers = Headers(scope=scope)
        if not self._is_known(headers.get('host', '')):
            # a name that leads here is how a page elsewhere would reach this one
            return PlainTextResponse(
                'This page answers to its address or the name of its machine only.\n', 421
            )
        if scope['method'] not in ('GET', 'HEAD') and not _is_same_origin(headers):
            return PlainTextResponse('Asked for by another page: refused.\n', 403)
        if self._token is None or scope['path'] in _WITHOUT_TOKEN or self._knows_token(headers):
            return None
        if scope['path'] == '/':
            return RedirectResponse('/login', 303)
        return PlainTextResponse('A token is needed: open the page and give it there.\n', 401)

    def _is_known(self, host: str) -> bool:
        name = _name_of(f'//{host}')
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name in self._names or name.removesuffix('.local') in self._names
        return True

    def _knows_token(self, headers: Headers) -> bool:
        assert self._token is not None
        given = headers.get('authorization', '').removeprefix('Bearer ')
        if given and same(given, self._token):
            return True
        cookie = cookie_parser(headers.get('cookie', '')).get(COOKIE, '')
        return same(cookie, pass_of(self._token))


def pass_of(token: str) -> str:
    """
    Return what a browser keeps instead of the token.
    """
    return hmac.new(token.encode(), b'shipdrag watch', hashlib.sha256).hexdigest()


def same(given: str, expected: str) -> bool:
    """
    Compare in constant time.
    """
    return hmac.compare_digest(given.encode(), expected.encode())


def _name_of(address: str) -> str:
    try:
        return urlsplit(address).hostname or ''
    except ValueError:  # half a bracket
        return ''


def _is_same_origin(headers: Headers) -> bool:
    origin = headers.get('origin')
    if origin is not None:
        return origin.partition('://')[2] == headers.get('host')
    return headers.get('sec-fetch-site', 'same-origin') in ('same-origin', 'none')


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
        waiting = [each for each in self._others() if each.owes_request]
        min(waiting, key=lambda each: each.since_s, default=self).leave()

    @property
    def owes_request(self) -> bool:
        """Whether no whole request has come since the last answer."""
        return self.conn.their_state in (h11.IDLE, h11.SEND_BODY)

    def _others(self) -> Iterator[Connection]:
        for each in self.connections:
            if isinstance(each, Connection) and each is not self:
                yield each

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
        self._stop_timer()
        self._timer = self.loop.call_later(STUCK_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on: he reads again."""
        self._expect_request()
        super().resume_writing()

    def _expect_request(self) -> None:
        self._stop_timer()
        self._timer = self.loop.call_later(ASK_S, self._close_if_late)

    def _close_if_late(self) -> None:
        if self.owes_request:
            self.transport.abort()

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
