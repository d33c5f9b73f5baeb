# SPDX-License-Identifier: Apache-2.0
"""
The baseline that clean runs show, and how far single runs depart from it.

A baseline from a towing tank is often worse than it says, which two runs cannot
show; several clean runs can, and how they differ from each other shows what a
further run may do without anything being missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from shipdrag_ros.diagnosis.observation import CoastRun
from shipdrag_ros.diagnosis.shared_baseline import (
    Factor,
    Shared,
    SharedBaseline,
    stated_sd,
)
from shipdrag_ros.errors import DiagnosisError, EstimationError
from shipdrag_ros.estimation import estimate_final
from shipdrag_ros.estimation.reciprocal import combine
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.priors import UNSTATED_FORM
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Baseline, CoefficientBaseline, CoefficientSd, Ship, TableBaseline

ENOUGH = 3  # runs that show their scatter
_ASKED = 5  # from which it is well known
_FORM_POINTS = 12
_MARGIN = 1.1  # above the highest speed
_STANDS_OUT = 0.01  # probability by chance, for any of the runs
_UNEXPLAINED = 1.5  # chi^2 a row


@dataclass(frozen=True)
class CleanRun:
    """
    One of the runs.

    Attributes
    ----------
    name
    factor
        Its resistance over that of the others, - 1.
    chi2_per_row
        1 where the noise explains what a baseline leaves.
    """

    name: str
    factor: Factor
    chi2_per_row: float


@dataclass(frozen=True)
class LearntBaseline:
    """
    A learnt baseline.

    Attributes
    ----------
    ship
        With it.
    names
        Of the parts: friction and wave, or resistance as a whole.
    factors : (k,)
        Learnt over stated, of each part.
    covariance : (k, k)
        Of the factors, without the scatter of single runs.
    scatter, scatter_low, scatter_high
        Standard deviation of the resistance from run to run, relative: median,
        16 and 84 %.
    relative_sd : (k,)
        As the learnt baseline states it, beside the scatter: a further run
        differs by both.
    stated_sd : (k,)
        As before; None where nothing was stated.
    speed_m_s
        Covered by the runs, lowest and highest.
    runs
    warnings
        What a reader must know, a sentence each.
    """

    ship: Ship
    names: tuple[str, ...]
    factors: Float64
    covariance: Float64
    scatter: float
    scatter_low: float
    scatter_high: float
    relative_sd: Float64
    stated_sd: Float64 | None
    speed_m_s: tuple[float, float]
    runs: tuple[CleanRun, ...]
    warnings: tuple[str, ...]

    @property
    def correlation(self) -> float:
        """Of the relative deviations of friction and wave that the baseline states."""
        base = self.ship.baseline
        return base.relative_sd.correlation if isinstance(base, CoefficientBaseline) else 0.0


def learn_baseline(runs: Sequence[CoastRun], ship: Ship, parameters: Parameters) -> LearntBaseline:
    """
    Learn a ship's baseline from clean runs.

    Parameters
    ----------
    runs
        Clean hull, calm deep water, no wind; each with the steady record
        before the stop. What differs from run to run widens the baseline.
    ship
        Its baseline, if there is one, keeps its form and is the prior, with
        heavy tails; n_r and effects are taken as the file states them.
    parameters
        For the noise of the sensors and the convention of the heading.

    Returns
    -------
    Learnt
        With a ship file that states the baseline, its errors and the scatter.

    Raises
    ------
    DiagnosisError
        Without a run, or where one has too little steady record.
    EstimationError
        If a run has too few samples.
    ShipFileError
        If the runs ask for values that a ship file may not hold.
    """
    if not runs:
        raise DiagnosisError('no run to learn a baseline from: give at least one')
    begun = ship if ship.baseline is not None else _from_curves(runs, ship, parameters)
    problem = SharedBaseline.of(runs, begun, parameters)
    everything = problem.shared(problem.normals)
    factors = problem.factors()
    enough = len(runs) >= ENOUGH
    mean, covariance = problem.of_parts(everything)
    stated = stated_sd(begun)
    assert begun.baseline is not None
    absolute = np.sqrt(np.diag(covariance))
    correlation = float(covariance[0, -1] / (absolute[0] * absolute[-1]))
    scatter = everything.scatter if enough else begun.baseline.run_scatter
    if not enough:
        # how far a further run may be off is known by what was stated alone
        absolute = np.maximum(absolute, stated)
    relative_sd = absolute / (1.0 + mean)
    source = _source(everything, len(runs), problem.speed_m_s, begun)
    base = replace(
        _scaled(problem, everything, mean, relative_sd, correlation, source),
        run_scatter=_rounded(scatter),
    )
    learnt = replace(ship, baseline=base)
    found = tuple(
        CleanRun(run.name, each, problem.chi2_per_row(j))
        for j, (run, each) in enumerate(zip(runs, factors, strict=True))
    )
    return LearntBaseline(
        ship=Ship.from_yaml(learnt.to_yaml(), subject='the learnt baseline'),
        names=problem.names,
        factors=1.0 + mean,
        covariance=covariance,
        scatter=everything.scatter,
        scatter_low=everything.scatter_low,
        scatter_high=everything.scatter_high,
        relative_sd=relative_sd,
        stated_sd=None if ship.baseline is None else stated,
        speed_m_s=problem.speed_m_s,
        runs=found,
        warnings=tuple(_warnings(found, ship, problem)),
    )


def _scaled(
    problem: SharedBaseline,
    shared: Shared,
    mean: Float64,
    relative_sd: Float64,
    correlation: float,
    source: str,
) -> Baseline:
    """Return the baseline with what was learnt, in the form that it has."""
    base = problem.ship.baseline
    if isinstance(base, CoefficientBaseline):
        friction, wave = 1.0 + mean
        return replace(
            base,
            form_factor=_rounded(friction * (1.0 + base.form_factor) - 1.0),
            correlation_allowance=_rounded(friction * base.correlation_allowance),
            wave_coefficient=tuple(_rounded(wave * c) for c in base.wave_coefficient),
            relative_sd=CoefficientSd(
                _rounded(relative_sd[0]), _rounded(relative_sd[1]), _rounded(correlation)
            ),
            source=source,
        )
    assert base is not None
    # a table follows the shape as well
    parts = problem.relative_parts(np.array(base.speed_m_s))
    change = (problem.unit * (problem.at + shared.step)) @ parts
    force = np.array(base.resistance_n) * (1.0 + change)
    return replace(
        base,
        resistance_n=tuple(_rounded(value) for value in force),
        relative_sd=_rounded(relative_sd[0]),
        source=source,
    )


def _rounded(value: float) -> float:
    """Return as many digits as a reader of the ship file can use."""
    return float(f'{value:.7g}')


def _from_curves(runs: Sequence[CoastRun], ship: Ship, parameters: Parameters) -> Ship:
    """
    Return a ship with a table from r(v) of the runs.

    Beyond the speeds at which all of them may be used, it goes with the
    square of the speed.
    """
    found = [estimate_final(run.window, ship, parameters) for run in runs]
    whole = combine(found, [None] * len(found)) if len(found) > 1 else found[0].valid_curve
    speed, r = whole.speed_m_s, whole.resistance_m_s2
    if len(speed) < 2:
        raise EstimationError(
            f'r(v) of {runs[0].name} may be used at {len(speed)} speed(s), 2 are needed: give '
            'longer runs, or state a baseline in the ship file'
        )
    inner = np.linspace(speed[0], speed[-1], _FORM_POINTS)
    highest = _MARGIN * max(float(one.curve.speed_m_s[-1]) for one in found)
    points = np.concatenate([inner[0] * np.array([0.25, 0.5, 0.75]), inner, [highest]])
    inside = np.clip(points, inner[0], inner[-1])
    force = ship.mass_kg * np.interp(inside, speed, r) * (points / inside) ** 2
    base = TableBaseline(
        (0.0, *(_rounded(value) for value in points)),
        (0.0, *(_rounded(value) for value in force)),
        relative_sd=UNSTATED_FORM.mean,
        source=f'from {inner[0]:.3g} to {inner[-1]:.3g} m/s, beyond by the square of the speed',
    )
    return replace(ship, baseline=base)


def _source(shared: Shared, runs: int, speed_m_s: tuple[float, float], begun: Ship) -> str:
    assert begun.baseline is not None
    before = f' ({begun.baseline.source})' if begun.baseline.source else ''
    scatter = 'scatter not known from so few'
    if runs >= ENOUGH:
        scatter = f'scatter from run to run {100.0 * shared.scatter:.2g} %'
    many = 'run' if runs == 1 else 'runs'
    return f'{runs} clean {many} of {speed_m_s[0]:.3g}..{speed_m_s[1]:.3g} m/s, {scatter}{before}'


def _warnings(runs: Sequence[CleanRun], ship: Ship, problem: SharedBaseline) -> list[str]:
    found = []
    if ship.baseline is None:
        base = problem.ship.baseline
        assert base is not None
        found.append(f'the ship file states no baseline: it is a table of r(v), {base.source}')
    if len(runs) < ENOUGH:
        holds = 'the relative_sd that was stated still holds'
        if ship.baseline is None:
            holds = f'a relative_sd of {UNSTATED_FORM.mean:g} is stated'
        found.append(
            f'{len(runs)} run(s) do not show how runs differ: {holds}; with {_ASKED} runs their '
            'scatter replaces it'
        )
    elif len(runs) < _ASKED:
        found.append(f'{len(runs)} runs show their scatter roughly; {_ASKED} show it well')
    if len(runs) >= ENOUGH:
        limit = float(student.isf(0.5 * _STANDS_OUT / len(runs), len(runs) - 2))
        worst = max(runs, key=lambda run: abs(run.factor.away))
        if abs(worst.factor.away) > limit:
            found.append(
                f'{worst.name} stands out: its resistance is {worst.factor.value:+.1%} off the '
                'others; leave it out unless you know that it was clean'
            )
    found += [
        f'{run.name} is not explained by any baseline (chi^2 {run.chi2_per_row:.2g} a sample): '
        'look at it with `shipdrag diagnose`'
        for run in runs
        if run.chi2_per_row > _UNEXPLAINED
    ]
    return found
