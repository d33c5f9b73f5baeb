# SPDX-License-Identifier: Apache-2.0
"""
From an estimate to the rest of the glide: the posterior predictive, linearised.

The deceleration a at speeds that are not reached yet: ln a(u) = ln a_0(u) + d(ln u). a_0 is that
of the ship file, or of a hull of her length and volume, with a share of a force that does not
fall with the speed: craft that are no hull have more of it. d is a Gaussian process: an unknown
level, an unknown exponent and a smooth rest. It is given what is known of r(v), and beyond that
is the prior. Shares, widths of d and how much rougher a record is than its estimate says are
families, weighed by their evidence.

With the speed in place of the time, t(u) = integral du / a(u), and all that disturbs it is
linear: an error e of ln a, or a gust of -e a, shifts the time at which she has a speed by the
integral of -e dt, and the way by that of -e (u + c) dt. So one covariance of e along the glide
gives every band. No random numbers.

If the engine were stopped now: the glide of a ship under power, by her hull as last known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipdrag_ros.display import utc
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.force import clean_hull
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.forecast.result import Forecast, Z
from shipdrag_ros.inference import priors as noise
from shipdrag_ros.parameter import Declared, normal
from shipdrag_ros.parameters import SPEEDS_M_S
from shipdrag_ros.posterior.law import parts_n
from shipdrag_ros.posterior.priors import LEFT_S, RUN_DOWN
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.ship.sections import Propulsion
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.effects import action_of
from shipdrag_ros.simulation.scenario import Scenario

_WORLD = 'world A, records'

LEVEL = Declared('d', 'level of d: the size of r is what was measured', normal(1.0), '', _WORLD)
EXPONENT = Declared('d', 'exponent of r over u, beside that of the form', normal(0.15), '', _WORLD)
SMOOTH = Declared('d', 'a smooth rest of d', normal(0.06), '', _WORLD)
ALIKE = Declared('d', 'over how much of ln u that rest is alike', 0.4, '', _WORLD)
GUST = Declared('-', 'gust, of the deceleration at the stop', normal(0.04), '', _WORLD)
ANOTHER_RUN = Declared(
    '-',
    'r of the next run over that last known, less one: `--if-stopped-now`',
    normal(0.05),
    '',
    'runs of one hull on one day',
)
FORM_OFF = Declared('-', 'form of r of a baseline, relative', normal(0.01), '', 'judgement')


class WeighedFamilies(NamedTuple):
    """Values with their probabilities, and what is printed of them."""

    of: tuple[tuple[float, float], ...]
    declared: Declared


def _families(letter: str, meaning: str, *of: tuple[float, float]) -> WeighedFamilies:
    said = ', '.join(f'{value:g} ({chance:g})' for value, chance in of)
    expected = sum(value * chance for value, chance in of)
    text = f'{meaning}, mean of families (with their probabilities): {said}'
    return WeighedFamilies(of, Declared(letter, text, round(expected, 3), '', _WORLD))


FORMS = _families(
    'f',
    'share of a constant force in the deceleration at the stop',
    *((0.0, 0.7), (0.03, 0.1), (0.1, 0.08), (0.3, 0.05), (0.6, 0.04), (0.9, 0.03)),
)
WIDTHS = _families('-', 'exponent and rest are wider by', (1.0, 0.85), (3.0, 0.12), (10.0, 0.03))
ROUGHER = _families(
    '-', 'errors of the estimate and gusts are larger by', (1.0, 0.6), (2.0, 0.25), (4.0, 0.15)
)
PRIORS = (
    *(each.declared for each in (FORMS, WIDTHS, ROUGHER)),
    *(LEVEL, EXPONENT, SMOOTH, ALIKE, GUST, ANOTHER_RUN, FORM_OFF),
)
"""What docs/results/priors.md prints; times of gusts, slow water and log: those of noise."""

_POINTS = 25  # of the curve, evenly in ln u
_ALIKE_RANGE = (0.03, 3.0)  # of ln u, over which errors of the estimate may be alike
_ROUNDING = 1e-4


class KnownCurve(NamedTuple):
    """
    r(v) as it is known, speeds ascending.

    `alike` (m,) is over how much of ln u its errors are alike, `level_sd` that of r as a whole,
    relative, beside `sigma_m_s2`.
    """

    speed_m_s: Float64
    resistance_m_s2: Float64
    sigma_m_s2: Float64
    alike: Float64
    level_sd: float = 0.0

    @classmethod
    def of(cls, estimate: Estimate) -> KnownCurve:
        """
        Return what an estimate knows of all that slows her in the run.

        Errors at two speeds are alike over sigma / sd of the slope.
        An error of n_r cancels: r / (1 + n_r) was measured, and is foretold.
        """
        curve = estimate.whole.between(*estimate.froude_valid)
        if len(curve) < _POINTS:
            curve = estimate.whole
        sd = curve.sigma_repeatable_m_s2
        alike = sd / np.maximum(curve.slope_sigma * curve.froude, 1e-12)
        return cls(curve.speed_m_s, curve.resistance_m_s2, sd, alike)


class Deceleration(NamedTuple):
    """
    ln of the deceleration without thrust at some speeds (m,), and its covariance (m, m).

    `roughness` is how many times larger the variance of gusts is than stated.
    """

    log_m_s2: Float64
    covariance: Float64
    roughness: float


def deceleration(known: KnownCurve, ship: Ship, speed_m_s: Float64) -> Deceleration:
    """
    Return the law that a known curve and the prior give.

    Parameters
    ----------
    known
    ship
        For n_r and the hull.
    speed_m_s : (m,)
        Above 0.

    Notes
    -----
    Regression by Gaussian processes (Rasmussen, Williams 2006, ch. 2).
    """
    top = float(known.speed_m_s[-1])
    x = np.linspace(np.log(known.speed_m_s[0]), np.log(top), _POINTS)
    measured, error = _measured(known, ship, np.exp(x))
    u = np.concatenate([np.exp(x), speed_m_s])
    hull = parts_n(ship, u).sum(axis=0) / (1.0 + ship.n_r(u))
    (share, of_form), (width, of_width), (rougher, of_rougher) = (
        np.array(each.of).T for each in (FORMS, WIDTHS, ROUGHER)
    )
    base = measured[-1] + np.log(np.outer(hull / hull[_POINTS - 1], 1.0 - share) + share)
    off = measured[:, None] - base[:_POINTS]
    prior = _prior(np.log(u / top), width)
    # (width, roughness, ...): neither changes the mean of a form
    error = rougher[:, None, None] ** 2 * error + known.level_sd**2 + _ROUNDING * np.eye(_POINTS)
    of_curve = prior[:, None, :_POINTS, :_POINTS] + error
    to_curve = prior[:, None, :_POINTS, _POINTS:]
    gain = np.linalg.solve(of_curve, to_curve)
    fit = np.linalg.solve(of_curve, np.broadcast_to(off, (*of_curve.shape[:3], len(share))))
    log_root = np.log(np.diagonal(np.linalg.cholesky(of_curve), axis1=2, axis2=3)).sum(axis=2)
    log = np.log(of_width[:, None, None] * of_rougher[:, None] * of_form) - log_root[..., None]
    log -= 0.5 * (off * fit).sum(axis=2)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    means = base[_POINTS:] + np.swapaxes(gain, 2, 3) @ off
    mean = np.einsum('abf,abmf->m', weight, means)
    apart = (means - mean[:, None]) * np.sqrt(weight)[:, :, None]
    left = prior[:, None, _POINTS:, _POINTS:] - np.swapaxes(gain, 2, 3) @ to_curve
    covariance = np.tensordot(weight.sum(axis=2), left, 2)
    covariance += np.einsum('abmf,abnf->mn', apart, apart)
    return Deceleration(mean, covariance, float(weight.sum(axis=(0, 2)) @ rougher**2))


def _prior(x: Float64, width: Float64) -> Float64:
    """Return the covariance of d from the top on, of each width."""
    apart = x[:, None] - x
    shape = EXPONENT.sd**2 * np.outer(x, x)
    shape += SMOOTH.sd**2 * np.exp(-0.5 * (apart / ALIKE.mean) ** 2)
    return np.asarray(LEVEL.sd**2 + width[:, None, None] ** 2 * shape)


def _measured(known: KnownCurve, ship: Ship, u: Float64) -> tuple[Float64, Float64]:
    """Return ln a of the curve and the covariance of its error."""

    def at(values: Float64) -> Float64:
        return np.interp(u, known.speed_m_s, values)

    r = np.maximum(at(known.resistance_m_s2), 1e-3 * float(known.resistance_m_s2.max()))
    alike = np.clip(at(known.alike), *_ALIKE_RANGE)
    x, relative = np.log(u), at(known.sigma_m_s2) / r
    squares = alike[:, None] ** 2 + alike**2
    # Gibbs (1997): positive definite where the length changes
    correlation = np.sqrt(2.0 * np.outer(alike, alike) / squares) * np.exp(
        -((x[:, None] - x) ** 2) / squares
    )
    error = np.outer(relative, relative) * correlation
    return np.log(r / (1.0 + ship.n_r(u))), error


FRACTIONS = (0.9, 0.75, 0.5, 0.25)
"""Of the speed at the stop, that are always spoken of."""


_NODES = 64  # of the glide, evenly in ln u
_BEYOND = 0.5  # of the lowest speed that is spoken of, until which is foretold
_ROUNDS = 12  # in which the delay by a run-down settles
_WIDEST = 10.0  # of the logarithm of a figure, on either side


@dataclass(frozen=True, kw_only=True)
class Beginning:
    """
    From where a glide goes on.

    Attributes
    ----------
    made_ns
        Stamp of the last reading [ns].
    stop_m_s
        Speed at the stop.
    speed_m_s, speed_sd_m_s
        Now, through water.
    white_m_s
        White noise of the best reading of the speed.
    current_m_s, current_sd_m_s
        Where distances are over ground; None: they are through water.
    run_down_s, run_down_sd_s
        Of a shaft that has not been stopped yet, or of thrust that is left.
    thrust
        Over what slows her now.
    """

    made_ns: int
    stop_m_s: float
    speed_m_s: float
    speed_sd_m_s: float
    white_m_s: float = 0.0
    current_m_s: float | None = None
    current_sd_m_s: float = 0.0
    run_down_s: float = 0.0
    run_down_sd_s: float = 0.0
    thrust: float = 1.0

    @classmethod
    def of(cls, estimate: Estimate) -> Beginning:
        """
        Return the end of a window; over ground where positions were used.
        """
        speeds = [sd for name, sd in estimate.noise_sd.items() if name.startswith('speed')]
        last_m_s, whole = estimate.last_speed_m_s, estimate.whole
        slows = float(np.interp(last_m_s, whole.speed_m_s, whole.resistance_m_s2))
        return cls(
            made_ns=estimate.end_ns,
            stop_m_s=float(estimate.curve.speed_m_s[-1]),
            speed_m_s=last_m_s,
            speed_sd_m_s=estimate.last_speed_sigma_m_s,
            white_m_s=min((sd for sd in speeds if math.isfinite(sd)), default=0.0),
            current_m_s=(estimate.current_m_s or 0.0) if estimate.by_position else None,
            current_sd_m_s=estimate.current_sigma_m_s or 0.0,
            run_down_s=LEFT_S.mean,
            thrust=estimate.last_thrust_m_s2 / slows,
        )


def foretell(
    estimate: Estimate,
    ship: Ship,
    *,
    froude_min: float = 0.0,
    speeds_m_s: tuple[float, ...] = SPEEDS_M_S,
) -> Forecast:
    """
    Foretell the rest of a glide from its estimate so far, of any estimator, as `foretell_from`.
    """
    known = KnownCurve.of(estimate)
    return foretell_from(
        Beginning.of(estimate), known, ship, froude_min=froude_min, speeds_m_s=speeds_m_s
    )


def foretell_from(
    now: Beginning,
    known: KnownCurve,
    ship: Ship,
    *,
    froude_min: float = 0.0,
    speeds_m_s: tuple[float, ...] = SPEEDS_M_S,
) -> Forecast:
    """
    Foretell the rest of a glide.

    Parameters
    ----------
    now
        From where.
    known
        r(v), as it is known.
    ship
        For n_r and the hull.
    froude_min
        At which a coastdown ends; 0: not spoken of.
    speeds_m_s
        Spoken of besides `FRACTIONS` of the speed at the stop.

    Returns
    -------
    Forecast
        Of times and distances to the lower speeds, from the last reading on.

    Raises
    ------
    EstimationError
        If she is slower already than all of these speeds.

    Notes
    -----
    By law and gusts, times and distances are log-normal: a weak deceleration delays more than a
    strong one hastens. The thrust of a shaft that runs down delays by its share of a, over time.
    """
    wanted = {*(part * now.stop_m_s for part in FRACTIONS), *speeds_m_s}
    wanted.add(float(ship.speed(froude_min)))
    targets = tuple(sorted((u for u in wanted if 0.0 < u < now.speed_m_s), reverse=True))
    if not targets:
        given = ', '.join(f'{each:.3g}' for each in speeds_m_s)
        raise EstimationError(
            f'nothing is left to foretell: at {now.speed_m_s:.3g} m/s she is slower than '
            f'{FRACTIONS[-1]:.0%} of {now.stop_m_s:.3g} m/s and than '
            f'{given} m/s: give a lower speed in forecast_speeds'
        )
    u = np.exp(np.linspace(math.log(now.speed_m_s), math.log(_BEYOND * targets[-1]), _NODES))
    found = deceleration(known, ship, np.append(u, now.stop_m_s))
    a = np.exp(found.log_m_s2)
    weights = _weights(u, a[:-1])
    gliding = weights.sum(axis=1)
    covariance = found.covariance[:-1, :-1] + found.roughness * _gusts(u, a, gliding)
    ground = u + (now.current_m_s or 0.0)
    by_way = weights * ground
    drift = np.zeros(_NODES) if now.current_m_s is None else _drift(now, gliding)
    # what is wrong with the present speed, with the reading that will show a lower one, and with
    # the run-down
    late = (now.speed_sd_m_s / a[0]) ** 2
    reading = (_reading_sd(now) / a[:-1]) ** 2
    held, held_way = _run_down(now.thrust, now.run_down_s, gliding, a[:-1], ground)
    longer_s = now.run_down_s + now.run_down_sd_s
    longer, longer_way = _run_down(now.thrust, longer_s, gliding, a[:-1], ground)
    time = gliding + held
    times = _bands(
        time, time, _variance(weights, covariance), late + reading + (longer - held) ** 2
    )
    ways = _bands(
        by_way.sum(axis=1) + held_way,
        np.abs(by_way).sum(axis=1) + np.abs(held_way),
        _variance(by_way, covariance),
        late * ground[0] ** 2 + reading * ground**2 + drift + (longer_way - held_way) ** 2,
    )
    return Forecast(
        now.made_ns,
        now.stop_m_s,
        u,
        times,
        ways,
        now.speed_sd_m_s,
        now.current_m_s or 0.0,
        np.sqrt(drift),
        targets,
        now.current_m_s is not None,
    )


def _weights(u: Float64, a: Float64) -> Float64:
    """Return (n, n) times that she spends about each speed until each of them."""
    step = np.diff(-np.log(u))
    each = u / a
    weights = np.zeros((len(u), len(u)))
    for i in range(1, len(u)):
        weights[i:, i - 1] += 0.5 * step[i - 1] * each[i - 1]
        weights[i:, i] += 0.5 * step[i - 1] * each[i]
    return weights


def _run_down(
    thrust: float, run_down_s: float, gliding_s: Float64, a: Float64, ground: Float64
) -> tuple[Float64, Float64]:
    """Return by how much a thrust exp(-t / run_down), over a_0, delays each speed, and its way."""
    delay = np.zeros_like(gliding_s)
    if run_down_s > 0.0:
        over = thrust * a[0] / a
        share = 0.5 * (over[1:] + over[:-1])
        for _ in range(_ROUNDS):
            left = -run_down_s * np.diff(np.exp(-(gliding_s + delay) / run_down_s))
            delay = np.concatenate([[0.0], np.cumsum(share * left)])
    way = np.diff(delay) * 0.5 * (ground[1:] + ground[:-1])
    return delay, np.concatenate([[0.0], np.cumsum(way)])


def _variance(weights: Float64, covariance: Float64) -> Float64:
    return np.asarray(((weights @ covariance) * weights).sum(axis=1))


def _gusts(u: Float64, a: Float64, time: Float64) -> Float64:
    """Return the covariance of a Gauss-Markov force, in parts of the deceleration."""
    size = GUST.sd * a[-1] / a[:-1]
    damping = 2.0 * a[0] / u[0]
    length = noise.GUST_TIME.mean / math.sqrt(damping)
    return np.asarray(np.outer(size, size) * np.exp(-np.abs(time[:, None] - time) / length))


def _drift(now: Beginning, time: Float64) -> Float64:
    """Return the variance of the way that the water makes."""
    size = noise.WATER.mean * min(1.0, now.stop_m_s / noise.WATER_SPEED.mean)
    ratio = time / noise.WATER_TIME.mean
    slow = 2.0 * (size * noise.WATER_TIME.mean) ** 2 * (ratio + np.expm1(-ratio))
    return np.asarray(slow + (now.current_sd_m_s * time) ** 2)


def _reading_sd(now: Beginning) -> float:
    return max(noise.LOG_LEAST.mean * now.stop_m_s, noise.LOG.mean * now.white_m_s)


def _bands(median: Float64, size: Float64, scaled: Float64, added: Float64) -> Float64:
    """
    Return median, low and high (n, 3).

    A variance is of what scales a figure, which is then log-normal, or is added to it. The size
    is that of a way without its direction: where a current sets her back it is above the median,
    and a weak deceleration may bring her farther on, or farther back.
    """
    spread = Z * np.sqrt(scaled) / np.maximum(size, 1e-12)
    spread = np.minimum(spread, _WIDEST)
    beside = Z * np.sqrt(added)
    back = size > median
    less, more = -np.expm1(-spread), np.expm1(spread)
    low = median - np.hypot(size * np.where(back, more, less), beside)
    high = median + np.hypot(size * more, beside)
    if back.any():
        return np.column_stack([median, low, high])
    # a lower speed comes later, and farther on
    bands = np.column_stack([median, np.maximum(low, 0.0), high])
    return np.asarray(np.maximum.accumulate(bands, axis=0))


_OF_FILE = 60  # points of the curve of a ship file
_LOWEST = 0.05  # of the highest speed of a baseline


@dataclass(frozen=True)
class HullNow:
    """
    r(v) as last known, and where that is from, in words.
    """

    known: KnownCurve
    source: str

    @classmethod
    def of_run(
        cls, speed_m_s: Float64, resistance_m_s2: Float64, sigma_m_s2: Float64, start_ns: int
    ) -> HullNow:
        """
        Take the curve of a coastdown that began then; the next run differs from it.
        """
        alike = np.full(len(speed_m_s), ALIKE.mean)
        known = KnownCurve(speed_m_s, resistance_m_s2, sigma_m_s2, alike, ANOTHER_RUN.sd)
        return cls(known, f'the coastdown of {utc(start_ns)}')

    @classmethod
    def of_file(cls, ship: Ship) -> HullNow:
        """
        Take the baseline of a ship file and the effects that stand in it.

        Raises
        ------
        EstimationError
            If it states no baseline.
        SimulationError
            If one of its effects cannot be simulated.
        """
        if ship.baseline is None:
            raise EstimationError(
                'neither a coastdown nor a baseline of the ship file says how the hull slows her: '
                'state `baseline` in the ship file, or make a coastdown'
            )
        low, high = ship.baseline_range_m_s
        speed = np.linspace(max(low, _LOWEST * high), high, _OF_FILE)
        newtons, sd = clean_hull(ship, speed)
        mass, added = ship.mass_kg, np.zeros(_OF_FILE)
        for effect in ship.effects:
            action = action_of(Frame(ship, Scenario(speed_m_s=high), 0.0), [effect])
            mass += action.mass_fraction * ship.mass_kg
            more = action.resistance_n(speed)
            added = added + more
            sd = np.hypot(sd, _relative_sd(effect) * more)
        source = 'the clean hull of the ship file'
        if ship.effects:
            source = f'the ship file, with {", ".join(each.name for each in ship.effects)}'
        r = (newtons + added) / mass
        # a file errs alike at all speeds
        level_sd = float(np.hypot(ANOTHER_RUN.sd, np.mean(sd / (newtons + added))))
        return cls(KnownCurve(speed, r, FORM_OFF.sd * r, np.ones(_OF_FILE), level_sd), source)


def _relative_sd(effect: StatedEffect) -> float:
    """Return that of what an effect does, which grows with each of its numbers."""
    stated = [each for each in effect.parameters.values() if math.isfinite(each.value)]
    return math.hypot(*(each.sd / abs(each.value) for each in stated if each.value))


def if_stopped(
    hull: HullNow,
    ship: Ship,
    speed_m_s: float,
    now_ns: int,
    *,
    rest_m_s: float = 0.0,
    speed_sd_m_s: float = 0.0,
    gliding: bool = False,
    speeds_m_s: tuple[float, ...] = SPEEDS_M_S,
) -> Forecast:
    """
    Foretell the glide that would begin now, with the run-down of the shaft; without way, of none.

    Parameters
    ----------
    hull
    ship
        For n_r, the run-down and the law beyond what is known.
    speed_m_s, now_ns
        Present speed through water, and when she has it [ns].
    rest_m_s
        Up to which she makes no way.
    speed_sd_m_s
        Of the present speed.
    gliding
        The shaft has run down already.
    speeds_m_s
        Spoken of, beside shares of the present speed.
    """
    if not speed_m_s > rest_m_s:
        at, still = np.array([speed_m_s]), np.zeros((1, 3))
        return Forecast(
            now_ns, speed_m_s, at, still, still, speed_sd_m_s, 0.0, np.zeros(1), (), False
        )
    run_down = ship.propulsion or Propulsion(RUN_DOWN.mean, RUN_DOWN.mean * RUN_DOWN.sd)
    now = Beginning(
        made_ns=now_ns,
        stop_m_s=speed_m_s,
        speed_m_s=speed_m_s,
        speed_sd_m_s=speed_sd_m_s,
        run_down_s=0.0 if gliding else run_down.run_down_s,
        run_down_sd_s=0.0 if gliding else run_down.sd,
    )
    return foretell_from(now, hull.known, ship, speeds_m_s=speeds_m_s)
