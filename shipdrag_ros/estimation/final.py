# SPDX-License-Identifier: Apache-2.0
"""
The figure that is kept of a coastdown that has ended.

It says which inputs it rests on where others are silent; where two estimators disagree, its
band holds both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.choice import check_size, estimate
from shipdrag_ros.estimation.estimators import AFTER, DURING, named
from shipdrag_ros.estimation.ode_fit.run_down import RunDown
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import MOTION_INPUTS, SECOND_NS, Float64
from shipdrag_ros.ship import Ship

_RUN_DOWNS = 4.0  # of the shaft, after which no thrust is left
_LATE_S = 10.0  # an onset found from the speed is hardly later
# Differences over the root of the sum of both variances; both share the data, so that a clean
# record makes less. Chosen on 1000 simulated clean coastdowns (four ships, 100 and 500 samples,
# seeds 0..24; white noise, steady record, run-down, current and outliers, gusts learnt), of which
# 1 is taken to disagree.
ALLOWED = 2.0
_POINTS = 65  # evenly in speed, of the comparison
_GAP_S = 10.0  # without a sample, and more than _GAP_STEPS usual steps: a gap
_GAP_STEPS = 5.0
_WORTH_SAYING = 0.1  # of the window


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
    Source: docs/method.md; the equation of motion is (1 + n_r) dv/dt = -r(v), S1 (1).

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
        check_size(window)
        return named(asked).estimate(window, ship, parameters)
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


def widened(found: Estimate, other: Estimate, below_m_s: float) -> Estimate:
    """
    Widen the band of an estimate where another differs by more than both bands allow.

    Parameters
    ----------
    found, other
        Of the same window.
    below_m_s
        Above this speed they are not compared: what the other knows of the
        thrust is not enough there.

    Returns
    -------
    Estimate
        With what exceeds `ALLOWED` joint standard deviations added in quadrature,
        and a note with both figures; unchanged where nothing does.
    """
    mine, its = found.curve, other.valid_curve
    top = min(mine.speed_m_s[-1], below_m_s)
    if len(its) < 2 or min(top, its.speed_m_s[-1]) <= max(mine.speed_m_s[0], its.speed_m_s[0]):
        return found
    speeds = np.linspace(
        max(mine.speed_m_s[0], its.speed_m_s[0]), min(top, its.speed_m_s[-1]), _POINTS
    )
    r, sigma = _at(mine, speeds)
    its_r, its_sigma = _at(its, speeds)
    square = (r - its_r) ** 2 - ALLOWED**2 * (sigma**2 + its_sigma**2)
    worst = int(np.argmax(square))
    if square[worst] <= 0.0:
        return found
    excess = np.interp(mine.speed_m_s, speeds, np.sqrt(np.maximum(square, 0.0)))
    apart = speeds[square > 0.0]
    note = (
        f'two estimators disagree at {apart[0]:.3g} to {apart[-1]:.3g} m/s: at '
        f'{speeds[worst]:.3g} m/s {found.estimator} says '
        f'{r[worst]:.3g} ± {2.0 * sigma[worst]:.1g} m/s², {other.estimator} '
        f'{its_r[worst]:.3g} ± {2.0 * its_sigma[worst]:.1g} (two standard deviations); the band '
        'is widened to hold both: look for what is not a coastdown in the window'
    )
    return _with_excess(found, excess, note)


def _at(curve: ResistanceCurve, speeds: Float64) -> tuple[Float64, Float64]:
    """Return r and its repeatable sigma at some speeds."""
    return (
        np.interp(speeds, curve.speed_m_s, curve.resistance_m_s2),
        np.interp(speeds, curve.speed_m_s, curve.sigma_repeatable_m_s2),
    )


def _with_excess(found: Estimate, excess: Float64, note: str) -> Estimate:
    """Add an error (m,) to the band of an estimate."""
    curve = replace(
        found.curve,
        sigma_m_s2=np.hypot(found.curve.sigma_m_s2, excess),
        sigma_repeatable_m_s2=np.hypot(found.curve.sigma_repeatable_m_s2, excess),
    )
    at_last = float(np.interp(found.last_speed_m_s, curve.speed_m_s, excess))
    wider = replace(
        found,
        curve=curve,
        last_sigma_m_s2=float(np.hypot(found.last_sigma_m_s2, at_last)),
        notes=(*found.notes, note),
    )
    valid = wider.valid_curve
    return replace(
        wider,
        max_relative_sigma=float(valid.sigma_repeatable_m_s2.max() / valid.resistance_m_s2.max()),
    )


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
    for name in MOTION_INPUTS:
        series: Series = getattr(window, name)
        if len(series) or len(getattr(before, name)):
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
