# SPDX-License-Identifier: Apache-2.0
"""What is said of coastdowns, and of what was none."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.coastdown.events import Dismissal, Dismissals, EndedBy, NotCoastdown, Regimes


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


def test_what_ended_a_glide_is_what_probably_did() -> None:
    probability = {name: np.zeros(4) for name in ('driven', 'braked', 're_engaged', 'turning')}
    probability['re_engaged'][2:] = 0.3, 0.4
    probability['driven'][3] = 0.2
    probability['braked'][1] = 0.9  # before the end
    regimes = Regimes(np.arange(4) * 5, np.ones(4), probability, 0.0, 1.0)
    assert regimes.ends(7) == {
        EndedBy.ENGINE: pytest.approx(0.6),
        EndedBy.BRAKE: 0.0,
        EndedBy.TURN: 0.0,
    }
    assert regimes.ended_by(EndedBy.TURN, 7) is EndedBy.ENGINE
    assert regimes.ended_by(EndedBy.SPEED, 7) is EndedBy.SPEED
    assert regimes.ended_by(EndedBy.BRAKE, 20) is EndedBy.BRAKE  # nothing came after it
