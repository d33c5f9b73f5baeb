# SPDX-License-Identifier: Apache-2.0
"""What the log keeps of the health: each change, once."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rclpy.logging import get_logger

from shipdrag_ros.coastdown.events import Dismissal, EndedBy, EndedCoastdown, NotCoastdown
from shipdrag_ros.messages.topics import ERROR, OK, WARN
from shipdrag_ros.node.announcer import Announcer, line_of
from shipdrag_ros.node.health import Finding, InputFacts


def seen(name: str, level: int, text: str, *, age_s: float | None = 0.1) -> InputFacts:
    """Return an input as it was judged."""
    return InputFacts(name, age_s=age_s, finding=Finding(level, text))


def test_an_input_that_is_worse_is_logged_once(capfd: pytest.CaptureFixture[str]) -> None:
    announcer = Announcer(get_logger('announcer_of_a_test'))
    well = seen('speed_through_water', OK, 'receiving')
    stuck = seen('position', ERROR, 'it is stuck')
    never = seen('depth', WARN, 'no publisher', age_s=None)
    for _ in range(3):
        announcer.inputs([well, stuck, never])
    lines = [line for line in capfd.readouterr().err.splitlines() if 'announcer_of_a_test' in line]
    assert len(lines) == 1  # what was never heard, and what is well, are not said
    assert lines[0].startswith('[WARN]')
    assert lines[0].endswith(': position: it is stuck')


def test_a_glide_that_was_dismissed_by_its_speed_is_worth_a_look() -> None:
    near = NotCoastdown(0, 10**12, Dismissal.BRAKE, 'something held her back')
    line = line_of(near)
    assert line is not None
    assert 'something held her back; if the engine was stopped there' in line.text
    turned = line_of(replace(near, reason=Dismissal.TURN, text='she turned'))
    assert turned is not None
    assert turned.text == 'nearly a coastdown: she turned'


def test_what_was_cut_from_a_coastdown_is_no_near_miss(capfd: pytest.CaptureFixture[str]) -> None:
    cut = NotCoastdown(0, 10**10, Dismissal.THRUST, 'the thrust ran down for 10 s')
    ended = EndedCoastdown(
        10**10, 10**12, 10**11, EndedBy.ENGINE, None, 'too short', None, cuts=(cut,)
    )
    announcer = Announcer(get_logger('announcer_of_cuts'))
    for one in (ended, replace(ended, withdrawn=True)):
        announcer.event(one)
        announcer.event(cut)
    lines = [line for line in capfd.readouterr().err.splitlines() if 'announcer_of_cuts' in line]
    # of one that was withdrawn, why is said already
    assert [': cut from the coastdown: the thrust' in line for line in lines] == [0, 1, 0]
