# SPDX-License-Identifier: Apache-2.0
"""The site is built without a warning, links to nothing outside, and is searched from files."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
LOADED = re.compile(r'<(?:script|link|img|iframe)\b[^>]*?(?:src|href)="(?:https?:)?//[^"]+"')


@pytest.fixture(scope='module')
def site(once: Callable[..., Path]) -> Path:
    pytest.importorskip('mkdocs')
    return once('site', build)


def build(folder: Path) -> None:
    line = [sys.executable, '-m', 'mkdocs', 'build', '--quiet', '--strict', '--site-dir', folder]
    done = subprocess.run(
        line,
        cwd=ROOT,
        env=os.environ | {'NO_MKDOCS_2_WARNING': '1', 'SHIPDRAG_DOCS_QUICK': '1'},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_page_is_there(site: Path) -> None:
    pages = {path.stem for path in (ROOT / 'docs').glob('*.md')}
    assert pages | {'commands'} <= {path.stem for path in site.glob('*.html')}
    assert 'shipdrag diagnose out.mcap' in (site / 'commands.html').read_text(encoding='utf-8')


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    for page in site.rglob('*.html'):
        assert LOADED.findall(page.read_text(encoding='utf-8')) == []


def test_links_to_notebooks_lead_to_their_pages(site: Path) -> None:
    found = re.findall(r'href="(notebooks/[^"]+)"', (site / 'python.html').read_text('utf-8'))
    assert found
    assert all((site / link).is_file() for link in found)


def test_it_is_searched_without_a_server(site: Path, browser: Any) -> None:
    outside: list[str] = []
    page = browser.new_page()
    page.set_default_timeout(60_000)
    page.on('request', lambda it: outside.append(it.url) if it.url[:4] == 'http' else None)
    page.goto(site.joinpath('index.html').as_uri())
    page.keyboard.press('/')
    page.keyboard.type('reciprocal')
    page.wait_for_selector('.md-search-result__link')
    page.close()
    assert outside == []
