# SPDX-License-Identifier: Apache-2.0
"""
The noise of a record, learnt with its uncertainty; compiled.

A setting is a size and a correlation time of each slow source, a factor of the white noise of each
input, and how firmly the engine holds the speed. Under broad log-normal priors the evidence of a
setting is that of a linear model whose coefficients are integrated out: the resistance too, so
that a run teaches about its noise without being taken for noise. `learn` finds the most probable
setting, the curvature there, and some tens of settings about it weighed by evidence and prior
(importance sampling at fixed points: no random numbers). What follows from a setting is averaged
over them: a size that a record does not show is not 0, and a band widens by what is not known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.inference import priors
from shipdrag_ros.inference.noise import (
    HOLD,
    SIZE,
    WHITE_OF,
    GaussMarkovNoise,
    Noise,
    NoisePosterior,
    Settings,
)
from shipdrag_ros.inference.rows import KIND_COUNT, LOG, OVER_GROUND, POSITION, Rows
from shipdrag_ros.inference.sampling import Seen, SizePrior, sample, spread_points, values
from shipdrag_ros.samples import Float64

KEPT = 24  # settings
_QUICK, _QUICK_KEPT = 13, 8  # of the points about the most probable setting, and of settings
_NEGLIGIBLE = 2e-3  # weight of a setting
_FINE, _ROUGH = 0.02, 0.3  # of the logarithm of the evidence: how near the most probable one is
LEAST_S = 300.0  # of record from which noise can be learnt; of less most is the prior's


def of_steady(rows: Rows, variance: Float64, damping_1_s: float, inertia: float) -> Seen:
    """
    Prepare a steady record alone: mean speed, first position and current are unknown.

    Parameters
    ----------
    rows
        Of the steady record.
    variance : (n,)
        Of their white noise.
    damping_1_s, inertia
        dr/dv over 1 + n_r [1/s] and 1 + n_r at the steady speed, of the hull alone.
    """
    n = len(variance)
    position, log = rows.kind == POSITION, rows.kind == LOG
    columns = [rows.value, np.where(position, rows.time_s, 1.0)]
    if position.any():
        columns.append(position.astype(np.float64))
    if log.any() and not log.all():
        # the current, which the log does not see
        columns.append(np.where(position, rows.time_s, (rows.kind == OVER_GROUND) * 1.0))
    none = np.zeros((1, len(columns) - 1))
    noise = Noise(variance, GaussMarkovNoise(), np.full(n, damping_1_s), np.full(n, inertia))
    return Seen(rows, np.array(columns), none, none, noise, n)


def learn(seen: Seen, speed_m_s: float, *, quick: bool = False) -> NoisePosterior:
    """
    Learn the noise of a record.

    Parameters
    ----------
    seen
    speed_m_s
        At the stop; with the damping it sets the scale of the priors.
    quick
        Times as they usually are, and a third of the settings.

    Returns
    -------
    NoisePosterior
        Of a record shorter than `LEAST_S` it is not called learnt: what it holds is mostly the
        prior. Settings of the prior as they are, where no setting explains the record.

    Notes
    -----
    Evidence at the mode and its curvature, then importance sampling with weights cut at the
    root of their number times their mean (Ionides 2008).
    """
    prior = _prior(seen, speed_m_s)
    if quick:
        sizes = prior.which[(prior.which >= WHITE_OF) | (prior.which % 2 == 0)]
        prior = prior._replace(which=sizes)
    points = spread_points(len(prior.which))
    points, close = (points[:_QUICK], _ROUGH) if quick else (points, _FINE)
    z, log_weight = sample(seen, prior, points, close)
    if not np.isfinite(log_weight).any():
        return _of_prior(prior)
    length_s = float(np.ptp(seen.rows.time_s)) if len(seen.rows.time_s) else 0.0
    kept = _QUICK_KEPT if quick else KEPT
    return replace(_posterior(z, log_weight, prior, kept), learnt=length_s >= LEAST_S)


def prior(seen: Seen, speed_m_s: float) -> NoisePosterior:
    """
    Return settings where nothing can be learnt.
    """
    return _of_prior(_prior(seen, speed_m_s))


def settings_at(seen: Seen, speed_m_s: float, points: Float64) -> Settings:
    """
    Return the settings at points of the prior, all alike in weight.

    Parameters
    ----------
    seen, speed_m_s
        As `learn`.
    points : (s, SIZE)
        Standard normal where drawn from the prior.
    """
    return _settings(points, np.full(len(points), 1.0 / len(points)), _prior(seen, speed_m_s))


def _points_of(prior: SizePrior) -> Float64:
    points = spread_points(len(prior.which))[: 1 + KEPT]
    z = np.zeros((len(points), SIZE))
    z[:, prior.which] = points
    return z


def _of_prior(prior: SizePrior) -> NoisePosterior:
    z = _points_of(prior)
    return NoisePosterior(_settings(z, np.full(len(z), 1.0 / len(z)), prior), False)


def _posterior(z: Float64, log_weight: Float64, prior: SizePrior, kept: int) -> NoisePosterior:
    """Keep what counts, the most probable first."""
    usable = np.isfinite(log_weight)
    z, log_weight = z[usable], log_weight[usable]
    weight = np.exp(log_weight - log_weight.max())
    weight = np.minimum(weight, np.sqrt(len(weight)) * weight.mean())
    weight /= weight.sum()
    order = np.argsort(-weight, kind='stable')[:kept]
    order = order[weight[order] > _NEGLIGIBLE]
    return NoisePosterior(_settings(z[order], weight[order] / weight[order].sum(), prior), True)


def _settings(z: Float64, weight: Float64, prior: SizePrior) -> Settings:
    """Return the settings at points, in standard deviations of the prior."""
    value = np.array([values(each, prior) for each in z])
    return Settings(
        value[:, :WHITE_OF].copy(), value[:, WHITE_OF:HOLD].copy(), value[:, HOLD], weight
    )


def _prior(seen: Seen, speed_m_s: float) -> SizePrior:
    """Return what instruments, engines, air and water usually do."""
    rows, noise = seen.rows, seen.noise
    has = np.array([rows.of(kind).any() for kind in range(KIND_COUNT)])

    def white(kind: int, otherwise: float) -> float:
        chosen = noise.variance[rows.of(kind)]
        return float(np.sqrt(np.median(chosen))) if len(chosen) else otherwise

    at = max(seen.steady - 1, 0)
    damping, inertia = float(noise.damping_1_s[at]), float(noise.inertia[at])
    r_m_s2 = damping * inertia * speed_m_s / 2.5
    log_sd = white(LOG, white(OVER_GROUND, 0.0))
    medians = np.array(
        [
            priors.GUST.mean * r_m_s2,
            priors.GUST_TIME.mean / np.sqrt(damping),
            priors.WATER.mean * min(1.0, speed_m_s / priors.WATER_SPEED.mean),
            priors.WATER_TIME.mean,
            max(priors.LOG.mean * log_sd, priors.LOG_LEAST.mean * speed_m_s),
            priors.LOG_TIME.mean,
            max(white(POSITION, 0.0), priors.PLACE.mean * speed_m_s),
            priors.PLACE_TIME.mean,
            priors.WHITE_LOG.mean,
            priors.WHITE_GROUND.mean,
            priors.WHITE_PLACE.mean,
            priors.HOLD.mean,
        ]
    )
    sd = np.array([each.sd for each in priors.LEARNT])
    # water that moves is a matter of what is measured over ground
    active = np.array([True, bool(has[1:].any()), bool(has[:2].any()), bool(has[POSITION])])
    which = np.concatenate([np.repeat(active, 2), has, [seen.steady > 0]])
    return SizePrior(np.log(medians), sd, np.flatnonzero(which))
