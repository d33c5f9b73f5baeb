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
from shipdrag_ros.estimation.estimators import named
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.ship import Ship

_LARGEST = 1e9  # m, m/s: far above any ship's, and far below where squares and powers overflow


_GAP_S = 10.0  # without a sample, and more than _GAP_STEPS usual steps: a gap
_GAP_STEPS = 5.0
_WORTH_SAYING = 0.1  # of the window


def missing_s(series: Series, start_ns: int, end_ns: int) -> float:
    """
    Return how much of a window an input says nothing of.

    Parameters
    ----------
    series : n samples
        Inside the window.
    start_ns, end_ns
        The window [ns].

    Returns
    -------
    float
        Sum of the gaps [s].
    """
    if not len(series):
        return (end_ns - start_ns) / SECOND_NS
    edges = np.concatenate([[start_ns], series.time_ns, [end_ns]])
    steps = np.diff(edges) / SECOND_NS
    usual = float(np.median(steps))
    return float(steps[steps > max(_GAP_S, _GAP_STEPS * usual)].sum())


def coverage_notes(window: Window) -> tuple[str, ...]:
    """
    Say which inputs have gaps, and what the estimate rests on there.

    Parameters
    ----------
    window
        Of the whole coastdown.

    Returns
    -------
    tuple of str
        A sentence for each input of the motion that says nothing of a tenth of it.
    """
    before = window if window.before is None else window.before
    length = (window.end_ns - window.start_ns) / SECOND_NS
    missing = {}
    for name in window.motion:
        series = window.series(name)
        if len(series) or len(before.series(name)):
            missing[name] = missing_s(series, window.start_ns, window.end_ns)
    notes = []
    for name, seconds in missing.items():
        if seconds <= _WORTH_SAYING * length:
            continue
        others = [other for other in missing if missing[other] < 0.5 * seconds]
        rests = (
            f'there the estimate rests on {" and ".join(others)}'
            if others
            else 'nothing else shows what happened there'
        )
        notes.append(
            f'{name}: no usable reading for {seconds:.0f} of {length:.0f} s (silent, stuck or '
            f'rejected): {rests}'
        )
    return tuple(notes)


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
