# SPDX-License-Identifier: Apache-2.0
"""
The estimate of a window: while a coastdown runs, and the figure that is kept.

By the estimator that the parameter names. The kept figure says which inputs it rests on where
others are silent.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.coverage import coverage_notes
from shipdrag_ros.estimation.estimators import named
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

_LARGEST = 1e9  # m, m/s: far above any ship's, and far below where squares and powers overflow


def _usable(window: Window) -> Window:
    """
    Leave out inputs with readings of a size that no ship has.

    Raises
    ------
    EstimationError
        If no other input of motion is there.
    """
    why = ''
    for name in window.motion:
        parts = (window,) if window.before is None else (window, window.before)
        size = np.abs(np.concatenate([part.series(name).value.ravel() for part in parts]))
        if np.any(size > _LARGEST):
            why = (
                f'it holds {size.max():.3g}, which no ship has: give metres and metres a second, '
                'and leave such readings out'
            )
            window = window.without(name, why)
    if why and not any(len(window.series(name)) for name in window.motion):
        raise EstimationError(window.notes[-1])
    return window


def estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    """
    Estimate r(v) from the window of a coastdown that runs.

    Parameters
    ----------
    window
        Accepted samples, with the record `before` it.
    ship
        For the law of the hull, n_r, the Froude number and the run-down of the thrust.
    parameters
        `estimator` among them.

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
    Source: docs/model.md for `one`; S1 for `s1_*`.

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
    ('one', True)
    """
    chosen = named(parameters.estimator)
    return (chosen.live or chosen.estimate)(_usable(window), ship, parameters)


def estimate_final(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    """
    Estimate r(v) from a whole coastdown, with time to do so.

    Parameters
    ----------
    window, ship, parameters
        As `estimate` takes them.

    Returns
    -------
    Estimate
        As of `estimate`; with a note of each input that is silent for part of it.

    Raises
    ------
    EstimationError
        If the window does not hold a coastdown that can be estimated.

    Notes
    -----
    Source: as `estimate`.

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
    >>> import numpy as np
    >>> from shipdrag_ros.estimation import estimate_final
    >>> from shipdrag_ros.parameters import Parameters
    >>> window = Window.from_block(block, stop_ns, end_ns, before_ns=START_NS)
    >>> curve = estimate_final(window, ship, Parameters()).curve
    >>> f'r(5 m/s) = {np.interp(5.0, curve.speed_m_s, curve.resistance_m_s2):.4f}'
    'r(5 m/s) = 0.0068'
    """
    found = named(parameters.estimator).estimate(_usable(window), ship, parameters)
    return replace(found, notes=(*found.notes, *coverage_notes(window)))
