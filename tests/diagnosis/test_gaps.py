# SPDX-License-Identifier: Apache-2.0
"""A run that is predicted from the others: chi^2 with the covariance of the prediction."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.diagnosis.gaps import _channel, _falsified, gap_of, held_out
from shipdrag_ros.diagnosis.observation import Observation, ship_runs
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import ComparedHypotheses, Comparing, Fitted
from shipdrag_ros.posterior.hypotheses import IN_GROUND, IN_LOG, QUICK_IN_LOG, Explanation
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import CoefficientBaseline, Ship
from tests.runs import coasted

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
