# SPDX-License-Identifier: Apache-2.0
"""The estimators of S1, as published."""

from __future__ import annotations

from dataclasses import replace

from shipdrag_ros.estimation.estimators import Estimator
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.s1.estimate import PROBLEMS, estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

__all__ = ['estimate', 'published']

_CAVEAT = (
    'The band holds the noise of the sensors and the uncertainty of the added mass, not the error '
    'of the polynomial itself: towards the highest speeds, where the run-down of the engine lies, '
    'the true error can be several times larger.'
)


def published(name: str, meaning: str) -> Estimator:
    """
    Return one of the published problems as an estimator.

    Parameters
    ----------
    name
        A key of `PROBLEMS`.
    meaning
        What it is, for a report.
    """

    def of_problem(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
        return estimate(window, ship, replace(parameters, estimator=name))

    return Estimator(
        name=name,
        meaning=meaning,
        estimate=of_problem,
        constant_order=PROBLEMS[name].order,
        caveat=_CAVEAT,
    )
