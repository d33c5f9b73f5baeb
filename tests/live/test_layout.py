# SPDX-License-Identifier: Apache-2.0
"""The page by its boxes: nothing overlaps, nothing is cut off, large letters are large."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import pytest

from shipdrag_ros.live.app import LivePage
from shipdrag_ros.live.source import NodeSource
from shipdrag_ros.messages.topics import ERROR, STALE, WARN, Health, Status

SCREENS = {1920: 1080, 1024: 768, 390: 844}
LETTERS_PX = {1920: 60.0, 1024: 42.0, 390: 26.0}
ACTION_PX = {1920: 26.0, 1024: 19.0, 390: 17.0}
BOXES = """
() => [...document.querySelectorAll(
  'header, #lost, main section:not(.figures), .player, .figures > div, footer')]
  .filter(each => each.offsetParent !== null)
  .map(each => {
    const {left, top, right, bottom} = each.getBoundingClientRect();
    const name = each.id || each.textContent.trim().slice(0, 20) || each.tagName;
    return {name, box: [left, top + scrollY, right, bottom + scrollY]};
  })
"""
CUT_OFF = """
() => [...document.querySelectorAll('p, h1, h2, h3, li, button, label, time, td')]
  .filter(each => each.offsetParent !== null && !each.closest('.scroll, .log'))
  .filter(each => getComputedStyle(each).display !== 'inline')
  .filter(each => each.scrollWidth > each.clientWidth + 1)
  .map(each => each.textContent.trim().slice(0, 40))
"""
LETTERS = 'id => parseFloat(getComputedStyle(document.getElementById(id)).fontSize)'
HUMBLE = 'name => document.querySelector(name).getBoundingClientRect().bottom'


def assert_sound(page: Any, width: int) -> None:
    page.set_viewport_size({'width': width, 'height': SCREENS[width]})
    page.wait_for_timeout(300)  # charts take their new size
    found = page.evaluate(BOXES)
    assert len(found) >= 12
    for each in found:
        left, top, right, bottom = each['box']
        assert 0.0 <= left < right <= width + 0.5, each
        assert bottom - top >= 20.0, each
    for one, other in combinations(found, 2):
        a, b = one['box'], other['box']
        apart = (
            a[2] <= b[0] + 0.5 or b[2] <= a[0] + 0.5 or a[3] <= b[1] + 0.5 or b[3] <= a[1] + 0.5
        )
        assert apart, (width, one, other)
    assert page.evaluate(CUT_OFF) == []
    assert page.evaluate(LETTERS, 'headline') >= LETTERS_PX[width]
    assert page.evaluate(LETTERS, 'action') >= ACTION_PX[width]
    assert page.evaluate(HUMBLE, '#state') <= 0.5 * SCREENS[width]  # seen at once
    if width == 1920:
        assert page.evaluate(HUMBLE, '#shafts') <= SCREENS[width]  # all charts on one screen


def health(level: int, text: str) -> Health:
    """A node whose inputs are sick, with long words."""
    values = {'lifecycle': 'active', 'monitor': 'waiting', 'steady lead [s]': '0'}
    rejected = {'rejected out_of_order': '120', 'rejected absurd': '31', 'rejected frozen': '7'}
    names = ('speed_through_water', 'speed_over_ground', 'position', 'heading', 'wind_apparent')
    return Health(
        (
            Status('a/node', 'state', ERROR, text, values),
            *(Status('a/node', f'input {name}', level, text, rejected) for name in names),
        )
    )


@pytest.mark.parametrize(
    ('level', 'text'),
    [
        (None, ''),
        (WARN, 'two publishers of one topic: /ais/speed_over_ground, /gnss/speed_over_ground'),
        (STALE, 'no data for 431 s; the clock of the sensor is 12.3 s behind'),
    ],
)
def test_before_there_is_anything_to_show(serving, view, level, text):
    source = NodeSource()
    with serving(LivePage(source)) as url:
        if level is not None:
            source.hear(health(level, text))
        viewer = view(url)
        viewer.wait_for('#headline', 'NO')  # no node, no speed, or one that is silent by now
        assert not viewer.page.is_visible('#player')  # nothing is played
        for width in SCREENS:
            if level is not None:
                source.hear(health(level, text))  # still there
            assert_sound(viewer.page, width)
