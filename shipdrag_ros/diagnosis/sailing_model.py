# SPDX-License-Identifier: Apache-2.0
"""
What a log should read on legs, by hypothesis, and how probable that makes each.

A scale grows with the speed, an offset is the same at all speeds, a current
turns with the course. Slow water, turbulence at the log and small errors that
every instrument has are noise, whose colour is learnt beside all effects at
once: none of them can hide in it, and it cannot pass for one of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from shipdrag_ros.diagnosis.legs import Legs
from shipdrag_ros.diagnosis.terms import cubic_bsplines
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effects import find

SMOOTH = 'smooth'  # an error of the log that bends with the speed, without a name
_SMOOTHS, _SMOOTH_SD = 6, 0.05  # of them, of the highest speed
_SCALE_TOLERANCE = 0.005  # that a log in order has
_CURRENT_TOLERANCE_M_S = 0.04  # steady current that is not worth a word
_WIDE = 10.0  # prior widths of the effects while noise is learnt
_ROUNDS = 5
_TYPICAL_S = (120.0, 1200.0)  # correlation of the log's error and of slow water
_WATER_M_S = 0.04
_SD_OF_LOG = np.array([1.0, 1.0, 0.7, 0.8, 0.8])
_EVALUATIONS = 400


@dataclass(frozen=True)
class LegFit:
    """
    A hypothesis fitted to legs.

    Attributes
    ----------
    names
        Of its effects, and `SMOOTH`.
    value, sd : (p,)
        Of the parameters of the effects, in their order.
    residual, white : (n,)
        Log less prediction [m/s], and whitened.
    log_likelihood, log_evidence
        Up to a constant that all share; the former at the best fit, its prior
        included.
    """

    names: tuple[str, ...]
    value: Float64
    sd: Float64
    residual: Float64
    white: Float64
    log_likelihood: float
    log_evidence: float

    @property
    def chi2_per_leg(self) -> float:
        """Of whitened residuals."""
        return float(self.white @ self.white) / len(self.white)


@dataclass(frozen=True)
class LegModel:
    """
    What a log reads on legs.

    Attributes
    ----------
    legs
    factor : (n, n)
        Lower triangular: covariance of the noise is factor factor^T.
    """

    legs: Legs
    factor: Float64

    @classmethod
    def learnt(cls, legs: Legs) -> LegModel:
        """
        Learn the noise of legs.
        """
        white = cls(legs, np.eye(len(legs)) * 0.05)
        everything = ('current', 'log_offset', 'log_scale')
        rough = white.fit(everything, width=_WIDE)
        slopes = white.slopes(everything, rough.value)
        left = rough.residual + slopes @ rough.value
        prior_sd = _WIDE * white.prior_sd(everything)
        open_ = (slopes * prior_sd) @ (slopes * prior_sd).T
        typical = max(float(np.median(np.abs(rough.residual))), 1e-3)
        units = np.array([typical, typical, _WATER_M_S, *_TYPICAL_S])

        def cost(x: Float64) -> float:
            factor = np.linalg.cholesky(_covariance(legs, units * np.exp(x)) + open_)
            residual = solve_triangular(factor, left, lower=True, check_finite=False)
            log_det = 2.0 * float(np.log(np.diag(factor)).sum())
            return float(residual @ residual) + log_det + float(((x / _SD_OF_LOG) ** 2).sum())

        corners = np.vstack([np.zeros(5), 0.7 * np.eye(5)])
        found = minimize(
            cost,
            corners[0],
            method='Nelder-Mead',
            options={
                'maxfev': _EVALUATIONS,
                'xatol': 0.05,
                'fatol': 0.05,
                'initial_simplex': corners,
            },
        )
        covariance = _covariance(legs, units * np.exp(found.x))
        return cls(legs, np.asarray(np.linalg.cholesky(covariance), np.float64))

    @cached_property
    def reference_rad(self) -> float:
        """Direction of the first leg, along which a current is stated."""
        return float(self.legs.direction_rad[0])

    @cached_property
    def _bumps(self) -> Float64:
        """What neither a scale nor an offset is, (6, n)."""
        speed = self.legs.ground_m_s
        bumps = cubic_bsplines(speed / speed.max(), _SMOOTHS).T
        line = np.array([np.ones(len(speed)), speed]).T
        found: Float64 = (bumps - line @ np.linalg.lstsq(line, bumps, rcond=1e-6)[0]).T
        return found

    def prior_sd(self, names: tuple[str, ...]) -> Float64:
        """
        Return the prior standard deviations of the parameters, (p,).
        """
        found: list[float] = []
        for name in names:
            if name == SMOOTH:
                found += [_SMOOTH_SD * float(self.legs.ground_m_s.max())] * _SMOOTHS
            else:
                found += [quantity.prior.second for quantity in find(name).parameters]
        return np.array(found)

    def predict(self, names: tuple[str, ...], value: Float64) -> Float64:
        """
        Return what the log reads [m/s], (n,).
        """
        left = iter(value.tolist())
        current, radar, scale, extra = (0.0, 0.0), 0.0, 0.0, np.zeros(len(self.legs))
        for name in names:
            if name == 'current':
                along, to_port = next(left), next(left)
                cos, sin = math.cos(self.reference_rad), math.sin(self.reference_rad)
                current = (along * cos - to_port * sin, along * sin + to_port * cos)
            elif name == 'radar_scale':
                radar = next(left)
            elif name == 'log_scale':
                scale = next(left)
            elif name == 'log_offset':
                extra = extra + next(left)
            else:
                extra = extra + np.array([next(left) for _ in range(_SMOOTHS)]) @ self._bumps
        # distances that are too long by a factor: the current is by the same
        seen = (current[0] * (1.0 + radar), current[1] * (1.0 + radar))
        through = self.legs.through_water(seen) / (1.0 + radar)
        return np.asarray((1.0 + scale) * through + extra, np.float64)

    def slopes(self, names: tuple[str, ...], value: Float64) -> Float64:
        """
        Return the derivatives of `predict`, (n, p).
        """
        steps = 1e-5 * np.eye(len(value))
        columns = [
            (self.predict(names, value + step) - self.predict(names, value - step)) / 2e-5
            for step in steps
        ]
        return np.array(columns).reshape(len(value), len(self.legs)).T

    def fit(self, names: tuple[str, ...], *, width: float = 1.0) -> LegFit:
        """
        Fit a hypothesis.

        Parameters
        ----------
        names
        width
            Of the priors, relative to those stated.

        Notes
        -----
        Gauss-Newton with normal priors; Laplace's evidence, which is exact but
        for the bend of the speed in a current from the side.
        """
        sd = width * self.prior_sd(names)
        z = np.zeros(len(sd))
        covariance: Float64 = np.eye(len(sd))
        log_det = 0.0
        for _ in range(_ROUNDS if len(sd) else 0):
            slopes = self._whiten(self.slopes(names, sd * z)) * sd
            matrix = np.eye(len(sd)) + slopes.T @ slopes
            covariance = np.asarray(np.linalg.inv(matrix), np.float64)
            log_det = float(np.linalg.slogdet(matrix)[1])
            left = self._whiten(self.legs.log_m_s - self.predict(names, sd * z))
            z = covariance @ (slopes.T @ (left + slopes @ z))
        residual = self.legs.log_m_s - self.predict(names, sd * z)
        white = self._whiten(residual)
        log_likelihood = -0.5 * float(white @ white + z @ z)
        return LegFit(
            names,
            sd * z,
            sd * np.sqrt(np.diag(covariance)),
            residual,
            white,
            log_likelihood,
            log_likelihood - 0.5 * log_det,
        )

    def _whiten(self, table: Float64) -> Float64:
        found: Float64 = solve_triangular(self.factor, table, lower=True, check_finite=False)
        return found


def _covariance(legs: Legs, sizes: Float64) -> Float64:
    """Return the covariance of the noise; sizes are white, log, water [m/s], two times [s]."""
    white, log, water, log_s, water_s = sizes
    apart = np.abs(legs.time_s[:, None] - legs.time_s)
    together = legs.record[:, None] == legs.record
    course = np.cos(legs.direction_rad[:, None] - legs.direction_rad)
    slow = log**2 * np.exp(-apart / log_s) + water**2 * np.exp(-apart / water_s) * course
    speed = legs.ground_m_s
    found = np.where(together, slow + _CURRENT_TOLERANCE_M_S**2 * course, 0.0)
    found += _SCALE_TOLERANCE**2 * np.outer(speed, speed)
    found[np.diag_indices_from(found)] += white**2
    return np.asarray(found, np.float64)
