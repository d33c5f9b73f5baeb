# SPDX-License-Identifier: Apache-2.0
"""A page as a reader without a browser sees it."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path


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
        inside = (values.get('href') or '').startswith('#')
        if ('href' in values and not inside) or (tag != 'img' and 'src' in values):
            self.links.append(tag)
        if tag not in ('img', 'meta', 'br'):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != 'style':
            self.words.append(data)
