# SPDX-License-Identifier: Apache-2.0
"""A browser driven by Playwright, and the processes that it looks at."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from shipdrag_ros.live.app import LivePage
from shipdrag_ros.live.serve import listen, server_of
from tests.processes import START_S, Process

SHIP = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'


class Viewer:
    """
    A page in the browser; what it complains about and asks for is noted.
    """

    def __init__(self, page: Any, url: str) -> None:
        self.page = page
        self.problems: list[str] = []
        self._url = url
        page.on('console', lambda message: self._note(message.text))
        page.on('pageerror', lambda error: self.problems.append(str(error)))
        page.on('request', self._on_request)
        page.goto(url)

    def _note(self, text: str) -> None:
        # what a browser says when the server is gone is no fault of the page
        if 'ERR_CONNECTION_REFUSED' not in text and 'ERR_INCOMPLETE_CHUNKED' not in text:
            self.problems.append(text)

    def _on_request(self, request: Any) -> None:
        if not request.url.startswith((self._url, 'data:')):
            self.problems.append(f'asks for {request.url}')

    def text(self, selector: str) -> str:
        return str(self.page.inner_text(selector))

    def wait_for(self, selector: str, text: str, *, within_s: float = START_S) -> str:
        """Return what stands there once it has a text."""
        end_s = time.monotonic() + within_s
        while text not in (found := self.text(selector)):
            assert time.monotonic() < end_s, f'no {text!r} in {found!r}'
            self.page.wait_for_timeout(50)
        return found


@pytest.fixture
def view(browser: Any) -> Iterator[Callable[..., Viewer]]:
    """A function that opens a page; at the end none may have complained."""
    opened: list[Viewer] = []

    def start(url: str, *, width: int = 1280) -> Viewer:
        # colours amid a transition have no contrast to be judged by
        context = browser.new_context(
            viewport={'width': width, 'height': 900}, reduced_motion='reduce'
        )
        opened.append(Viewer(context.new_page(), url))
        return opened[-1]

    yield start
    for viewer in opened:
        viewer.page.context.close()
    for viewer in opened:
        assert viewer.problems == []


@pytest.fixture
def start(tmp_path, own_domain):
    """A function that starts a module of the package on a domain of this test's own."""
    domain, lock = own_domain()
    started: list[Process] = []

    def run(*line: str | Path) -> Process:
        process = Process(
            tmp_path / f'log{len(started)}',
            '-m',
            *line,
            ROS_DOMAIN_ID=str(domain),
            ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
            PYTHONUNBUFFERED='1',
        )
        started.append(process)
        return process

    before = {name: os.environ.get(name) for name in ('ROS_DOMAIN_ID',)}
    os.environ |= {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    yield run
    for process in started:
        process.kill()
    for name, value in before.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value
    lock.close()


@contextmanager
def _serving(page: LivePage) -> Iterator[str]:
    """Serve a page from a thread of this process, at an address."""
    with listen('127.0.0.1', 0) as found:
        server = server_of(page)
        thread = threading.Thread(target=server.run, args=([found],))
        thread.start()
        try:
            yield f'http://127.0.0.1:{found.getsockname()[1]}/'
        finally:
            server.should_exit = True
            thread.join()


@pytest.fixture(scope='session')
def serving() -> Callable[[LivePage], Any]:
    """A context that serves a page, and gives its address."""
    return _serving
