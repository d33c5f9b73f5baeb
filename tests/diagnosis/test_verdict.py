# SPDX-License-Identifier: Apache-2.0
"""What is answered, how runs differ, and how far model and data are apart."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis.diagnose import asked
from shipdrag_ros.diagnosis.observation import Observation, ship_runs
from shipdrag_ros.diagnosis.verdict import (
    _channel,
    _falsified,
    _modes,
    _points,
    gap_of,
    held_out,
    judge,
    runs_differ,
)
from shipdrag_ros.inference.decision import NONE, UNKNOWN, Verdict
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import ComparedHypotheses, Comparing, Fitted
from shipdrag_ros.posterior.effects import ways_of
from shipdrag_ros.posterior.hypotheses import IN_GROUND, IN_LOG, QUICK_IN_LOG, Explanation
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import CoefficientBaseline, Ship
from shipdrag_ros.simulation.effects import LIBRARY, find
from tests.runs import coasted

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


HEADINGS = (0.7, 0.7 + math.pi)


@pytest.fixture(scope='module')
def seen(cargo: Ship) -> tuple[Observation, ...]:
    """Two runs of a ship whose friction is 6 % more than stated, three prior sd."""
    base = cargo.baseline
    assert isinstance(base, CoefficientBaseline)
    rougher = replace(base, form_factor=1.06 * (1.0 + base.form_factor) - 1.0)
    rough = replace(cargo, baseline=rougher)
    runs = [
        coasted(name=str(seed), ship=rough, heading_rad=heading_rad, seed=seed)
        for seed, heading_rad in enumerate(HEADINGS)
    ]
    return tuple(Observation.of(run.window, cargo, Parameters(), name=run.name) for run in runs)


def test_a_held_out_run_is_judged_by_what_the_other_shows(seen, cargo):
    comparing = Comparing(ship_runs(seen, cargo), cargo, ())
    nothing = comparing.fit_nothing()
    assert nothing.tables is not None
    _, mean, precision = comparing.prior_of(nothing)
    lines: list[Float64] = []
    for j, table in enumerate(nothing.tables):
        white = np.hstack([comparing.white(j, table, comparing.runs.runs[j]), table.rest])
        whole = np.zeros((1 + len(mean), white.shape[1]))
        whole[0], whole[1 + table.place] = white[0], white[1:]
        lines.append(whole)
    chi2 = 0.0
    for own, other in ((0, 1), (1, 0)):
        # by hand: the posterior of the other run, and the covariance of what it predicts
        left, slopes = lines[other][0], lines[other][1:]
        unit = precision**-0.5
        of_unit = slopes * unit[:, None]
        covariance = np.linalg.inv(np.eye(len(mean)) + of_unit @ of_unit.T)
        at = covariance @ (of_unit @ left + mean / unit)
        ahead = lines[own][1:] * unit[:, None]
        away = lines[own][0] - at @ ahead
        chi2 += float(
            away @ np.linalg.solve(np.eye(len(away)) + ahead.T @ covariance @ ahead, away)
        )
    found = held_out(seen, comparing, nothing)
    assert found is not None
    rows = sum(each.shape[1] for each in lines)
    assert found.chi2_per_sample == pytest.approx(chi2 / rows, rel=1e-4)
    assert found.chi2_per_sample < 1.3
    assert held_out(seen, comparing, comparing.as_stated).chi2_per_sample > found.chi2_per_sample  # type: ignore[union-attr]
    fitted = gap_of(seen, comparing.residuals(nothing))
    assert fitted.rms_speed_m_s is not None
    assert found.rms_speed_m_s is not None
    assert fitted.rms_speed_m_s < found.rms_speed_m_s < 3.0 * fitted.rms_speed_m_s


def test_one_run_predicts_nothing(seen: tuple[Observation, ...], cargo: Ship) -> None:
    comparing = Comparing(ship_runs(seen[:1], cargo), cargo, ())
    assert held_out(seen[:1], comparing, comparing.fit_nothing()) is None


@pytest.mark.parametrize(
    ('behind', 'channel'),
    [
        ({IN_LOG: 0.0, QUICK_IN_LOG: 30.0, IN_GROUND: 0.1}, 'log_radar'),
        ({IN_LOG: 30.0, QUICK_IN_LOG: 0.0, IN_GROUND: 0.1}, 'log_radar'),
        ({IN_LOG: 0.2, QUICK_IN_LOG: 0.0, IN_GROUND: 30.0}, 'log'),
        ({IN_LOG: 30.0, QUICK_IN_LOG: 30.0, IN_GROUND: 0.0}, 'radar'),
    ],
)
def test_log_and_radar_are_not_told_apart_where_either_explains_as_much(behind, channel):
    fits = []
    for smooth, less in behind.items():
        fits.append(Fitted(Explanation(smooth=smooth), np.zeros(0), log_evidence=-less))
    assert _channel(ComparedHypotheses((), tuple(fits))) == channel


@pytest.mark.parametrize(
    ('named', 'channel'),
    [
        (('log_scale',), 'log'),
        (('log_lag', 'time_offset'), 'log'),
        (('radar_scale',), 'radar'),
        (('log_scale', 'radar_scale'), 'log_radar'),
        (('log_scale', 'fouling'), ''),
        ((), ''),
    ],
)
def test_an_instrument_that_is_named_is_where_they_disagree(named, channel):
    assert _falsified(named) == channel
