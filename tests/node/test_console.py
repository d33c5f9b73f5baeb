# SPDX-License-Identifier: Apache-2.0
"""The live line of a terminal, from what the node says of itself."""

from __future__ import annotations

import io

from shipdrag_ros.messages.heard import Health, Status
from shipdrag_ros.node.console import line, terminal_line

STATE = {
    'lifecycle': 'active',
    'monitor': 'steady',
    'steady lead [s]': '600',
    'steady lead used at most [s]': '1800',
}
FIGURES = {
    'speed through water [m/s]': '5.144444',
    'specific resistance [m/s^2]': '0.02',
    'standard deviation of it [m/s^2]': '0.0005',
}


def test_it_holds_state_figure_and_inputs() -> None:
    health = Health(
        (
            Status('n', 'state', 0, 'steady', STATE),
            Status('n', 'input heading', 1, 'frozen', {'messages': '5'}),
            Status('n', 'input depth', 0, 'no publisher', {'messages': '0'}),
            Status('n', 'estimate', 0, '', FIGURES),
        )
    )
    assert line(health) == (
        'steady 10 of 30 min | last at 10.0 kn: r 0.0200 m/s² ± 5 % | 1 inputs, not well: heading'
    )


def test_what_keeps_it_from_estimating_comes_first() -> None:
    health = Health((Status('n', 'state', 2, 'no data: nothing on any of a', STATE),))
    assert line(health).startswith('no data: nothing on any of a |')


def test_an_input_that_is_not_well_hides_no_state() -> None:
    state = Status('n', 'state', 1, 'steady; not well, heading: stuck', STATE)
    assert line(Health((state,))).startswith('steady 10 of 30 min |')


def test_without_a_terminal_there_is_no_line() -> None:
    assert terminal_line(io.StringIO()) is None
