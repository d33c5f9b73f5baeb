# SPDX-License-Identifier: Apache-2.0
"""A page of the browser, for files that a verb writes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

LIMIT_MS = 120_000


class Tab:
    """
    One page of the browser; what it complains about and asks the network for is noted.
    """

    def __init__(self, page: Any) -> None:
        self._page = page
        self.problems: list[str] = []
        page.set_default_timeout(LIMIT_MS)
        page.on('console', lambda message: self.problems.append(message.text))
        page.on('pageerror', lambda error: self.problems.append(str(error)))
        page.on('request', self._on_request)

    def _on_request(self, request: Any) -> None:
        if not request.url.startswith(('file:', 'data:', 'about:')):
            self.problems.append(f'asks for {request.url}')

    def open(self, path: Path, *, width: int) -> None:
        """Open a file in a window so wide, and wait until it has loaded."""
        self.problems = []
        self._page.set_viewport_size({'width': width, 'height': 900})
        self._page.goto(path.resolve().as_uri())

    def show_as(self, media: str = 'screen', scheme: str = 'light') -> None:
        """Show the page as on paper (`print`), or in light or dark colours."""
        self._page.emulate_media(media=media, color_scheme=scheme)

    def run(self, script: str) -> Any:
        """Return what a piece of JavaScript gives, as JSON."""
        return self._page.evaluate(script)


@pytest.fixture(scope='module')
def tab(browser: Any) -> Iterator[Tab]:
    page = browser.new_page()
    yield Tab(page)
    page.close()
