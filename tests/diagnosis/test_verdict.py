# SPDX-License-Identifier: Apache-2.0
"""Compared hypotheses become probabilities, and these a verdict; nothing stands between."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis.verdict import _modes, _points, asked, judge, runs_differ
from shipdrag_ros.inference.decision import NONE, UNKNOWN, Verdict
from shipdrag_ros.posterior.compare import ComparedHypotheses, Fitted
from shipdrag_ros.posterior.effects import ways_of
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import LIBRARY, find

SHIP = Ship.example()


def fitted(*names: str, weight: float, smooth: str = '', way: int = 0) -> Fitted:
    """Return a fit of some evidence times prior odds."""
    ways = tuple(list(ways_of(find(name), SHIP, 1000.0, 1))[way] for name in names)
    hypothesis = Explanation(ways, smooth)
    q = len(hypothesis.unknowns)
    log = weight - hypothesis.log_odds
    return Fitted(hypothesis, np.zeros(q), log_evidence=log, z=np.zeros(q), sd=np.ones(q))


def compared(*fits: Fitted) -> ComparedHypotheses[Fitted]:
    return ComparedHypotheses((), fits)


def test_evidence_and_prior_are_all_that_counts() -> None:
    fits = fitted(weight=0.0), fitted('current', weight=1.0), fitted('wind', weight=-1.0)
    found = compared(*fits).probability
    total = 1.0 + math.e + math.exp(-1.0)
    assert found[NONE] == pytest.approx(1.0 / total)
    assert found['current',] == pytest.approx(math.e / total)
    assert list(found) == [('current',), (), ('wind',)]


def test_ways_to_be_there_add_up() -> None:
    both = [fitted('turning', weight=0.0, way=way) for way in (0, -1)]
    assert compared(fitted(weight=0.0), *both).probability[NONE] == pytest.approx(1.0 / 3.0)


def test_a_name_with_something_smooth_besides_is_something_without_a_name() -> None:
    more = fitted('current', weight=3.0, smooth='log')
    found = compared(fitted(weight=-50.0), fitted('current', weight=0.0), more)
    assert found.probability[UNKNOWN] == pytest.approx(math.exp(3.0) / (1.0 + math.exp(3.0)))
    assert found.best[UNKNOWN] is more
    judged = judge(found, ())
    assert judged.decision.verdict is Verdict.UNKNOWN
    assert judged.explained is more
    assert not judged.missing


def test_a_size_for_each_run_is_one_name() -> None:
    alike = fitted('fouling', weight=0.0)
    (way,) = alike.hypothesis.ways
    own = tuple(replace(way, run=j) for j in range(2))
    z = np.array([0.1, 1.0])
    each = replace(alike, hypothesis=Explanation(own), at=z, z=z, sd=np.full(2, 0.01))
    assert each.names == ('fouling',)
    first, last = runs_differ(each, ['out', 'back'])
    assert (first.run, last.run) == ('out', 'back')
    assert first.size.value < last.size.value
    (named,) = judge(compared(fitted(weight=-9.0), each), ()).effects
    assert named.parameters['friction_factor'] == last.size
    assert runs_differ(alike, ['out', 'back']) == ()


@pytest.mark.parametrize(
    ('ratio', 'words'),
    [
        (1.94, 'knots over m/s'),
        (0.52, 'm/s over knots'),
        (3.55, 'km/h over m/s'),
        (1.85, 'km/h over knots'),
        (0.28, 'm/s over km/h'),
        (2.24, 'mph over m/s'),
        (1.15, 'mph over knots'),
        (0.62, 'mph over km/h'),
    ],
)
def test_a_ratio_of_two_units_is_asked_about(ratio: float, words: str) -> None:
    assert words in asked(ratio)
    assert '--map speed_through_water=COLUMN:kn' in asked(ratio)


@pytest.mark.parametrize('ratio', [1.0, 0.8, 1.2, 1.4, 0.4, 2.5, 0.0, -1.94, float('nan')])
def test_an_error_of_a_wheel_is_none(ratio: float) -> None:
    assert asked(ratio) == ''


def test_sizes_of_a_delay_that_are_named_are_of_one_sign_with_none_at_all() -> None:
    (way,) = _modes(list(ways_of(LIBRARY['time_offset'], SHIP, 600.0, 1)))
    assert way.start == (0.0,)
    assert _points(way)[0] > 0.0
