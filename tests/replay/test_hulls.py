# SPDX-License-Identifier: Apache-2.0
"""Hulls are ranked by Fr_max, and a bound is not sold as a find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.result import Estimate, FroudeMax, ResistanceCurve
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.together import rank


def coasted(estimate: Estimate, top: float, rule: FroudeMax) -> Estimate:
    """r(v) whose rise is steepest at `top` and then abates, or that ends there still rising."""
    end = top + 0.04 if rule is FroudeMax.INFLECTION else top
    froude = np.linspace(0.05, end, 1 + round((end - 0.05) / 0.001))
    slope = 1.0 - 50.0 * np.maximum(froude - top - 1e-9, 0.0) + froude
    points = np.ones_like(froude)
    curve = ResistanceCurve(
        froude, froude, points, points, froude, slope, slope_sigma=np.full_like(froude, 0.01)
    )
    # as of an estimator that is valid to the top of the branch whatever r does
    return replace(
        estimate, conditions=curve, froude_valid=(0.05, end), froude_max_by=FroudeMax.BRANCH_TOP
    )


def hull(run: RunResult, name: str, *found: tuple[float, FroudeMax]) -> RunResult:
    part = run.coastdowns[0]
    assert part.estimate is not None
    return replace(
        run,
        bag=f'{name}.mcap',
        ship=replace(run.ship, name=name),
        coastdowns=tuple(
            replace(part, estimate=coasted(part.estimate, top, rule)) for top, rule in found
        ),
    )


def test_the_higher_stands_first(run: RunResult) -> None:
    low = hull(run, 'low', (0.15, FroudeMax.INFLECTION))
    high = hull(run, 'high', (0.19, FroudeMax.INFLECTION))
    for runs in ([low, high], [high, low]):
        ranking = rank(runs)
        assert [item.label for item in ranking.hulls] == ['high', 'low']
        assert not any('lower bound' in note for note in ranking.notes)


def test_a_find_goes_before_a_bound_and_the_middle_find_is_shown(run: RunResult) -> None:
    several = hull(
        run,
        'several',
        (0.16, FroudeMax.INFLECTION),
        (0.20, FroudeMax.BRANCH_TOP),
        (0.15, FroudeMax.INFLECTION),
        (0.17, FroudeMax.INFLECTION),
    )
    bound = hull(run, 'bound', (0.12, FroudeMax.BRANCH_TOP), (0.14, FroudeMax.BRANCH_TOP))
    first, second = rank([bound, several]).hulls
    assert (first.froude_max, *first.others) == pytest.approx((0.16, 0.15, 0.17))
    assert second.froude_max == pytest.approx(0.14)
    assert second.found_by is FroudeMax.BRANCH_TOP


def test_a_bound_is_called_one(run: RunResult) -> None:
    ranking = rank(
        [
            hull(run, 'a', (0.15, FroudeMax.BRANCH_TOP)),
            hull(run, 'b', (0.19, FroudeMax.INFLECTION)),
        ]
    )
    assert any('No steepest rise of r was found for a:' in note for note in ranking.notes)


def test_one_hull_is_not_a_comparison(run: RunResult) -> None:
    nothing = replace(run, bag='nothing.mcap', coastdowns=())
    with pytest.raises(EstimationError, match=r"1 of 2 .*'nothing\.mcap'"):
        rank([run, nothing])


def test_a_bag_without_an_estimate_is_named(run: RunResult) -> None:
    nothing = replace(run, bag='nothing.mcap', coastdowns=())
    ranking = rank([run, replace(run, bag='b.mcap'), nothing])
    assert any('nothing.mcap' in note for note in ranking.notes)
