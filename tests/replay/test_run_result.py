# SPDX-License-Identifier: Apache-2.0
"""A true curve survives its file to the last bit; several coastdowns together, and ranked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipdrag_ros.errors import BagError, EstimationError
from shipdrag_ros.estimation.result import Estimate, FroudeMax, ResistanceCurve
from shipdrag_ros.replay.run_result import RunResult, TrueCurve, rank, together
from shipdrag_ros.ship import Fact, RunSheet
from shipdrag_ros.ship.model import RunWater
from tests.runs import seen


@given(st.lists(st.floats(0.0, 40.0), min_size=1, max_size=9, unique=True).map(sorted), st.data())
def test_round_trip(speeds: list[float], data: st.DataObject) -> None:
    r = data.draw(st.lists(st.floats(-1.0, 1.0), min_size=len(speeds), max_size=len(speeds)))
    curve = TrueCurve(np.array(speeds), np.array(r), {'seed': 1, 'ship': 'Vitus'})
    back = TrueCurve.from_yaml(curve.to_yaml(), subject='a.mcap')
    np.testing.assert_array_equal(back.speed_m_s, curve.speed_m_s)
    np.testing.assert_array_equal(back.resistance_m_s2, curve.resistance_m_s2)
    assert back.settings == curve.settings


@pytest.mark.parametrize(
    'text',
    [
        '',
        '[',
        'settings: {}',
        'settings: {}\nspeed_m_s: [a]\nresistance_m_s2: [1]',
        'settings: {}\nspeed_m_s: [1, 2]\nresistance_m_s2: [1]',
        'settings: {}\nspeed_m_s: [2, 1]\nresistance_m_s2: [1, 1]',
        'settings: 3\nspeed_m_s: [1]\nresistance_m_s2: [1]',
    ],
)
def test_what_is_no_true_curve_is_refused(text: str) -> None:
    with pytest.raises(BagError, match=r'^a\.mcap: truth\.yaml '):
        TrueCurve.from_yaml(text, subject='a.mcap')


def test_outside_the_curve_nothing_is_known() -> None:
    speed = np.linspace(0.0, 8.2, 83)
    truth = TrueCurve(speed, speed**2 / 3100.0, {'speed_m_s': 8.2, 'seed': 1})
    at = truth.at(np.array([-1.0, 4.0, 9.0]))
    assert np.isnan(at[[0, 2]]).all()
    np.testing.assert_allclose(at[1], 16.0 / 3100.0, rtol=1e-12)


DAY_NS = 86_400 * 1_000_000_000


def later(run: RunResult, *, days: float, factor: float, bag: str = 'later.mcap') -> RunResult:
    """The same coastdown some days on, with more resistance."""
    (coastdown,) = run.coastdowns
    estimate = coastdown.estimate
    assert estimate is not None
    shift = round(days * DAY_NS)
    moved = replace(
        estimate,
        start_ns=estimate.start_ns + shift,
        end_ns=estimate.end_ns + shift,
        calm=replace(estimate.calm, resistance_m_s2=factor * estimate.calm.resistance_m_s2),
    )
    start, end = coastdown.start_ns + shift, coastdown.end_ns + shift
    there = replace(coastdown, start_ns=start, end_ns=end, estimate=moved)
    return replace(run, run=seen(bag), coastdowns=(there,))


def test_months_later_more_resistance_is_another_state(run: RunResult) -> None:
    found = together([run, later(run, days=90.0, factor=1.25)])
    assert found.combined is None
    assert found.why_not.startswith('these runs differ at 12.0 knots (2023-11-14: 2')
    assert '2024-02-12: 3' in found.why_not
    assert 'one state of the hull does not fit all' in found.why_not


def test_dates_that_share_no_speed_are_not_one_curve(run: RunResult) -> None:
    parts = []
    for i, (first, last) in enumerate([(0.0, 0.5), (0.4, 0.7), (0.6, 1.0)]):
        part = later(run, days=90.0 * i, factor=1.0)
        (coastdown,) = part.coastdowns
        assert coastdown.estimate is not None
        low, high = coastdown.estimate.froude_valid
        valid = low + first * (high - low), low + last * (high - low)
        cut = replace(coastdown, estimate=replace(coastdown.estimate, froude_valid=valid))
        parts.append(replace(part, coastdowns=(cut,)))
    found = together(parts)
    assert found.combined is None
    assert 'of different dates, and no speed is common to all' in found.why_not


def test_of_many_dates_the_least_and_the_most_are_named(run: RunResult) -> None:
    found = together([later(run, days=90.0 * i, factor=1.0 + 0.1 * i) for i in range(5)])
    assert 'of 5 dates the least and the most: 2023-11-14: ' in found.why_not
    assert '; 2024-11-08: ' in found.why_not
    assert '2024-02-12' not in found.why_not


def test_what_is_known_of_a_run_makes_no_other_ship_but_her_load_does(run: RunResult) -> None:
    other = later(run, days=1.0, factor=1.0)
    sheet = RunSheet(facts=(Fact('calm'),), water=RunWater(temperature_c=4.0))
    known = sheet.of(run.ship, subject='run.yaml')
    assert together([run, replace(other, ship=known)]).combined is not None
    loaded = replace(run.ship, displaced_volume_m3=1.05 * run.ship.displaced_volume_m3)
    assert 'loaded otherwise' in together([run, replace(other, ship=loaded)]).why_not


def test_months_later_the_same_resistance_is_the_same_state(run: RunResult) -> None:
    # the bands are 1.6 % each; with 2 % from run to run, 5 % more is 1.4 standard deviations
    found = together([run, later(run, days=90.0, factor=1.05)])
    assert found.combined is not None
    assert found.combined.runs == 2


def test_runs_of_one_day_show_wind_and_sea(run: RunResult) -> None:
    found = together([run, later(run, days=0.1, factor=1.25)])
    assert found.combined is not None


def coasted(estimate: Estimate, top: float, rule: FroudeMax) -> Estimate:
    """r(v) whose rise is steepest at `top` and then abates, or that ends there still rising."""
    end = top + 0.04 if rule is FroudeMax.INFLECTION else top
    froude = np.linspace(0.05, end, 1 + round((end - 0.05) / 0.001))
    slope = 1.0 - 50.0 * np.maximum(froude - top - 1e-9, 0.0) + froude
    points = np.ones_like(froude)
    curve = ResistanceCurve(
        froude, froude, points, points, froude, slope, 0.01 * points, by_current_1_s=points
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
        run=seen(f'{name}.mcap'),
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
    nothing = replace(run, run=seen('nothing.mcap'), coastdowns=())
    with pytest.raises(EstimationError, match=r"1 of 2 .* at least 2 .*'nothing\.mcap'"):
        rank([run, nothing])


def test_a_bag_without_an_estimate_is_named(run: RunResult) -> None:
    nothing = replace(run, run=seen('nothing.mcap'), coastdowns=())
    ranking = rank([run, replace(run, run=seen('b.mcap')), nothing])
    assert any('nothing.mcap' in note for note in ranking.notes)
