# SPDX-License-Identifier: Apache-2.0
"""A real browser, headless Chromium, driven through its debugging pipe."""

from __future__ import annotations

import fcntl
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

REQUIRED = 'SHIPDRAG_BROWSER_REQUIRED'
NAMES = ('chromium', 'chromium-browser', 'google-chrome')
FLAGS = (
    '--headless',
    '--no-sandbox',
    '--disable-gpu',
    '--disable-quic',
    '--disable-dev-shm-usage',
    '--no-first-run',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
    '--hide-scrollbars',
)
LIMIT_S = 60.0
FREE_FD = 10  # the pipe is descriptors 3 and 4 of the browser; ours stay clear of them


class Browser:
    """
    One page of a browser.

    Parameters
    ----------
    program
        The browser.
    profile
        Folder for what it keeps.
    """

    def __init__(self, program: str, profile: Path) -> None:
        hears, self._to = (fcntl.fcntl(fd, fcntl.F_DUPFD, FREE_FD) for fd in os.pipe())
        self._from, says = (fcntl.fcntl(fd, fcntl.F_DUPFD, FREE_FD) for fd in os.pipe())

        def connect() -> None:
            os.dup2(hears, 3)
            os.dup2(says, 4)

        self._log = profile / 'log'
        with self._log.open('w') as log:
            self._process = subprocess.Popen(
                [program, *FLAGS, f'--user-data-dir={profile}', '--remote-debugging-pipe'],
                preexec_fn=connect,
                close_fds=False,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )
        os.close(hears)
        os.close(says)
        self._last = 0
        self._buffer = b''
        self._session: str | None = None
        self.problems: list[str] = []
        self._loaded = False
        target = self._call('Target.createTarget', url='about:blank')['targetId']
        attached = self._call('Target.attachToTarget', targetId=target, flatten=True)
        self._session = attached['sessionId']
        for domain in ('Page', 'Runtime', 'Log', 'Network'):
            self._call(f'{domain}.enable')

    def open(self, path: Path, *, width: int) -> None:
        """Open a file in a window so wide, and wait until it has loaded."""
        self.problems, self._loaded = [], False
        self._call(
            'Emulation.setDeviceMetricsOverride',
            width=width,
            height=900,
            deviceScaleFactor=1,
            mobile=False,
        )
        self._call('Page.navigate', url=path.resolve().as_uri())
        while not self._loaded:
            self._take(self._receive())

    def show_as(self, media: str = '', scheme: str = 'light') -> None:
        """Show the page as on paper (`print`), or in light or dark colours."""
        features = [{'name': 'prefers-color-scheme', 'value': scheme}]
        self._call('Emulation.setEmulatedMedia', media=media, features=features)

    def run(self, script: str) -> Any:
        """Return what a piece of JavaScript gives, as JSON."""
        found = self._call('Runtime.evaluate', expression=script, returnByValue=True)
        assert 'exceptionDetails' not in found, found['exceptionDetails']
        return found['result'].get('value')

    def close(self) -> None:
        """End the browser."""
        self._process.terminate()
        try:
            self._process.wait(timeout=LIMIT_S)
        finally:
            self._process.kill()
            os.close(self._to)
            os.close(self._from)

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._last += 1
        message: dict[str, Any] = {'id': self._last, 'method': method, 'params': parameters}
        if self._session is not None:
            message['sessionId'] = self._session
        os.write(self._to, json.dumps(message).encode() + b'\0')
        while True:
            answer = self._receive()
            if answer.get('id') == self._last:
                assert 'error' not in answer, answer['error']
                result: dict[str, Any] = answer['result']
                return result
            self._take(answer)

    def _receive(self) -> dict[str, Any]:
        end_s = time.monotonic() + LIMIT_S
        while b'\0' not in self._buffer:
            ready, _, _ = select.select([self._from], [], [], max(end_s - time.monotonic(), 0.0))
            piece = os.read(self._from, 1 << 20) if ready else b''
            if not piece:
                raise AssertionError(f'the browser does not answer: {self._log.read_text()}')
            self._buffer += piece
        text, _, self._buffer = self._buffer.partition(b'\0')
        answer: dict[str, Any] = json.loads(text)
        return answer

    def _take(self, event: dict[str, Any]) -> None:
        """Note that a page has loaded, and what it complains about or asks the network for."""
        method, about = event.get('method', ''), event.get('params', {})
        if method == 'Page.loadEventFired':
            self._loaded = True
        elif method in ('Runtime.exceptionThrown', 'Runtime.consoleAPICalled', 'Log.entryAdded'):
            self.problems.append(json.dumps(about))
        elif method == 'Network.requestWillBeSent':
            url = about['request']['url']
            if not url.startswith(('file:', 'data:', 'about:')):
                self.problems.append(f'asks for {url}')


@pytest.fixture(scope='session')
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        why = f'no browser: none of {", ".join(NAMES)} is installed'
        if os.environ.get(REQUIRED):
            pytest.fail(f'{why}, and {REQUIRED} is set')
        pytest.skip(why)
    browser = Browser(program, tmp_path_factory.mktemp('browser'))
    try:
        yield browser
    finally:
        browser.close()
