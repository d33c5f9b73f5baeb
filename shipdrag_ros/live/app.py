# SPDX-License-Identifier: Apache-2.0
"""
Routes of the page, who may see it, its stream, the player's buttons, the fleet, Signal K.

Nobody out there can make the page's process grow: too many connections are
refused; those that owe a request and those that read nothing are closed.
"""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import ipaddress
import json
import math
import socket
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from datetime import UTC, datetime
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request, cookie_parser
from starlette.responses import (
    FileResponse,
    HTMLResponse,
    JSONResponse,
    PlainTextResponse,
    RedirectResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from shipdrag_ros import __version__
from shipdrag_ros.display import json_text, printable
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.live.bridge import Bridge
from shipdrag_ros.live.headline import Headline, Tone
from shipdrag_ros.live.source import PictureFeed

SOURCE = {'label': 'shipdrag', 'type': 'shipdrag_ros'}
UNITS = {
    'navigation.speedThroughWater': 'm/s',
    'performance.shipdrag.specificResistance': 'm/s2',
    'performance.shipdrag.resistance': 'N',
    'performance.shipdrag.effectivePower': 'W',
    'performance.shipdrag.overCleanHull': 'ratio',
}
_ALARMS = {'good': 'normal', 'watch': 'normal', 'act': 'alert', 'bad': 'warn'}


def signal_k_hello() -> dict[str, Any]:
    """
    Return the message that opens a stream.
    """
    return {
        'name': 'shipdrag_ros',
        'version': __version__,
        'self': 'vessels.self',
        'roles': ['master'],
        'timestamp': _time(datetime.now(UTC).timestamp()),
    }


def signal_k_deltas(bridge: Bridge, now_s: float) -> list[dict[str, Any]]:
    """
    Return the latest figures and the state as deltas; none before there are any.

    Parameters
    ----------
    now_s
        On the clock of the bridge.
    """
    if not bridge.now_ns:
        return []
    parts = bridge.parts(now_s)
    figures, said = parts['figures'], parts['headline']
    values: dict[str, Any] = {'navigation.speedThroughWater': figures['speed_m_s']}
    ship, r = bridge.ship, bridge.resistance
    if r is not None:
        values['performance.shipdrag.specificResistance'] = r.value
    usual = figures.get('usual')
    if usual is not None and ship is not None:
        force_n = usual['r'] * ship.mass_kg
        values['performance.shipdrag.resistance'] = force_n
        values['performance.shipdrag.effectivePower'] = force_n * usual['speed_m_s']
        values['performance.shipdrag.overCleanHull'] = usual.get('over_clean')
    notice = {
        'state': _ALARMS[said['tone']],
        'method': ['visual'],
        'message': f'{said["text"]}. {said["action"]}',
    }
    time = _time(bridge.now_ns * 1e-9)
    # apart: signalk-server names itself as the source of all that stands beside a notification
    groups = (_values(values), _values({'notifications.performance.shipdrag': notice}))
    return [
        {
            'context': 'vessels.self',
            'updates': [{'source': SOURCE, 'timestamp': time, 'values': each}],
        }
        for each in groups
        if each
    ]


def signal_k_units() -> dict[str, Any]:
    """
    Return the delta that says in which unit each figure is.
    """
    meta = [{'path': path, 'value': {'units': unit}} for path, unit in UNITS.items()]
    return {'context': 'vessels.self', 'updates': [{'source': SOURCE, 'meta': meta}]}


def _values(values: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [
        {'path': path, 'value': value}
        for path, value in values.items()
        if value is not None and not (isinstance(value, float) and not math.isfinite(value))
    ]


def _time(seconds: float) -> str:
    moment = datetime.fromtimestamp(seconds, UTC)
    return moment.isoformat(timespec='milliseconds').replace('+00:00', 'Z')


COOKIE = 'shipdrag'
_HEADERS = {
    'Content-Security-Policy': "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' data:; connect-src 'self'; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'",
    'Cache-Control': 'no-store',
    'X-Content-Type-Options': 'nosniff',
    'X-Frame-Options': 'DENY',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Opener-Policy': 'same-origin',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Permissions-Policy': 'camera=(), geolocation=(), microphone=()',
}
_WITHOUT_TOKEN = {'/login', '/style.css', '/login.js'}


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
        try:
            name = urlsplit(f'//{host}').hostname or ''
        except ValueError:  # half a bracket
            return False
        with suppress(ValueError):
            ipaddress.ip_address(name)
            return True
        return name in self._names or name.removesuffix('.local') in self._names

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


def _is_same_origin(headers: Headers) -> bool:
    origin = headers.get('origin')
    if origin is not None:
        return origin.partition('://')[2] == headers.get('host')
    return headers.get('sec-fetch-site', 'same-origin') in ('same-origin', 'none')


KEPT = 50  # frames: five seconds
HISTORY = 'rows'  # part of a frame that adds up; all others replace what was


class Frames:
    """
    The picture as it is now, and the frames that led to it, for many viewers.

    A frame is encoded once, and the last ones are kept. A viewer who has fallen behind them
    gets the whole picture instead, and what he missed is counted; memory does not grow with
    viewers, and nobody waits for one.

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
        self._kept: deque[bytes] = deque(maxlen=KEPT)  # without those before the last jump
        self._whole = b''  # as it is, once it was asked for
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
            self._kept.clear()
        self._whole = b''
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
        kept, missing = len(self._kept), 0 if number is None else self.number - number
        if number is not None and 0 <= missing <= kept:
            return self.number, b''.join(islice(self._kept, kept - missing, None))
        self.dropped += max(missing, 0)
        return self.number, self.whole()

    def whole(self) -> bytes:
        """
        Return the whole picture, as a viewer who comes gets it.
        """
        self._whole = self._whole or self._frame('whole', self._parts, self._history())
        return self._whole

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


PAGE = Path(__file__).parent / 'page'
TICK_S = 0.1
LARGEST_BODY = 10_000
_WRONG_TOKEN_S = 1.0  # an answer to a wrong token waits so long
_ON_PAPER = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
_KEEP_S = 30 * 86400
_KEPT = 32
_FAILURES = 20  # that are logged
FLEET = '/fleet'


class FleetPages:
    """
    Pages of a store, as it was when they were begun.

    Parameters
    ----------
    page
        That of the fleet (HTML).
    rows
        Of the store's `coastdowns`.

    Attributes
    ----------
    page
    """

    def __init__(self, page: str, rows: Sequence[Mapping[str, Any]]) -> None:
        from shipdrag_ros.trend.page import coastdown_page, page_name  # slow to import

        self.page = page
        self._rows = {page_name(row): row for row in rows}
        self._drawing = threading.Lock()
        self._made = lru_cache(_KEPT)(lambda name: coastdown_page(self._rows[name], fleet=FLEET))

    def coastdown(self, name: str) -> str | None:
        """
        Return the page of a coastdown (HTML) by its name; None where there is none.
        """
        if name not in self._rows:
            return None
        with self._drawing:
            return self._made(name)


class LivePage:
    """
    The page over a source.

    Parameters
    ----------
    source
        Looked at ten times a second.
    token
        What a viewer must know; None: nothing.
    notes
        Lines about how the page was started, shown below it.
    fleet
        Shown under /fleet; None: none.
    mark
        Tells the node that the engine was stopped just now, and returns its answer; None: the
        page has no button for it.
    ready
        Called once it answers.

    Attributes
    ----------
    app
        For an ASGI server.
    frames
    """

    def __init__(
        self,
        source: PictureFeed,
        *,
        token: str | None = None,
        notes: tuple[str, ...] = (),
        fleet: FleetPages | None = None,
        mark: Callable[[], str] | None = None,
        ready: Callable[[], None] = lambda: None,
    ) -> None:
        self._ready = ready
        self.frames = Frames(lambda: source.bridge.trace.rows())
        self._source = source
        self._token = token
        self._fleet = fleet
        self._mark = mark
        self._failures: set[str] = set()
        self._started = {
            'version': __version__,
            'notes': list(notes),
            'fleet': fleet is not None,
            'marks': mark is not None,
        }
        self.app: ASGIApp = Guard(self._routes(), token=token)

    def _routes(self) -> Starlette:
        return Starlette(
            routes=[
                Route('/fleet', self._fleet_page),
                Route('/fleet/{name}', self._fleet_page),
                Route('/login', self._login, methods=['GET', 'POST']),
                Route('/stream', self._stream),
                Route('/player', self._control, methods=['POST']),
                Route('/engine_stopped', self._engine_stopped, methods=['POST']),
                Route('/signalk', self._signal_k),
                Route('/signalk/v1/deltas', self._deltas),
                Route('/state.json', self._state),
                Mount('/', StaticFiles(directory=PAGE, html=True)),
            ],
            lifespan=self._lifespan,
            max_body_size=LARGEST_BODY,
        )

    def tick(self) -> None:
        """
        Look at the source and make a frame.
        """
        now_s = time.monotonic()
        jumped = self._source.advance(now_s)
        bridge = self._source.bridge
        restarted, bridge.trace.restarted = bridge.trace.restarted, False
        rows = bridge.trace.closed()
        parts = {
            **bridge.parts(now_s),
            'player': self._source.player(),
            'started': self._started,
            'clock': {'ship_s': bridge.now_ns // 10**9, 'machine_s': int(time.time())},
        }
        self.frames.add(parts, [list(row) for row in rows], anew=jumped or restarted)

    @asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        ticking = asyncio.create_task(self._tick_for_ever())
        self._ready()
        try:
            yield
        finally:
            ticking.cancel()
            with suppress(asyncio.CancelledError):
                await ticking

    async def _tick_for_ever(self) -> None:
        due_s = time.monotonic()
        while True:
            try:
                self.tick()
            except Exception as error:  # a task that ends unseen would leave the picture as it was
                self._fail(error)
            due_s = max(due_s + TICK_S, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())

    def _fail(self, error: Exception) -> None:
        """Say on the page that it shows nothing, and why; once in the log."""
        why = f'{type(error).__name__}: {printable(str(error))}'
        action = f'Nothing here is of now ({why}). Start the page again, and report this.'
        said = Headline(Tone.BAD, 'THE PAGE HAS FAILED', action)
        self.frames.add({'headline': said._asdict()}, [])
        if why not in self._failures and len(self._failures) < _FAILURES:
            self._failures.add(why)
            about = {'message': 'the page cannot be made', 'exception': error}
            asyncio.get_running_loop().call_exception_handler(about)

    # the page

    async def _fleet_page(self, request: Request) -> Response:
        if self._fleet is None:
            return PlainTextResponse('No fleet: start the page with --store STORE.\n', 404)
        # a page on paper: its style and its pictures are in it, and it runs nothing
        name = request.path_params.get('name')
        page: str | None = self._fleet.page
        if name is not None:
            page = await asyncio.to_thread(self._fleet.coastdown, name)
        if page is None:
            return PlainTextResponse('No such coastdown: go back to /fleet.\n', 404)
        return HTMLResponse(page, headers={'Content-Security-Policy': _ON_PAPER})

    async def _login(self, request: Request) -> Response:
        if self._token is None:
            return RedirectResponse('/', 303)
        if request.method == 'GET':
            return FileResponse(PAGE / 'login.html')
        form = parse_qs((await request.body()).decode(errors='replace'))
        if not same(form.get('token', [''])[0].strip(), self._token):
            await asyncio.sleep(_WRONG_TOKEN_S)
            return FileResponse(PAGE / 'login.html', status_code=403)
        answer = RedirectResponse('/', 303)
        answer.set_cookie(
            COOKIE, pass_of(self._token), httponly=True, samesite='strict', max_age=_KEEP_S
        )
        return answer

    async def _state(self, request: Request) -> Response:
        """Everything at once, for a program."""
        data = self.frames.whole().decode().partition('data: ')[2]
        return Response(data.strip(), media_type='application/json')

    async def _control(self, request: Request) -> Response:
        try:
            asked = json.loads(await request.body())
            self._source.control(str(asked['action']), float(asked.get('value', 0)))
        except ShipdragError as error:
            return PlainTextResponse(f'{error}\n', 400)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError):
            return PlainTextResponse('expected {"action": ..., "value": number}\n', 400)
        return JSONResponse(self._source.player())

    async def _engine_stopped(self, request: Request) -> Response:
        if self._mark is None:
            return PlainTextResponse('Marks are off: start the page with --allow-marks.\n', 403)
        return PlainTextResponse(f'{await asyncio.to_thread(self._mark)}\n')

    # streams

    async def _stream(self, request: Request) -> Response:
        """Server-sent events, until the viewer goes."""
        return StreamingResponse(self._frames_on(), media_type='text/event-stream')

    async def _frames_on(self) -> AsyncIterator[bytes]:
        self.frames.viewers += 1
        seen: int | None = None
        try:
            while True:
                seen, data = self.frames.after(seen)
                yield data
                await self.frames.more(seen)
        finally:
            self.frames.viewers -= 1

    async def _signal_k(self, request: Request) -> Response:
        base = str(request.base_url).rstrip('/')
        return JSONResponse(
            {
                'endpoints': {
                    'v1': {'version': '1.7.0', 'shipdrag-deltas': f'{base}/signalk/v1/deltas'}
                },
                'server': {'id': 'shipdrag_ros', 'version': __version__},
            }
        )

    async def _deltas(self, request: Request) -> Response:
        return JSONResponse([signal_k_units(), *self.deltas()])

    def deltas(self) -> list[dict[str, Any]]:
        """
        Return the latest figures as Signal K deltas.
        """
        return signal_k_deltas(self._source.bridge, time.monotonic())
