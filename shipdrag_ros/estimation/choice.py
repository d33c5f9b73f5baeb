# SPDX-License-Identifier: Apache-2.0
"""Which estimator a parameter stands for."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import motion_fit, s1, warped
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import MOTION_INPUTS
from shipdrag_ros.ship import Ship

_LARGEST = 1e9  # m, m/s: far above any ship's, and far below where squares and powers overflow


def check_size(window: Window) -> None:
    """
    Refuse readings of a size that no ship has.

    Raises
    ------
    EstimationError
        If an input of motion holds one.
    """
    for part in (window, window.before):
        for name in MOTION_INPUTS if part is not None else ():
            size = np.abs(getattr(part, name).value)
            if np.any(size > _LARGEST):
                raise EstimationError(
                    f'{name} holds {size.max():.3g}, which no ship has: give metres and metres '
                    'a second, and leave such readings out'
                )


def estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    """
    Estimate r(v) from one window, by the estimator that is asked for.

    Parameters
    ----------
    window
        Accepted samples.
    ship
        For n_r and the Froude number.
    parameters
        `estimator` among them; `auto` is `warped`.

    Raises
    ------
    EstimationError
        If the window does not hold a coastdown that can be estimated.
    """
    check_size(window)
    if parameters.estimator in ('auto', warped.NAME):
        return warped.estimate(window, ship, parameters)
    if parameters.estimator == motion_fit.NAME:
        return motion_fit.estimate(window, ship, parameters)
    return s1.estimate(window, ship, parameters)
