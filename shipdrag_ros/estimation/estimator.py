# SPDX-License-Identifier: Apache-2.0
"""What an estimator declares of itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

WindowEstimator = Callable[[Window, Ship, Parameters], Estimate]
"""
From one window to r(v): a pure function, without memory, random numbers or clock.

It raises `EstimationError` if the window does not hold a coastdown that can be estimated.
"""


@dataclass(frozen=True)
class Estimator:
    """
    A way from a window to r(v).

    Attributes
    ----------
    name
        Value of the parameter `estimator`, and of `Estimate.estimator`.
    meaning
        What it is, for a report.
    estimate
    live
        The same in less time, while a coastdown runs; None where it takes none.
    learns_noise
        Whether slow disturbances are learnt, or a note says that they are not.
    constant_order
        Number of coefficients that make r the same at every speed; None where
        orders are averaged.
    caveat
        What its band does not hold; '' for nothing.
    """

    name: str
    meaning: str
    estimate: WindowEstimator
    live: WindowEstimator | None = None
    learns_noise: bool = False
    constant_order: int | None = None
    caveat: str = ''
