# SPDX-License-Identifier: Apache-2.0
"""
More information never makes r(v) worse: the same ship, with more and more known of her.

    python -m benchmarks.accuracy.more_information --count 30 --seed 0

Each case is a ship of `config/` in gusts, a current and slow errors of the log, whose sizes and
times are drawn. The same coastdown is estimated from the log alone, from log and position, with
the shaft too, and together with a second coastdown on the reciprocal heading. The score is the
mean logarithm of the density of the true r over the speeds that all of them hold; differences
are taken case by case, with two standard errors.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import along, table
from benchmarks.accuracy._coasts import cut
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.estimation.reciprocal import combine
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import GaussMarkov, Scenario, Sensor, sense, simulate

CONFIG = ROOT / 'config'
HULLS = (('vitus_bering', 8.2, 1500.0), ('kvlcc2', 7.97, 1800.0))  # speed [m/s], coastdown [s]
LEAD_S, RATE_HZ = 1800.0, 0.5
SETS = ('log', 'log, position', 'log, position, shaft', 'the same, two runs')
_CHANNELS = (Channel.SPEED_THROUGH_WATER, Channel.POSITION, Channel.SHAFT)
_SPEEDS = 50

Curve = tuple[Float64, Float64, Float64]
"""Speed, r and its repeatable standard deviation."""


def scores(number: int, seed: int) -> Float64:
    """
    Return the mean logarithm of the density of the true r over the largest r, for each of `SETS`.

    Raises
    ------
    EstimationError
        If one of them cannot be estimated.
    """
    rng = np.random.default_rng([seed, number])
    name, speed_m_s, duration_s = HULLS[number % len(HULLS)]
    # the air at rest is part of the ship's resistance, over ground: none, for one truth
    ship = replace(Ship.load(CONFIG / f'{name}.yaml'), air=None)
    largest = float(ship.resistance_n(speed_m_s)) / ship.mass_kg
    gust = 0.012 * largest * math.exp(0.6 * rng.standard_normal()) * ship.mass_kg
    gust_s = 150.0 * math.exp(0.6 * rng.standard_normal())
    log = GaussMarkov(0.02 * math.exp(0.6 * rng.standard_normal()), rng.uniform(20.0, 200.0))
    current_m_s = 0.3 * rng.standard_normal()

    def windows(run: int) -> list[Window]:
        scenario = Scenario(
            speed_m_s=speed_m_s,
            lead_in_s=LEAD_S,
            duration_s=duration_s,
            heading_rad=run * math.pi,
            current_m_s=(current_m_s, 0.0),
            gust_force=GaussMarkov(gust, gust_s),
            seed=int(rng.integers(2**31)),
        )
        sensors = [
            Sensor(channel=_CHANNELS[0], rate_hz=RATE_HZ, sd=0.05, coloured=log),
            Sensor(channel=_CHANNELS[1], rate_hz=RATE_HZ, sd=5.0),
            Sensor(channel=_CHANNELS[2], rate_hz=RATE_HZ, sd=0.02),
        ]
        truth, noise = simulate(ship, scenario), int(rng.integers(2**31))
        blocks = (sense(truth, sensors[:count], seed=noise) for count in (1, 2, 3))
        return [cut(block, LEAD_S, duration_s) for block in blocks]

    found = [estimate_final(each, ship, Parameters()) for each in windows(0)]
    second = estimate_final(windows(1)[-1], ship, Parameters())
    both = combine([found[-1], second], [0.0, math.pi])
    curves: list[Curve] = [
        (each.speed_m_s, each.resistance_m_s2, each.sigma_repeatable_m_s2)
        for each in (*(one.valid_curve for one in found), both)
    ]
    low, high = max(each[0][0] for each in curves), min(each[0][-1] for each in curves)
    speed = np.linspace(low, min(high, speed_m_s), _SPEEDS)
    true = np.asarray(ship.resistance_n(speed)) / ship.mass_kg
    return np.array([_log_density(each, speed, true, largest) for each in curves])


def _log_density(curve: Curve, speed: Float64, true: Float64, unit: float) -> float:
    r, sd = (np.interp(speed, curve[0], each) for each in curve[1:])
    return float(np.mean(-0.5 * ((r - true) / sd) ** 2 - np.log(sd / unit)))


def gains(found: Float64) -> list[tuple[float, float]]:
    """
    Return what each set has gained on the one before, with two standard errors.

    Parameters
    ----------
    found : (n, s)
        Scores of n cases.
    """
    steps = np.diff(found, axis=1)
    error = 2.0 * steps.std(axis=0, ddof=1) / math.sqrt(len(steps))
    return list(zip(steps.mean(axis=0).tolist(), error.tolist()))


def main() -> None:
    """
    Simulate, estimate, print.
    """
    options = asked(__doc__, count=30, seed=0)
    found = []
    for number in along(range(options.count), 'cases'):
        try:
            found.append(scores(number, options.seed))
        except EstimationError as error:
            print(f'case {number}: {error}')
    print(f'{len(found)} of {options.count} cases, seed {options.seed}')
    steps = ['', *(f'{gain:+.2f} ± {error:.2f}' for gain, error in gains(np.array(found)))]
    means = [f'{mean:.2f}' for mean in np.mean(found, axis=0)]
    head = ('known', 'mean log density of the true r', 'gain on the line above')
    print(*table(head, zip(SETS, means, steps)), sep='\n')


if __name__ == '__main__':
    main()
