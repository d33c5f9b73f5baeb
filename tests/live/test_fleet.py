# SPDX-License-Identifier: Apache-2.0
"""The page of the fleet under the live page, in a real browser."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import httpx

from shipdrag_ros.cli.on_board import fleet_pages
from shipdrag_ros.cli.output import Output
from shipdrag_ros.live.app import LivePage
from shipdrag_ros.live.source import NodeSource

get = partial(httpx.get, timeout=200.0)  # drawn when it is asked for


def test_the_fleet_stands_under_the_page(serving: Any, browser: Any, fleet_store: Path) -> None:
    page = LivePage(NodeSource(), fleet=fleet_pages(Output(), fleet_store))
    with serving(page) as url:
        answer = get(f'{url}fleet')
        assert 'script-src' not in answer.headers['content-security-policy']
        assert answer.headers['content-security-policy'].startswith("default-src 'none'")
        tab = browser.new_page()
        said: list[str] = []
        tab.on('console', lambda message: said.append(message.text))
        tab.goto(url)
        tab.get_by_role('link', name='The fleet').click()
        tab.wait_for_url('**/fleet')
        assert tab.locator('h1').inner_text() == 'Trend of the fleet'
        wide = tab.evaluate('getComputedStyle(document.body).maxWidth')
        assert wide != 'none'  # its own style counts
        assert tab.evaluate('document.images[0].naturalWidth') > 0
        dates = tab.locator('td a')
        assert dates.count() == 12
        dates.first.click()
        tab.wait_for_url('**/fleet/*')
        assert 'coastdown of' in tab.locator('h1').inner_text()
        assert tab.evaluate('document.images[0].naturalWidth') > 0
        tab.get_by_role('link', name='The fleet').click()
        tab.wait_for_url('**/fleet')
        assert get(f'{url}fleet/..%2fstate.json').status_code == 404
        assert said == []
        tab.close()


def test_without_a_store_there_is_no_fleet(serving: Any) -> None:
    with serving(LivePage(NodeSource())) as url:
        answer = get(f'{url}fleet')
    assert answer.status_code == 404
    assert '--store' in answer.text
