# SPDX-License-Identifier: Apache-2.0
"""What the state of the node says."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import MonitorProgress
from shipdrag_ros.coastdown.monitor import State
from shipdrag_ros.messages.topics import OK
from shipdrag_ros.node.health import InputCounts, InputFacts, InputStates, Standing, state_status

PROGRESS = MonitorProgress(0.0, 0.0, None)
ASKED = 'no shaft is received: is the engine stopped, and not astern?'


@pytest.mark.parametrize(
    ('monitor', 'received', 'asked'),
    [
        (State.COASTDOWN, ('speed_through_water',), True),
        (State.COASTDOWN, ('speed_through_water', 'shaft'), False),
        (State.STEADY, ('speed_through_water',), False),
    ],
)
def test_in_a_coastdown_it_asks_for_the_engine_where_no_shaft_tells(monitor, received, asked):
    facts = [
        InputFacts(name, type=name, age_s=0.5, total=InputCounts(9, 9, {})) for name in received
    ]
    inputs = InputStates().tick(facts, simulated=False, now_s=1.0)
    told = cast(Monitor, SimpleNamespace(state=monitor, progress=PROGRESS, steady_lead_s=0.0))
    status = state_status(Standing('active', told, clock_ns=1, sim_time=False), inputs)
    assert status.level == OK
    assert (ASKED in status.message) is asked
