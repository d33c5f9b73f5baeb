# SPDX-License-Identifier: Apache-2.0
"""Of several instruments of a kind the diagnosis takes the first that was heard, and says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun
from shipdrag_ros.diagnosis.diagnose import observed
from shipdrag_ros.estimation import Window
from shipdrag_ros.inference.rows import LOG, POSITION
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel
from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors

FIRST, SECOND = Channel.SPEED_THROUGH_WATER, Channel.SPEED_THROUGH_WATER_2


@pytest.mark.parametrize('first_heard', [True, False])
def test_the_first_that_was_heard_is_used_and_what_the_other_reads_is_said(cargo, first_heard):
    scenario = Scenario(speed_m_s=8.0, lead_in_s=900.0, duration_s=900.0)
    inputs = ('speed_through_water', 'speed_through_water_2', 'position')
    block = sense(simulate(cargo, scenario), standard_sensors(inputs=inputs), seed=5)
    off = np.where(block.channel == SECOND, 1.04, 1.0)[:, None]
    block = replace(block, value=off * block.value)
    if not first_heard:
        block = block[block.channel != FIRST]
    stop_ns = START_NS + 900 * 10**9
    window = Window.from_block(
        block, stop_ns, int(block.stamp_ns.max()), before_ns=int(block.stamp_ns.min())
    )
    run = CoastRun('run', window)
    (seen,), notes = observed([run], cargo, Parameters(), {}, lambda *_: None)
    assert set(seen.along.rows.kind.tolist()) == {LOG, POSITION}
    if first_heard:
        (note,) = notes
        beside = 'run: speed_through_water_2 is not used beside speed_through_water, against '
        assert note.startswith(f'{beside}which it reads +')
        assert float(note.split('reads ')[1].split(' ')[0]) == pytest.approx(4.0, abs=0.5)
        assert seen.speed_m_s == pytest.approx(8.0, rel=0.01)
    else:
        assert notes == ()
        assert seen.speed_m_s == pytest.approx(8.32, rel=0.01)
