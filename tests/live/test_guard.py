# SPDX-License-Identifier: Apache-2.0
"""Who gets in, and that nobody can make the page's process grow; over real sockets."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import httpx
import pytest

from shipdrag_ros.live import serve
from shipdrag_ros.live.app import COOKIE, LivePage, pass_of
from shipdrag_ros.live.source import NodeSource

TOKEN = 'a token that nobody guesses'
get, post = partial(httpx.get, timeout=200.0), partial(httpx.post, timeout=200.0)


@pytest.fixture(scope='module')
def open_page(serving: Any) -> Iterator[str]:
    with serving(LivePage(NodeSource())) as url:
        yield url


@pytest.fixture(scope='module')
def guarded(serving: Any) -> Iterator[str]:
    with serving(LivePage(NodeSource(), token=TOKEN)) as url:
        yield url


def test_every_answer_forbids_what_is_from_elsewhere(open_page: str) -> None:
    for path in ('', 'main.js', 'nothing', 'state.json'):
        answer = get(open_page + path)
        policy = answer.headers['content-security-policy']
        assert policy.startswith("default-src 'none'")
        assert 'unsafe' not in policy
        assert answer.headers['x-content-type-options'] == 'nosniff'
        assert 'server' not in answer.headers


@pytest.mark.parametrize(
    ('host', 'status'),
    [
        ('127.0.0.1:1', 200),
        ('localhost', 200),
        ('[::1]:80', 200),
        ('192.168.1.5', 200),
        (socket.gethostname(), 200),
        ('evil.example', 421),  # a name that was made to lead here
        ('localhost.evil.example', 421),
        ('', 421),
        ('[', 421),
    ],
)
def test_it_answers_to_its_own_names_only(open_page: str, host: str, status: int) -> None:
    assert get(open_page, headers={'Host': host}).status_code == status


@pytest.mark.parametrize(
    ('headers', 'status'),
    [
        ({'Origin': 'http://evil.example'}, 403),
        ({'Sec-Fetch-Site': 'cross-site'}, 403),
        ({}, 400),  # let in; and told that there is nothing to play
    ],
)
def test_another_page_cannot_press_the_buttons(open_page, headers, status):
    body = json.dumps({'action': 'play'})
    assert post(f'{open_page}player', content=body, headers=headers).status_code == status


@pytest.mark.parametrize(
    'body',
    [
        *('', '[]', '{"action": 1}', '{"action": "x", "value": []}'),
        *('[' * 9_000, '{"action": "speed", "value": 1e999}', '{"action": "seek", "value": NaN}'),
        '{"action": "seek", "value": 1%s}' % ('0' * 4000),
    ],
)
def test_nonsense_is_answered(open_page: str, body: str) -> None:
    assert post(f'{open_page}player', content=body).status_code == 400


def test_a_body_that_is_too_long_is_refused(open_page: str, guarded: str) -> None:
    assert post(f'{open_page}player', content='x' * 20_000).status_code == 413
    assert post(f'{guarded}login', content='token=' + 'x' * 20_000).status_code == 413


@pytest.mark.parametrize('path', ['../app.py', '%2e%2e/app.py', 'vendor/../../app.py'])
def test_no_file_but_the_page_is_given(open_page: str, path: str) -> None:
    assert get(open_page + path).status_code == 404


def test_without_the_token_there_is_the_question_for_it_alone(guarded: str) -> None:
    for path in ('stream', 'state.json', 'main.js', 'signalk/v1/deltas', 'player'):
        assert get(guarded + path).status_code == 401
    answer = get(guarded, follow_redirects=True)
    assert 'Token' in answer.text
    assert post(f'{guarded}login', content='token=wrong').status_code == 403
    wrong = {'Authorization': 'Bearer wrong'}
    assert get(f'{guarded}state.json', headers=wrong).status_code == 401


def test_with_the_token_all_is_there_and_the_browser_keeps_something_else(guarded: str) -> None:
    right = {'Authorization': f'Bearer {TOKEN}'}
    assert get(f'{guarded}state.json', headers=right).status_code == 200
    answer = post(f'{guarded}login', data={'token': TOKEN})
    assert answer.status_code == 303
    cookie = answer.headers['set-cookie']
    assert pass_of(TOKEN) in cookie
    assert TOKEN not in cookie
    assert 'httponly' in cookie.lower()
    assert 'samesite=strict' in cookie.lower()
    kept = {'Cookie': f'{COOKIE}={pass_of(TOKEN)}'}
    assert get(guarded, headers=kept).status_code == 200


HEAD = b'GET / HTTP/1.1\r\nHost: localhost\r\n'
POST = b'POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9000\r\n\r\n'


@pytest.mark.parametrize('beginning', [b'', HEAD, POST], ids=['silent', 'header', 'body'])
@pytest.mark.parametrize('drips', [False, True])
def test_who_never_asks_holds_no_place(serving, monkeypatch, beginning, drips):
    monkeypatch.setattr(serve, 'CONNECTIONS', 5)
    monkeypatch.setattr(serve, 'ASK_S', 1.5)
    with serving(LivePage(NodeSource(), token=TOKEN)) as url:
        address = ('127.0.0.1', int(url.rstrip('/').rpartition(':')[2]))
        opened = [socket.create_connection(address) for _ in range(20)]
        for each in opened:
            each.sendall(beginning)
        assert get(f'{url}login').status_code == 200
        # those that still have a place lose it, though they go on
        end_s = time.monotonic() + 100.0  # of a busy machine; without a limit they stay for ever
        while opened and time.monotonic() < end_s:
            opened = [each for each in opened if not closed(each, drips=drips)]
            time.sleep(0.1)
        assert opened == []


def closed(connection: socket.socket, *, drips: bool) -> bool:
    connection.setblocking(False)
    try:
        if drips:
            connection.send(b'x')
        return connection.recv(1000) == b''
    except BlockingIOError:
        return False
    except OSError:
        return True


def test_more_viewers_than_places_are_told(serving: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serve, 'CONNECTIONS', 5)
    with serving(LivePage(NodeSource())) as url:
        address = ('127.0.0.1', int(url.rstrip('/').rpartition(':')[2]))
        viewers = []
        for _ in range(5):
            viewers.append(socket.create_connection(address))
            viewers[-1].sendall(b'GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n')
            assert viewers[-1].recv(100).startswith(b'HTTP/1.1 200')
        with socket.create_connection(address) as one_more:
            assert one_more.recv(1000).startswith(b'HTTP/1.1 503')
        viewers.pop().close()
        end_s = time.monotonic() + 100.0
        while get(url).status_code != 200:
            assert time.monotonic() < end_s
        for each in viewers:
            each.close()


def test_many_who_come_at_once_are_all_answered(serving: Any, monkeypatch) -> None:
    """Their requests are there before the first of them is read."""
    monkeypatch.setattr(serve, 'CONNECTIONS', 5)
    with serving(LivePage(NodeSource())) as url:
        address = ('127.0.0.1', int(url.rstrip('/').rpartition(':')[2]))
        viewers = [socket.create_connection(address, timeout=60.0) for _ in range(60)]
        for each in viewers:
            each.sendall(b'GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n')
        answers = [each.recv(12)[9:] for each in viewers]
        for each in viewers:
            each.close()
    assert {*answers} == {b'200', b'503'}
    assert answers.count(b'200') == 5


def test_a_reader_who_reads_nothing_is_let_go(serving: Any, monkeypatch) -> None:
    monkeypatch.setattr(serve, 'STUCK_S', 0.5)
    source = NodeSource()
    page = LivePage(source)
    with serving(page) as url:
        address = ('127.0.0.1', int(url.rstrip('/').rpartition(':')[2]))
        stuck = socket.socket()
        stuck.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        stuck.connect(address)
        stuck.sendall(b'GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n')
        end_s = time.monotonic() + 60.0
        came = False
        while not came or page.frames.viewers:
            came = came or page.frames.viewers == 1
            source.bridge._notes.append((0, 'x' * 100_000))  # frames that are large
            assert time.monotonic() < end_s
            time.sleep(0.05)
        stuck.close()
