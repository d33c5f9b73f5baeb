# SPDX-License-Identifier: Apache-2.0
"""A hidden effect is named, added to the ship, and then no longer missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis import CoastRun, diagnose, with_effects
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation.window import Series
from shipdrag_ros.inference.decision import Verdict
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import StatedEffect
from tests.runs import CARGO as SHIP
from tests.runs import coasted

PARAMETERS = Parameters()


def run(
    *effects: str, heading_rad: float = 0.3, seed: int = 1, lead_in_s: float = 1800.0
) -> CoastRun:
    return coasted(
        *effects,
        lead_in_s=lead_in_s,
        coast_s=1500.0,
        heading_rad=heading_rad,
        reference_rad=0.3,
        seed=seed,
    )


def test_a_run_that_tells_too_little_is_left_out_and_said_so() -> None:
    found = diagnose([run(), run(seed=2, lead_in_s=120.0)], SHIP, PARAMETERS)
    assert found.verdict is Verdict.NONE
    assert found.held_out_before is None
    (left_out,) = (note for note in found.notes if note.startswith('left out: '))
    assert 'at least 300 s are needed' in left_out
    with pytest.raises(DiagnosisError, match='at least 300 s are needed'):
        diagnose([run(lead_in_s=120.0)], SHIP, PARAMETERS)


def test_a_radar_that_bends_the_way_before_the_stop_is_said_to() -> None:
    straight = run()
    assert straight.window.before is not None
    start = straight.window.before.position.value[0]

    def bent(series: Series) -> Series:
        way = series.value - start
        reach = 6000.0
        wrong = 1.0 + 0.03 * np.sin(np.pi * np.hypot(*way.T) / reach)
        return replace(series, value=start + way * wrong[:, None])

    before = replace(straight.window.before, position=bent(straight.window.before.position))
    window = replace(straight.window, position=bent(straight.window.position), before=before)
    found = diagnose([CoastRun('bent', window)], SHIP, PARAMETERS)
    assert found.verdict not in (Verdict.NONE, Verdict.NAMED)
    assert any('wander apart' in note for note in found.notes)


def test_a_drag_for_a_while_without_a_turn_is_not_called_turning() -> None:
    found = diagnose([run('turning=25,start_s=300,duration_s=200,rate_rad_s=0')], SHIP, PARAMETERS)
    assert found.verdict is Verdict.UNKNOWN
    assert found.where is not None
    assert found.where.channel == 'force'


def test_what_is_in_one_run_alone_is_not_asked_of_the_other() -> None:
    turning = 'turning=25,start_s=300,duration_s=200,rate_rad_s=0.001'
    runs = [run(turning), run(heading_rad=0.3 + 3.14159, seed=2)]
    found = diagnose(runs, SHIP, PARAMETERS)
    assert found.candidates[0].names == ('turning',)
    assert found.verdict in (Verdict.NAMED, Verdict.ONE_OF)
    assert found.held_out_after is not None
    assert found.held_out_after.chi2_per_sample < 1.5


def test_what_is_hidden_is_named_and_then_no_longer_missing() -> None:
    runs = [run('log_scale=0.1'), run('log_scale=0.1', heading_rad=0.3 + 3.14159, seed=2)]
    found = diagnose(runs, SHIP, PARAMETERS)
    assert found.verdict is Verdict.NAMED
    assert [each.name for each in found.effects] == ['log_scale']
    size = found.effects[0].parameters['factor']
    assert abs(size.value - 0.1) < 3.0 * size.sd
    assert found.after is not None
    assert found.held_out_after is not None
    assert found.after.chi2_per_sample < 0.5 * found.before.chi2_per_sample
    assert found.held_out_after.chi2_per_sample < 1.2
    again = diagnose(runs, with_effects(SHIP, found.effects), PARAMETERS)
    assert again.verdict is Verdict.NONE


def test_water_and_air_of_one_day_in_a_ship_file_are_said_to_be_that() -> None:
    run = coasted(name='today', coast_s=600.0, rate_hz=0.5)
    stated = (
        StatedEffect('current', {'along_track_m_s': Parameter(0.0, 0.1)}),
        StatedEffect('fouling', {'friction_factor': Parameter(0.0, 0.1)}),
    )
    found = diagnose([run], replace(SHIP, effects=stated), Parameters(), advise=False)
    (said,) = [note for note in found.notes if 'one day' in note]
    assert said.startswith('the ship file states current, which')
    assert 'along the heading of today' in said
    assert said in found.summary()
