# SPDX-License-Identifier: Apache-2.0
"""
Calibration of the one posterior on rows that are drawn from its own priors.

    python -m benchmarks.accuracy.posterior_calibration --count 100 --seed 0

A hypothesis, all unknowns and a setting of the noise are drawn from the priors of the model;
rows of a log and of positions follow by the model itself. What is inferred from them is compared
with what was drawn.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks._asked import asked
from benchmarks._tables import along
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.inference.learning import Seen, settings_at
from shipdrag_ros.inference.rows import LOG, POSITION, SIZE, Noise, Rows, noise_of, whiten
from shipdrag_ros.posterior.laplace import infer
from shipdrag_ros.posterior.law import DEPTH, HELD, WIND
from shipdrag_ros.posterior.motion import damping_of, predict, shapes_at
from shipdrag_ros.posterior.problem import RunModel, StopPrior
from shipdrag_ros.posterior.readout import read
from shipdrag_ros.posterior.weather import Weather
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

SPEED_M_S, LOW_M_S, LEAD_S, COAST_S = 8.0, 3.6, 1800.0, 1500.0
STEADY_BIN_S, BIN_S = 30.0, 15.0
LOG_SD, POSITION_SD = 0.02, 4.0  # of a row
STOP = StopPrior(30.0, 8.0, 2.0)
OUT = (HELD, WIND, DEPTH), (HELD,)  # of the calm curve, and of that in the conditions
WIDE = 1.96
SPEEDS = np.linspace(LOW_M_S, 7.8, 50)
TIME_S = np.concatenate(
    [
        np.arange(-LEAD_S + 0.5 * STEADY_BIN_S, 0.0, STEADY_BIN_S),
        np.arange(0.5 * BIN_S, COAST_S, BIN_S),
    ]
)


class Place(NamedTuple):
    """Where the truth lies: cover of both bands, chi^2, and the probability of the hypothesis."""

    cover: float
    in_weather: float
    chi2: float
    name: str
    chance: float
    best: str
    best_chance: float


def model_of(value: Float64) -> RunModel:
    """Return the run with these readings, of the log and then of the positions."""
    rows = Rows(np.repeat(TIME_S, 2), np.tile([LOG, POSITION], len(TIME_S)), value)
    variance = np.tile([LOG_SD**2, POSITION_SD**2], len(TIME_S))
    steady = 2 * int((TIME_S < 0.0).sum())
    return RunModel.of(
        rows,
        variance,
        steady,
        Ship.example(),
        STOP,
        speeds_m_s=(LOW_M_S, SPEED_M_S, SPEED_M_S),
        weather=Weather(None, None),
    )


def drawn(rng: np.random.Generator) -> tuple[RunModel, str, Float64]:
    """Draw a run: its model, what holds, and the true r at `SPEEDS`, calm and in its weather."""
    model = model_of(np.zeros(2 * len(TIME_S)))
    families = model.families
    which = int(rng.choice(len(families), p=families.chance / families.chance.sum()))
    mean, precision = families.mean[which], families.precision[which]
    unknowns = mean + rng.standard_normal(len(mean)) / np.sqrt(precision)
    k = model.coefficients
    unknowns[k] = SPEED_M_S  # the vague ones as they are
    table, speed = predict(model.forces, unknowns, model.grid_s, model.rows)
    damping, inertia = damping_of(model.forces, unknowns[:k], np.maximum(speed, 0.1))
    white: Noise = model.white._replace(damping_1_s=damping, inertia=inertia)
    none = np.zeros((1, 1))
    seen = Seen(model.rows, table[:1], none, none, white, model.steady)
    settings = settings_at(seen, SPEED_M_S, rng.standard_normal((1, SIZE)))
    noise = noise_of(settings, 0, model.rows, white, model.steady)
    whitener = np.eye(len(speed))
    whiten(model.rows, whitener, noise)
    disturbed = np.linalg.solve(whitener.T, rng.standard_normal(len(speed)))
    known, columns = shapes_at(model.forces, SPEEDS)
    conditions = known[0] + unknowns[:k] @ columns[0]
    calm, place = conditions.copy(), model.of_hull
    for each in model.influences:
        own = slice(place, place + len(each.columns))
        place = own.stop
        adds = np.interp(SPEEDS, model.law.speed_m_s, each.known) + unknowns[own] @ columns[0, own]
        calm -= adds
        if each.name == HELD:
            conditions -= adds
    name = str(families.name[which])
    return model_of(disturbed - table[0]), name, np.stack([calm, conditions])


def place(rng: np.random.Generator) -> Place:
    """
    Draw a run and infer it.

    Raises
    ------
    EstimationError
        If the motion runs away.
    """
    model, name, true = drawn(rng)
    found = infer(model)
    calm, whole = (
        (part.resistance_m_s2 - each) / part.sigma_m_s2
        for part, each in zip((read(found, SPEEDS, without=out) for out in OUT), true)
    )
    names = list(dict.fromkeys(model.families.name.tolist()))
    best = max(names, key=found.chance)
    return Place(
        float(np.mean(np.abs(calm) < WIDE)),
        float(np.mean(np.abs(whole) < WIDE)),
        float(np.mean(calm**2)),
        name,
        found.chance(name),
        best,
        found.chance(best),
    )


def main() -> None:
    """
    Draw, infer, print.
    """
    options = asked(__doc__, count=100, seed=0)
    found, failed = [], 0
    for number in along(range(options.count), 'cases'):
        try:
            found.append(place(np.random.default_rng([options.seed, number])))
        except EstimationError:
            failed += 1
    cover, whole, chi2 = (np.array([each[i] for each in found], np.float64) for i in range(3))
    right = np.array([each.best == each.name for each in found], np.float64)
    said = np.array([each.best_chance for each in found])
    log_chance = np.log(np.maximum([each.chance for each in found], 1e-3))
    print(f'{len(found)} runs, seed {options.seed}; {failed} could not be inferred')
    print(f'the band of 95 % holds {_mean(100.0 * cover)} % of the speeds in calm deep water,')
    print(f'{_mean(100.0 * whole)} % in the weather of the run,')
    print(f'and less than half of them in {_mean(100.0 * (cover < 0.5))} % of the runs')
    print(f'chi^2 {_mean(chi2)}, median {np.median(chi2):.2f}')
    print(f'the most probable hypothesis: said {_mean(said)}, right {_mean(right)}')
    print(f'mean log probability of the truth {_mean(log_chance)}')


def _mean(value: Float64) -> str:
    return f'{value.mean():.3g} ± {2.0 * value.std() / math.sqrt(len(value)):.2g}'


if __name__ == '__main__':
    main()
