# SPDX-License-Identifier: Apache-2.0
"""
The live estimator: all inputs at once, in the logarithm of time, averaged over models.

A pure function of the window, the ship and the parameters, as S1's. It assumes
what S1 does not: that drag is roughly quadratic, that inputs differ by a
current and a factor, that some samples are wrong, and that no one order is
right.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.assemble import AtEnd, assembled, log_scale_note
from shipdrag_ros.estimation.curve import ValidRange, resistance_curve
from shipdrag_ros.estimation.log_time.inputs import Inputs, gather
from shipdrag_ros.estimation.log_time.learnt_noise import LearntNoise
from shipdrag_ros.estimation.log_time.model import (
    CURRENT,
    THRUST,
    coast_motion,
    combine,
    design,
    quadratic_coast,
)
from shipdrag_ros.estimation.log_time.prior import FREE, coast_priors
from shipdrag_ros.estimation.log_time.robust import robust_fit
from shipdrag_ros.estimation.motion import Motion, sigma
from shipdrag_ros.estimation.result import Estimate, Track
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.averaging import average
from shipdrag_ros.inference.gaussian import condense, root
from shipdrag_ros.inference.robust import GROSS
from shipdrag_ros.inference.rows import LOG, LOG_SCALE_SD, OVER_GROUND, POSITION, Input
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

NAME = 'log_time'

_POLYNOMIALS = 12  # as many as any record needs, the priors do the rest
# The fit that finds the weights: standard deviation of coefficient j is
# AMPLITUDE DECAY^(j - 2) / j of the distance run, that of the first ones FREE_SD.
_AMPLITUDE, _DECAY, _FREE_SD = 0.03, 0.45, 10.0
CURRENT_SD_M_S = 1.0  # prior
_THRUST_SD = 0.3  # prior of the thrust at the stop, of the resistance there
_SHORTEST_RUN_DOWN_S = 0.1

_POINTS = 65  # of the curve, even in u
_NO_DECELERATION = 3.0  # standard deviations of the loss of speed


@dataclass(frozen=True)
class _AveragedFit:
    """
    The average over models.

    Attributes
    ----------
    tc_s
        Time constant of the warp.
    coefficients : (k,)
        Polynomials, then current, factor of the log, thrust.
    error : (k, k)
        A root of their covariance.
    fitted : (n,)
        At the samples.
    noise_sd : (3,)
        Of each kind of input.
    run_down_s
        Time constant of the thrust.
    notes
        A sentence each.
    """

    tc_s: float
    coefficients: Float64
    error: Float64
    fitted: Float64
    noise_sd: Float64
    run_down_s: float
    notes: tuple[str, ...]

    @property
    def polynomials(self) -> int:
        """How many of the coefficients are of polynomials."""
        return len(self.coefficients) - THRUST - 1

    @property
    def current(self) -> tuple[float, float] | tuple[None, None]:
        """Current along the track and its standard deviation, if estimated."""
        row = self.error[self.polynomials + CURRENT]
        sd = float(np.sqrt((row * row).sum()))
        if sd == 0.0:
            return None, None
        return float(self.coefficients[self.polynomials + CURRENT]), sd


def estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    """
    Estimate r(v) from one window.

    Parameters
    ----------
    window
        Accepted samples.
    ship
        For n_r, the Froude number and the run-down of the thrust.
    parameters
        `order_max`, `froude_min` and the known standard deviations are used.

    Raises
    ------
    EstimationError
        If the window does not hold a coastdown that can be estimated.

    Notes
    -----
    S1 (5)-(7) in log time: x = sum p_j T_j(u), u = ln(1 + t / tc). While
    the thrust runs down, r is that of the coast without it, which the ship has
    joined afterwards. sigma is that of r at a speed, var(r - (dr/dv) v).
    Where the record before the window shows slow disturbances, the rows are
    whitened of them: generalised least squares.
    """
    inputs = gather(window, parameters)
    fit = _fit(window, inputs, ship, parameters)
    motion = _motion(inputs, fit)
    _check_deceleration(inputs, motion)
    curve = resistance_curve(motion, ship, froude_min=parameters.froude_min)
    valid = ValidRange.of_polynomial(curve)
    current, current_sd = fit.current
    return assembled(
        NAME,
        curve,
        valid,
        AtEnd.of(motion, ship),
        start_ns=inputs.scale.first_ns,
        end_ns=inputs.scale.first_ns + inputs.scale.span_ns,
        order=None,
        orders=(),
        samples={Input(kind).key: int(inputs.count[kind]) for kind in inputs.used},
        noise_sd={Input(kind).key: float(fit.noise_sd[kind]) for kind in inputs.used},
        tracks=_tracks(inputs, fit),
        current_m_s=current,
        current_sigma_m_s=current_sd,
        notes=(*window.notes, *inputs.notes, *fit.notes, *ship.warnings),
    )


def _fit(window: Window, inputs: Inputs, ship: Ship, parameters: Parameters) -> _AveragedFit:
    span = inputs.span_s
    kind = next(k for k in (LOG, OVER_GROUND, POSITION) if inputs.count[k])
    part = inputs.part(kind)
    tc, speed = quadratic_coast(
        inputs.time_s[part], inputs.clean[part], span, 1 if kind == POSITION else 0
    )
    polynomials = min(_POLYNOMIALS, parameters.order_max)
    # without `propulsion` in the ship file the thrust ends at once
    stated = ship.propulsion.run_down_s if ship.propulsion is not None else 0.0
    run_down = max(stated, _SHORTEST_RUN_DOWN_S)
    rows = design(inputs.time_s, inputs.count, tc, span, speed, run_down, polynomials)
    length = float(np.log1p(span / tc))
    mean, sd = _loose(polynomials, speed * tc * length, speed / tc)

    # every column but the thrust: its prior is not about nothing
    full = np.ones(len(rows), np.bool_)
    full[-1] = False
    full[-2] = bool(inputs.count[LOG])
    full[-3] = inputs.separates_water_from_ground
    columns = np.flatnonzero(full)
    start, weight, noise_sd, used_sd = robust_fit(
        rows,
        inputs.value,
        inputs.clean,
        inputs.stated,
        inputs.count,
        inputs.known_sd,
        columns,
        mean,
        sd,
    )
    start[polynomials:] = 0.0
    residual = inputs.value - combine(rows, start)
    slow = LearntNoise.of(window, ship, parameters, coast_s=tc, speed_m_s=speed)
    if slow is None:
        products = condense(rows, residual, weight)
    else:
        white = slow.whitened(rows, residual, weight, inputs, ship)
        products = condense(*white, np.ones(len(residual)))
    notes = [] if slow is None else [slow.note]
    families = _families(polynomials, bool(full[-3]), bool(full[-2]), stated > 0.0)
    # what is free is so about where it is, so that nothing cancels; the priors hold the others
    mean[:FREE], mean[FREE:polynomials], sd[FREE:polynomials] = start[:FREE], 0.0, 0.0
    priors = coast_priors(length, speed, tc, float(ship.froude(speed)), mean, sd)
    coefficients, covariance, _ = average(
        products, start, families, np.ones(len(families)), *priors
    )
    if full[-2]:
        notes.append(log_scale_note(float(coefficients[-2]), float(np.sqrt(covariance[-2, -2]))))
    return _AveragedFit(
        tc,
        coefficients,
        root(covariance),
        combine(rows, coefficients),
        noise_sd,
        run_down,
        (*notes, *_about_noise(inputs, weight, noise_sd, used_sd)),
    )


def _loose(polynomials: int, distance: float, deceleration: float) -> tuple[Float64, Float64]:
    """Return mean and sd of all coefficients, the polynomials held loosely."""
    j = np.arange(polynomials)
    mean, sd = np.zeros(polynomials + THRUST + 1), np.empty(polynomials + THRUST + 1)
    sd[:polynomials] = distance * _AMPLITUDE * _DECAY ** (j - FREE) / np.maximum(j, 1)
    sd[:FREE] = distance * _FREE_SD
    mean[-1] = deceleration
    sd[polynomials:] = (CURRENT_SD_M_S, LOG_SCALE_SD, _THRUST_SD * deceleration)
    return mean, sd


@cache
def _families(polynomials: int, current: bool, scale: bool, runs_down: bool) -> NDArray[np.bool_]:
    """Return the columns of each family: with and without thrust."""
    rows = [
        [True] * polynomials + [current, scale, with_thrust]
        for with_thrust in ((False, True) if runs_down else (False,))
    ]
    return np.array(rows)


def _about_noise(
    inputs: Inputs, weight: Float64, noise_sd: Float64, used_sd: Float64
) -> list[str]:
    notes = []
    for kind in inputs.used:
        gross = int(np.count_nonzero(weight[inputs.part(kind)] == 0.0))
        if gross:
            notes.append(
                f'{Input(kind).key}: {gross} sample(s) more than {GROSS:g} standard deviations '
                'off were left out'
            )
        known = inputs.known_sd[kind]
        if known and used_sd[kind] != known:
            notes.append(
                f'{Input(kind).key}: the residuals, {noise_sd[kind]:.3g}, contradict the stated '
                f'standard deviation {known:.3g}: it was not used'
            )
    return notes


def _motion(inputs: Inputs, fit: _AveragedFit) -> Motion:
    """Evaluate the motion at the speeds that the ship had."""
    k = fit.polynomials
    # with the thrust running down the ship is slower at the start than the coast without it
    drop = fit.run_down_s * float(fit.coefficients[k + THRUST])
    values, errors = coast_motion(
        fit.tc_s, inputs.span_s, fit.coefficients[:k], fit.error[:k], _POINTS, drop
    )
    return Motion(*values, *errors)


def _check_deceleration(inputs: Inputs, motion: Motion) -> None:
    loss = float(motion.speed[0] - motion.speed[-1])
    sd = float(sigma((motion.speed_error[0] - motion.speed_error[-1])[None])[0])
    if not abs(loss) > _NO_DECELERATION * sd:
        raise EstimationError(
            f'no deceleration above the noise: the speed fell by {loss:.3g} +- {sd:.2g} m/s in '
            f'{inputs.span_s:.4g} s; give a longer window, or one after the engine stop'
        )


def _tracks(inputs: Inputs, fit: _AveragedFit) -> dict[str, Track]:
    return {
        Input(kind).key: Track(
            inputs.stamps[kind], inputs.value[inputs.part(kind)], fit.fitted[inputs.part(kind)]
        )
        for kind in inputs.used
    }
