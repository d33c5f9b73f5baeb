# SPDX-License-Identifier: Apache-2.0
"""
The estimate of a window: while a coastdown runs, and the figure that is kept.

By the estimator that the parameter names. The kept figure says which inputs it rests on where
others are silent. Where the log may be in a wrong scale, it is averaged over with it and without.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.estimators import WindowEstimator, named
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Float64, Int64
from shipdrag_ros.ship import Ship

_LARGEST = 1e9  # m, m/s: far above any ship's, and far below where squares and powers overflow


_GAP_S = 10.0  # without a sample, and more than _GAP_STEPS usual steps: a gap
_GAP_STEPS = 5.0
_WORTH_SAYING = 0.1  # of the window


def _missing_s(series: Series, start_ns: int, end_ns: int) -> float:
    """Return how much of a window an input says nothing of: the sum of its gaps [s]."""
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
            missing[name] = _missing_s(series, window.start_ns, window.end_ns)
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


LEFT_OUT = 0.05  # what a band of two standard deviations leaves out: a doubt below it adds nothing


def averaged(estimator: WindowEstimator) -> WindowEstimator:
    """
    Return an estimator whose band holds the truth where the log is doubted.

    Parameters
    ----------
    estimator
        Of a window whose log is sound.

    Notes
    -----
    The mean and the variance of a mixture of two: with the log, and without it by the
    `Window.log_doubt`.
    """

    def estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
        found, doubt = estimator(window, ship, parameters), window.log_doubt
        log = window.doubted_log
        if not doubt > LEFT_OUT or log not in found.samples:
            return found
        why = f'with a probability of {doubt:.2f} it is in a wrong scale'
        try:
            other = estimator(window.without(log, why), ship, parameters)
        except EstimationError as error:
            raise EstimationError(
                f'{log}: {why}; without it, {error}: calibrate it, or give a speed over ground'
            ) from error
        return _mixed(found, other, doubt, f'{log}: {why}: averaged over with it and without it')

    return estimate


def _mixed(one: Estimate, other: Estimate, doubt: float, note: str) -> Estimate:
    calm, conditions, whole = (
        _mixture(getattr(one, name), getattr(other, name), doubt)
        for name in ('calm', 'conditions', 'whole')
    )
    low, high = (
        max(one.froude_valid[0], other.froude_valid[0]),
        min(one.froude_valid[1], other.froude_valid[1]),
    )
    use = _overlap(one.calm, other.calm)
    parts = {
        name: np.sqrt(
            (1.0 - doubt) * part[use] ** 2
            + doubt * _at(calm.speed_m_s, other.calm, other.sigma_parts.get(name)) ** 2
        )
        for name, part in one.sigma_parts.items()
    }
    if parts:
        apart = one.calm.resistance_m_s2[use] - _at(
            calm.speed_m_s, other.calm, other.calm.resistance_m_s2
        )
        parts['log'] = np.hypot(parts.get('log', 0.0), _between(doubt) * np.abs(apart))
    shared = one.sigma_shared_m_s2
    if len(shared):
        its = _at(calm.speed_m_s, other.calm, other.sigma_shared_m_s2)
        shared = (1.0 - doubt) * shared[use] + doubt * its
    mixed = replace(
        one,
        calm=calm,
        sigma_shared_m_s2=shared,
        conditions=conditions,
        whole=whole,
        froude_valid=(low, high),
        sigma_parts=parts,
        notes=(*one.notes, note),
    )
    last = {
        f'last_{name}': (1.0 - doubt) * getattr(one, f'last_{name}')
        + doubt * getattr(other, f'last_{name}')
        for name in ('speed_m_s', 'resistance_m_s2', 'thrust_m_s2')
    }
    for name, sigma in (('speed_m_s', 'speed_sigma_m_s'), ('resistance_m_s2', 'sigma_m_s2')):
        two = [
            (getattr(each, f'last_{name}'), getattr(each, f'last_{sigma}'))
            for each in (one, other)
        ]
        last[f'last_{sigma}'] = float(_sd(*two[0], *two[1], doubt))
    valid = mixed.valid_curve
    if len(valid) < 2:
        raise EstimationError(f'{note}, and these have no speeds in common')
    relative = float(valid.sigma_repeatable_m_s2.max() / valid.resistance_m_s2.max())
    return replace(mixed, max_relative_sigma=relative, **last)


def _between(doubt: float) -> float:
    return float(np.sqrt(doubt * (1.0 - doubt)))


def _sd(mean: Float64, sd: Float64, other: Float64, other_sd: Float64, doubt: float) -> Float64:
    """Return the standard deviation of a mixture of two."""
    within = (1.0 - doubt) * sd**2 + doubt * other_sd**2
    return np.asarray(np.sqrt(within + (_between(doubt) * (mean - other)) ** 2), np.float64)


def _at(speed: Float64, curve: ResistanceCurve, values: Float64 | None) -> Float64:
    if values is None:
        return np.zeros(len(speed))
    return np.asarray(np.interp(speed, curve.speed_m_s, values), np.float64)


def _overlap(one: ResistanceCurve, other: ResistanceCurve) -> Int64:
    low, high = other.speed_m_s[[0, -1]]
    return np.flatnonzero((one.speed_m_s >= low) & (one.speed_m_s <= high))


def _mixture(one: ResistanceCurve, other: ResistanceCurve, doubt: float) -> ResistanceCurve:
    """Average two curves over the speeds that both have."""
    use = _overlap(one, other)
    mine = {each.name: getattr(one, each.name)[use] for each in fields(ResistanceCurve)}
    speed = mine['speed_m_s']
    its = {name: _at(speed, other, getattr(other, name)) for name in mine}
    found = {name: (1.0 - doubt) * mine[name] + doubt * its[name] for name in mine}
    for name, sigma in (
        ('resistance_m_s2', 'sigma_m_s2'),
        ('resistance_m_s2', 'sigma_repeatable_m_s2'),
        ('slope', 'slope_sigma'),
    ):
        found[sigma] = _sd(mine[name], mine[sigma], its[name], its[sigma], doubt)
    return ResistanceCurve(**{**found, 'speed_m_s': speed, 'froude': mine['froude']})
