# SPDX-License-Identifier: Apache-2.0
"""The figure that is kept of a coastdown that has ended."""

from __future__ import annotations

from dataclasses import replace

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.agreement import widened
from shipdrag_ros.estimation.choice import check_size, estimate
from shipdrag_ros.estimation.coverage import coverage_notes
from shipdrag_ros.estimation.estimators import AFTER, DURING, named
from shipdrag_ros.estimation.ode_fit.run_down import RunDown
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import MOTION_INPUTS
from shipdrag_ros.ship import Ship

_RUN_DOWNS = 4.0  # of the shaft, after which no thrust is left
_LATE_S = 10.0  # an onset found from the speed is hardly later


def estimate_final(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    """
    Estimate r(v) from a whole coastdown, with time to do so.

    Parameters
    ----------
    window
        Of the whole coastdown, with the record `before` it.
    ship
        For n_r, the Froude number and the run-down of the thrust.
    parameters
        `estimator`: `auto` and `ode_fit` stand for the fit of the equation of
        motion, held against the estimate during the coastdown: where both
        disagree, the band is widened. Where the fit fails, `auto` keeps that
        estimate, or that of one input alone, and a note says why. Any other is
        used as during the coastdown.

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
    Source: docs/accuracy.md; the equation of motion is (1 + n_r) dv/dt = -r(v), S1 (1).

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
    found = _estimate(window, ship, parameters)
    return replace(found, notes=(*found.notes, *coverage_notes(window)))


def _estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    asked = parameters.estimator
    if asked != 'auto' and named(asked) is not named(AFTER):
        return estimate(window, ship, parameters)
    try:
        found = _fitted(window, ship, parameters)
    except EstimationError as error:
        if asked != 'auto':
            raise
        return _instead(window, ship, parameters, error)
    try:
        other = named(DURING).estimate(window, ship, parameters)
    except EstimationError as error:
        note = f'not compared with the estimate during the coastdown, which failed: {error}'
        return replace(found, notes=(*found.notes, note))
    return widened(found, other, _without_thrust_m_s(found, window, ship))


def _fitted(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    check_size(window)
    return named(AFTER).estimate(window, ship, parameters)


def _instead(
    window: Window, ship: Ship, parameters: Parameters, unfitted: EstimationError
) -> Estimate:
    """Estimate as during the coastdown; by one input alone where all together give nothing."""
    try:
        found = estimate(window, ship, parameters)
    except EstimationError as error:
        heard = [name for name in MOTION_INPUTS if len(getattr(window, name))]
        for name in heard if len(heard) > 1 else []:
            try:
                found = _fitted(_alone(window, name), ship, parameters)
            except EstimationError:
                continue
            others = ' and '.join(other for other in heard if other != name)
            note = f'by {name} alone, without {others}: together they give nothing: {error}'
            return replace(found, notes=(*found.notes, note))
        raise
    note = f'not fitted as a motion, so as during the coastdown: {unfitted}'
    return replace(found, notes=(*found.notes, note))


def _alone(window: Window, kept: str) -> Window:
    """Leave out all inputs of motion but one, in the record before too."""

    def of(name: str) -> Series:
        series: Series = getattr(window, name)
        if name == kept:
            return series
        return Series(series.time_ns[:0], series.value[:0], series.variance[:0])

    return replace(
        window,
        speed_through_water=of('speed_through_water'),
        speed_over_ground=of('speed_over_ground'),
        position=of('position'),
        before=None if window.before is None else _alone(window.before, kept),
    )


def _without_thrust_m_s(found: Estimate, window: Window, ship: Ship) -> float:
    """Return the speed at which the thrust has surely ended, as far as the stop is known."""
    run_down = RunDown.of(window, ship)
    after_s = _RUN_DOWNS * run_down.shaft_s + min(run_down.stop_sd_s, _LATE_S)
    curve = found.curve
    return float(curve.speed_m_s[-1] - after_s * curve.resistance_m_s2[-1])
