# SPDX-License-Identifier: Apache-2.0
"""Traces hold what was measured and what two models say of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shipdrag_ros.diagnosis.result import DiagnosisResult

LEAD_IN_S, COAST_S, CURRENT_M_S = 1800.0, 1500.0, 0.4  # of the run


def test_each_quantity_is_held_against_the_model(found: DiagnosisResult) -> None:
    (trace,) = found.traces
    assert trace.name == '<outward>'
    assert trace.lead_in_s == pytest.approx(LEAD_IN_S, abs=60.0)
    names = [each.quantity for each in trace.compared]
    assert names == ['speed_through_water', 'position', 'position_across']
    for each in trace.compared:
        assert (np.diff(each.time_s) > 0.0).all()
        assert each.time_s[0] < -1500.0 < 1400.0 < each.time_s[-1]
        assert each.speed_m_s[0] == pytest.approx(8.0, abs=0.05)
        assert each.speed_m_s[-1] < 4.0


def test_the_gap_is_that_of_the_traces(found: DiagnosisResult) -> None:
    log, ahead, across = found.traces[0].compared
    coasting = log.time_s >= 0.0
    for gap, simulated in ((found.before, log.before), (found.after, log.after)):
        assert gap is not None
        rms = math.sqrt(np.mean((log.measured - simulated)[coasting] ** 2))
        assert gap.rms_speed_m_s == pytest.approx(rms, rel=1e-9)
    assert found.after is not None
    white = np.concatenate([each.white_after for each in (log, ahead, across)])
    # of a run without more context than its heading, hardly anything else counts
    assert np.mean(white**2) == pytest.approx(found.after.chi2_per_sample, rel=0.3)


def test_what_a_current_carries_away_is_missing_before(found: DiagnosisResult) -> None:
    position = found.traces[0].compared[1]
    missed = (position.measured - position.before)[-1] - (position.measured - position.before)[0]
    assert missed == pytest.approx(CURRENT_M_S * (LEAD_IN_S + COAST_S), rel=0.05)
    assert abs((position.measured - position.after)[-1]) < 2.0 * position.sd[-1]
    assert np.abs(position.white_before).max() > 3.0 > np.abs(position.white_after).max() - 1.0


def test_noise_grows_where_it_adds_up(found: DiagnosisResult) -> None:
    log, position, _ = found.traces[0].compared
    assert (log.sd > 0.0).all()
    assert log.sd.max() < 0.1
    # the water carries a ship ever farther
    assert position.sd[-1] > 2.0 * position.sd[5]
