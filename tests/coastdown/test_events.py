# SPDX-License-Identifier: Apache-2.0
"""Of each reason one dismissal is said in a span, and the rest of the span as one."""

from __future__ import annotations

from shipdrag_ros.coastdown.events import Dismissal, Dismissals, NotCoastdown


def turn(start_ns: int) -> NotCoastdown:
    return NotCoastdown(start_ns, start_ns + 5, Dismissal.TURN, f'turn at {start_ns}')


def test_the_rest_of_a_span_is_counted_and_said_as_one() -> None:
    said = Dismissals(100)
    assert said.take(turn(0)) == [turn(0)]
    assert [said.take(turn(start)) for start in (20, 40, 60)] == [[], [], []]
    slow = NotCoastdown(62, 70, Dismissal.SLOW, 'slow')
    assert said.take(slow) == [slow]  # each reason by itself
    as_one = NotCoastdown(20, 65, Dismissal.TURN, '3 times, the last: turn at 60')
    assert said.take(turn(120)) == [as_one, turn(120)]
    assert said.take(turn(140)) == []
    assert said.flush() == [turn(140)]
    assert said.flush() == []
    assert said.take(turn(150)) == [turn(150)]
