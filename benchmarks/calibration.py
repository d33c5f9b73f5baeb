# SPDX-License-Identifier: Apache-2.0
"""
Calibration of the final figure on records drawn from the program's own priors.

    python benchmarks/calibration.py --count 300 --seed 0

Simulation-based calibration (Talts et al. 2018): the law of r(v), the current, the lag of the log
and all sizes and times of the noise are drawn from the priors that the fit has; then the rank of
the true r at one speed of each record, drawn at random, within its band is uniform where the code
is right. Laws that do not slow the ship at every speed are drawn again. It tests the code; whether
the priors are those of the sea, other worlds show (`band_score.py`).
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track
from shipdrag_ros.estimation.ode_fit.coast import CURRENT, EXTRAS, LOG_LAG, V0, integrate, predict
from shipdrag_ros.estimation.ode_fit.families import POWERS, Humps
from shipdrag_ros.estimation.ode_fit.law import Law, shape_table

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, ode_fit
from shipdrag_ros.estimation.steady import BIN_S
from shipdrag_ros.inference.learning import of_steady, settings_at
from shipdrag_ros.inference.rows import LOG, POSITION, Rows
from shipdrag_ros.inference.settings import SIZE, Settings, noise_of
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship

SHIP = Ship(length_m=150.0, displaced_volume_m3=20200.0)
SPEED_M_S, R_M_S2 = 8.0, 0.025
LEAD_S, COAST_S, LOG_SD, POSITION_SD, CURRENT_SD, LAG_SD_S = 1800.0, 1200.0, 0.05, 5.0, 0.5, 6.0
DAMPING_POWER, WIDE = 2.5, 1.96
_LOWEST = 0.3  # of the speed: where laws are looked at
_START_NS = 1_700_000_000_000_000_000


class Drawn(NamedTuple):
    """A record, and the law that it was made with."""

    window: Window
    law: Law
    unknowns: Float64


def draw_law(rng: np.random.Generator) -> tuple[Law, Float64]:
    """
    Draw a law that slows the ship at every speed.
    """
    humps = Humps.between(_LOWEST, float(SHIP.froude(SPEED_M_S)))
    priors = humps.priors(R_M_S2)
    law = Law(
        np.array(POWERS, np.int64),
        SPEED_M_S,
        0.0,
        SHIP.n_r_polynomial(),
        len(humps.sd),
        humps.first,
        humps.spacing,
    )
    speed = np.linspace(0.05, 1.0, 50) * SPEED_M_S
    shape, slope = shape_table(law, speed)
    quadratic = POWERS.index(2)
    while True:
        which = rng.integers(len(priors.mean))
        held = priors.precision[which] > 0.0
        sd = 1.0 / np.sqrt(np.where(held, priors.precision[which], np.inf))
        found = priors.mean[which] + sd * rng.standard_normal(len(held))
        found[quadratic] = 0.0
        rest = float(shape[-1] @ found)
        found[quadratic] = (R_M_S2 - rest) / shape[-1, quadratic]
        if np.all(shape @ found > 0.0) and np.all(slope @ found > 0.0) and found[quadratic] > 0.0:
            return law, found


def wander(
    time_s: Float64, size: float, correlation_s: float, rng: np.random.Generator
) -> Float64:
    """
    Draw a Gauss-Markov process at even times.
    """
    decay = math.exp(-float(time_s[1] - time_s[0]) / correlation_s)
    found = rng.standard_normal(len(time_s))
    found[1:] *= math.sqrt(1.0 - decay * decay)
    for i in range(1, len(found)):
        found[i] += decay * found[i - 1]
    result: Float64 = size * found
    return result


def draw(rng: np.random.Generator) -> Drawn:
    """
    Draw a record.
    """
    law, coefficients = draw_law(rng)
    unknowns = np.concatenate([coefficients, np.zeros(EXTRAS)])
    k = law.size
    unknowns[k + V0] = SPEED_M_S
    unknowns[k + CURRENT] = CURRENT_SD * rng.standard_normal()
    unknowns[k + LOG_LAG] = LAG_SD_S * rng.standard_normal()
    time_s = np.arange(-LEAD_S, COAST_S)
    n = len(time_s)
    rows = Rows(np.tile(time_s, 2), np.repeat([LOG, POSITION], n), np.zeros(2 * n))
    grid = np.linspace(0.0, COAST_S + 60.0, 400)
    table, _ = predict(law, unknowns, grid, rows, np.zeros(0, np.int64))
    log, place = -table[0, :n], -table[0, n:]
    state, _ = integrate(law, unknowns, grid)
    speed = np.where(time_s < 0.0, SPEED_M_S, np.interp(time_s, grid, state[:, 0]))

    r = shape_table(law, speed)[0] @ coefficients
    inertia = 1.0 + np.asarray(SHIP.n_r(speed), np.float64)
    damping = DAMPING_POWER * r / speed / inertia
    both = Rows(np.repeat(time_s, 2), np.tile([LOG, POSITION], n), np.zeros(2 * n))
    # slow errors are expected in parts of the noise of means, which they are learnt from
    variance = np.tile([LOG_SD**2, POSITION_SD**2], n) / BIN_S
    steady = of_steady(both, variance, float(damping[0]), float(inertia[0]))
    settings = settings_at(steady, SPEED_M_S, rng.standard_normal((1, SIZE)))
    return Drawn(_disturbed(time_s, log, place, damping, inertia, settings, rng), law, unknowns)


def _disturbed(
    time_s: Float64,
    log: Float64,
    place: Float64,
    damping: Float64,
    inertia: Float64,
    settings: Settings,
    rng: np.random.Generator,
) -> Window:
    n, steady = len(time_s), int((time_s < 0.0).sum())
    rows = Rows(time_s, np.full(n, LOG), log)
    noise = noise_of(settings, 0, rows, of_steady(rows, np.ones(n), 1.0, 1.0).noise, steady)
    slow = noise.slow
    damped = damping * np.where(time_s < 0.0, settings.hold[0], 1.0)
    gust = wander(time_s, slow.gust_m_s2, slow.gust_s, rng) / inertia
    water = wander(time_s, slow.water_m_s, slow.water_s, rng)
    push, way = np.zeros(n), np.zeros(n)
    # the ship is in her stationary state when the record begins, which goes with the force then
    follows = 1.0 / (damped[0] + 1.0 / slow.gust_s)
    force_sd = slow.gust_m_s2 / inertia[0]
    alone_sd = force_sd * math.sqrt(follows / damped[0] - follows**2)
    push[0] = follows * gust[0] + alone_sd * rng.standard_normal()
    for i in range(1, n):
        push[i] = push[i - 1] * math.exp(-damped[i]) + 0.5 * (gust[i] + gust[i - 1])
    way[1:] = np.cumsum(0.5 * (push[1:] + push[:-1] + water[1:] + water[:-1]))
    way -= way[steady]
    log = log + push + wander(time_s, slow.log_m_s, slow.log_s, rng)
    place = place + way + wander(time_s, slow.place_m, slow.place_s, rng)
    log += LOG_SD * settings.white[0, LOG] * rng.standard_normal(n)
    place += POSITION_SD * settings.white[0, POSITION] * rng.standard_normal(n)
    stamps = _START_NS + np.round(time_s * 1e9).astype(np.int64)
    block = in_arrival_order(
        [
            Block.of(Channel.SPEED_THROUGH_WATER, stamps, log),
            Block.of(Channel.POSITION, stamps, np.column_stack([place, np.zeros(n)])),
        ]
    )
    return Window.from_block(block, _START_NS, int(stamps[-1]), before_ns=int(stamps[0]))


class Place(NamedTuple):
    """
    Where the truth lies in the band of a record.

    Attributes
    ----------
    rank
        At a speed drawn from those estimated, 0 to 1.
    cover
        Share of all speeds at which the band of 95 % holds it.
    chi2
        Mean square of error over sigma.
    """

    rank: float
    cover: float
    chi2: float


def place(drawn: Drawn, rng: np.random.Generator) -> Place:
    """
    Return where in its band the true r is.

    Raises
    ------
    EstimationError
        If the record cannot be fitted.
    """
    curve = ode_fit.estimate(drawn.window, SHIP, Parameters()).curve
    use = curve.speed_m_s <= SPEED_M_S
    speed = curve.speed_m_s[use]
    true = shape_table(drawn.law, speed)[0] @ drawn.unknowns[: drawn.law.size]
    off = (curve.resistance_m_s2[use] - true) / curve.sigma_repeatable_m_s2[use]
    at = float(np.interp(rng.uniform(speed[0], speed[-1]), speed, off))
    return Place(
        0.5 * math.erfc(at / math.sqrt(2.0)),
        float(np.mean(np.abs(off) < WIDE)),
        float(np.mean(off**2)),
    )


def places(count: int, seed: int) -> tuple[list[Place], int]:
    """
    Return the places of the truth in so many records, and how many could not be fitted.
    """
    found, failed = [], 0
    for number in track(range(count), console=Console(stderr=True)):
        rng = np.random.default_rng([seed, number])
        try:
            found.append(place(draw(rng), rng))
        except EstimationError:
            failed += 1
    return found, failed


def distance(found: Float64) -> tuple[float, float]:
    """
    Return the largest distance from a uniform distribution, and its probability by chance.
    """
    from scipy.stats import kstest

    result = kstest(found, 'uniform')
    return float(result.statistic), float(result.pvalue)


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Draw, fit, print.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--count', type=int, default=300)
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args(arguments)
    found, failed = places(options.count, options.seed)
    rank, cover, chi2 = np.array(found).T
    statistic, p = distance(rank)
    print(f'{len(found)} records, seed {options.seed}; {failed} could not be fitted')
    print(f'ranks of the true r: Kolmogorov-Smirnov {statistic:.3f}, p = {p:.2g}')
    print('in tenths: ' + ' '.join(f'{n}' for n in np.histogram(rank, 10, (0.0, 1.0))[0]))
    print(f'the band of 95 % holds {_mean(100.0 * cover)} % of the speeds of a record')
    print(f'and less than half of them in {_mean(100.0 * (cover < 0.5))} % of the records')
    print(f'chi^2 {_mean(chi2)}, median {np.median(chi2):.2f}')


def _mean(value: Float64) -> str:
    return f'{value.mean():.3g} ± {1.96 * value.std() / math.sqrt(len(value)):.2g}'


if __name__ == '__main__':
    main()
