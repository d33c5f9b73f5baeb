# SPDX-License-Identifier: Apache-2.0
"""
What holds for all tests.

Property tests try the same examples each time, new ones with
`--hypothesis-profile=default`. What was skipped for want of a browser is told.
"""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile('repeatable', derandomize=True)
settings.load_profile('repeatable')

NO_BROWSER = 'no browser'


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Count what no browser has opened, in one line."""
    skipped = [
        report
        for report in terminalreporter.stats.get('skipped', [])
        if isinstance(report.longrepr, tuple) and NO_BROWSER in report.longrepr[2]
    ]
    if skipped:
        terminalreporter.write_line(
            f'{len(skipped)} tests skipped: {NO_BROWSER}; with Chromium (apt-get install '
            'chromium) they open every kind of page'
        )


class Page(HTMLParser):
    """Text, pictures and links of a page; every tag that is opened is closed."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.words: list[str] = []
        self.images: list[str] = []
        self.links: list[str] = []
        self.open: list[str] = []
        self.feed(path.read_text(encoding='utf-8'))
        assert self.open == []
        self.text = re.sub(r'\s+', ' ', ' '.join(self.words))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag == 'img':
            self.images.append(values['src'] or '')
            assert values['alt']
        if 'href' in values or (tag != 'img' and 'src' in values):
            self.links.append(tag)
        if tag not in ('img', 'meta', 'br'):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != 'style':
            self.words.append(data)


@pytest.fixture
def read_page() -> type[Page]:
    return Page
