# SPDX-License-Identifier: Apache-2.0
"""A coastdown as its instruments read it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import SensitivityError, ShipdragError
from shipdrag_ros.ship import TableBaseline
from shipdrag_ros.simulation import Action, simulate
from shipdrag_ros.studies.sensitivity.coast import LOG_SD_M_S, coast_from, parse_coast
from tests.runs import CARGO


def test_the_coastdown_ends_where_the_ship_has_slowed_to_a_third():
    own = coast_from(CARGO, 8.0)
    truth = simulate(CARGO, own.scenario)
    assert truth.speed_through_water_m_s[-1] == pytest.approx(0.35 * 8.0, rel=0.05)
    assert own.name == 'coastdown:8'
    reading = own.read(CARGO, [Action(), Action(log_factor=0.1)])
    np.testing.assert_allclose(reading[1, :, 0], 1.1 * reading[0, :, 0])
    np.testing.assert_allclose(reading[0, 0, 0], 8.0 / LOG_SD_M_S)
    slower = own.read(CARGO, [Action()], speed_m_s=7.0)
    np.testing.assert_allclose(slower[0, 0, 0], 7.0 / LOG_SD_M_S)


def test_names_of_coastdowns():
    assert parse_coast(CARGO, 'coastdown:7.5').scenario.speed_m_s == 7.5
    top = CARGO.baseline_range_m_s[1]
    assert parse_coast(CARGO, 'coastdown').scenario.speed_m_s == pytest.approx(0.7 * top)
    for text in ('zigzag:15', 'coastdown:', 'coastdown:fast', 'coast'):
        with pytest.raises(SensitivityError, match='expected coastdown or coastdown:SPEED'):
            parse_coast(CARGO, text)
    for text in ('coastdown:20', 'coastdown:1', 'coastdown:nan', 'coastdown:-3'):
        with pytest.raises(SensitivityError, match=r'expected 2\.131\.\.9\.974 m/s'):
            parse_coast(CARGO, text)
    with pytest.raises(ShipdragError, match='no baseline'):
        parse_coast(replace(CARGO, baseline=None), 'coastdown')


def test_a_coastdown_stays_above_the_lowest_speed_of_a_table():
    table = TableBaseline((4.0, 6.0, 9.0), (7e4, 1.7e5, 4.2e5), 0.02)
    ship = replace(CARGO, baseline=table)
    own = coast_from(ship)
    assert np.all(np.isfinite(own.read(ship, [Action()])))
    assert simulate(ship, own.scenario).speed_through_water_m_s[-1] > 4.0
    with pytest.raises(SensitivityError, match=r'begins at 4\.5 m/s, expected 4\.889\.\.9'):
        coast_from(ship, 4.5)
