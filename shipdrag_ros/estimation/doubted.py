# SPDX-License-Identifier: Apache-2.0
"""r(v) where the log may be in a wrong scale: averaged over with it and without it."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.estimators import WindowEstimator
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship

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
    calm, conditions = (
        _mixture(getattr(one, name), getattr(other, name), doubt)
        for name in ('calm', 'conditions')
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
    mixed = replace(
        one,
        calm=calm,
        conditions=conditions,
        froude_valid=(low, high),
        sigma_parts=parts,
        notes=(*one.notes, note),
    )
    last = {
        f'last_{name}': (1.0 - doubt) * getattr(one, f'last_{name}')
        + doubt * getattr(other, f'last_{name}')
        for name in ('speed_m_s', 'resistance_m_s2')
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
