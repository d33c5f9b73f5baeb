# SPDX-License-Identifier: Apache-2.0
"""Runs between which the hull changed have a size each; runs of one hull have one for all."""

from __future__ import annotations

import pytest

from shipdrag_ros.diagnosis import CoastRun, diagnose, words
from shipdrag_ros.inference.decision import Verdict
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Fact
from tests.runs import CARGO as SHIP
from tests.runs import coasted

FACTS = (*map(Fact, ('no_towed_cable', 'deep_water', 'draughts_read')), Fact('shaft', 'free'))


def run(name: str, fouling: float, seed: int) -> CoastRun:
    effects = [f'fouling={fouling}'] if fouling else []
    return coasted(*effects, name=name, coast_s=1000.0, rate_hz=0.5, seed=seed)


@pytest.mark.parametrize('sizes', [(0.0, 0.35), (0.3, 0.3)])
def test_runs_differ_where_one_hull_does_not_fit_both(sizes: tuple[float, float]) -> None:
    runs = [run(str(j), fouling, seed=j) for j, fouling in enumerate(sizes)]
    found = diagnose(runs, SHIP, Parameters(), facts=FACTS)
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert effect.name == 'fouling'
    last = effect.parameters['friction_factor']
    assert abs(last.value - sizes[1]) < 3.0 * last.sd
    if sizes[0] == sizes[1]:
        assert found.runs_differ == ()
        assert words.differing(found.runs_differ) == ''
        return
    assert [each.run for each in found.runs_differ] == ['0', '1']
    for each, size in zip(found.runs_differ, sizes, strict=True):
        assert (each.effect, each.parameter) == ('fouling', 'friction_factor')
        assert abs(each.size.value - size) < 3.0 * each.size.sd
        assert each.size.sd < 0.08
    assert found.held_out_after is None  # no run tells of another
    assert found.where is not None
    assert found.where.channel == 'force'
    first, second, *_ = found.summary()
    assert first.startswith('Missing in the model, and not alike in these runs: fouling')
    assert second.startswith('These runs differ: no one state of the hull fits all')
