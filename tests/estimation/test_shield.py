# SPDX-License-Identifier: Apache-2.0
"""A defect of an estimator costs its figure, and nothing else."""

from __future__ import annotations

import logging

import pytest

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown, NoEstimate, Update
from shipdrag_ros.errors import EstimationError, ShipFileError
from shipdrag_ros.estimation.estimators import shielded
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors
from tests.runs import CARGO as SHIP


def _broken(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    raise ZeroDivisionError('division by zero')


def test_the_monitor_raises_nothing_and_says_what_failed(caplog, defects):
    block = sense(
        simulate(SHIP, Scenario(speed_m_s=6.0, duration_s=900.0)), standard_sensors(), seed=1
    )
    monitor = Monitor(SHIP, Parameters(), estimate=_broken, final=_broken)
    with caplog.at_level(logging.ERROR):
        events = [*monitor.update(block), *monitor.finish()]
    (ended,) = (event for event in events if isinstance(event, EndedCoastdown))
    assert ended.estimate is None
    assert 'ZeroDivisionError: division by zero' in str(ended.failure)
    assert sum(isinstance(event, NoEstimate) for event in events) > 10
    # its trace once, however often it fails
    (record,) = caplog.records
    assert record.exc_info is not None
    defects.clear()


def test_errors_with_words_keep_them() -> None:
    def refuses(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
        raise ShipFileError('ship.yaml', ['length_m: missing'])

    with pytest.raises(EstimationError, match='length_m: missing'):
        shielded(refuses)(None, SHIP, Parameters())  # type: ignore[arg-type]


def test_a_forecast_that_fails_costs_the_forecast_alone(caplog, defects):
    block = sense(
        simulate(SHIP, Scenario(speed_m_s=6.0, duration_s=900.0)), standard_sensors(), seed=1
    )

    def vague(window: Window, ship: Ship, parameters: Parameters) -> Window:
        return window

    monitor = Monitor(SHIP, Parameters(), estimate=vague, final=vague)  # type: ignore[arg-type]
    with caplog.at_level(logging.ERROR):
        events = monitor.update(block)
    updates = [event for event in events if isinstance(event, Update)]
    assert len(updates) > 10
    assert all(update.forecast is None for update in updates)
    assert 'the forecast failed' in caplog.text
    (_,) = caplog.records  # its trace once
    defects.clear()
