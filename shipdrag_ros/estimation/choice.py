# SPDX-License-Identifier: Apache-2.0
"""Which estimator a parameter stands for."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.estimators import named
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
        `estimator` among them; `auto` is `log_time`.

    Returns
    -------
    Estimate
        r(v) [m/s^2] with its standard deviation, its valid range and notes.

    Raises
    ------
    EstimationError
        If the window does not hold a coastdown that can be estimated.

    Notes
    -----
    Source: S1 for `s1_*`; docs/method.md for `log_time`.

    Examples
    --------
    >>> from importlib import resources
    >>> from shipdrag_ros.ship import Ship
    >>> ship = Ship.load(resources.files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')
    >>> from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors
    >>> scenario = Scenario(speed_m_s=6.0, duration_s=900.0)
    >>> block = sense(simulate(ship, scenario), standard_sensors(), seed=1)
    >>> from shipdrag_ros.estimation import Window
    >>> stop_ns = START_NS + round(scenario.lead_in_s * 1e9)
    >>> end_ns = START_NS + round(scenario.length_s * 1e9)
    >>> from shipdrag_ros.estimation import estimate
    >>> from shipdrag_ros.parameters import Parameters
    >>> found = estimate(Window.from_block(block, stop_ns, end_ns), ship, Parameters())
    >>> found.estimator, len(found.curve) > 50
    ('log_time', True)
    """
    check_size(window)
    chosen = named(parameters.estimator)
    return (chosen.live or chosen.estimate)(window, ship, parameters)
