# SPDX-License-Identifier: Apache-2.0
"""
A force that begins to swing with or after the stop: something, though no effect of the library.

No smooth function of the speed follows it, and noise that is learnt from the steady record does
not hold it. Its period is one of many that are alike before the data; each is tried by linear
algebra, as what a small force does to the motion is linear.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.special import logsumexp

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.coast_terms import Predicted
from shipdrag_ros.diagnosis.fitting import Fit, fit
from shipdrag_ros.diagnosis.measured import damping_of
from shipdrag_ros.diagnosis.model import UNNAMED_ODDS, start
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.search import SearchResult
from shipdrag_ros.inference.gaussian import Factored
from shipdrag_ros.inference.noise import apply
from shipdrag_ros.inference.rows import POSITION
from shipdrag_ros.parameter import Parameter, free, normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

_SD = 0.12  # of the force, sine and cosine each, of the resistance at the stop
_SHORTEST_S, _LONGEST_S = 80.0, 800.0  # periods
_APART = 0.5  # of one over the length of the run, between frequencies
_WEATHER = 0.1  # how often weather swings at one period
_STEPS = 600  # in which a force is followed, at least


@dataclass(frozen=True)
class SwingTerm:
    """
    What a force that swings from the stop of one run on does there.

    Attributes
    ----------
    run
    ship
        As she was in the run.
    speed_m_s
        At the stop.
    period_s
    """

    run: int
    ship: Ship
    speed_m_s: float
    period_s: float
    one_size: ClassVar[Sequence[int]] = range(2)

    @property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Sine and cosine of the force, over the mass [m/s^2]."""
        sd = size_m_s2(self.ship, self.speed_m_s)
        return free('swing, sine', normal(sd)), free('swing, cosine', normal(sd))

    def columns(self, seen: Observation, run: int, base: Predicted) -> tuple[Float64, Float64]:
        """Return (2, n) of the rows along and (2, k) of those across, per m/s^2."""
        across = np.zeros((2, 0 if seen.across is None else len(seen.across)))
        if run != self.run:
            return np.zeros((2, len(seen.along))), across
        if not np.isfinite(base.speed).all():  # a step that leaves the baseline is not taken
            return np.full((2, len(seen.along)), np.nan), across
        return swung(seen, base.speed, np.array([self.period_s])), across


def swinging(model: CoastModel, base: Fit) -> Fit | None:
    """
    Fit a force that swings from the stop on besides a hypothesis.

    Parameters
    ----------
    model
        With the runs.
    base
        Fit of the hypothesis.

    Returns
    -------
    Fit or None
        At the most probable period; its evidence is the mean over all periods, and over whether
        it is one run or all in which the force swings. None where it gains nothing, and where
        no run is longer than the shortest period.
    """
    longest_s = max(run.duration_s for run in model.seen)
    if not math.isfinite(base.log_evidence) or longest_s <= _SHORTEST_S:
        return None
    periods_s = _periods_s(longest_s, apart_s=longest_s)
    gain, runs = _gains(model, base, periods_s)
    if not np.isfinite(gain).all() or _mean(gain) <= 0.0:
        return None
    chosen, at = np.unravel_index(int(gain.argmax()), gain.shape)
    terms = tuple(
        SwingTerm(j, model.seen[j].ship, model.seen[j].speed_m_s, float(periods_s[at]))
        for j in runs[int(chosen)]
    )
    hypothesis = replace(
        base.hypothesis,
        measurement_terms=(*base.hypothesis.measurement_terms, *terms),
        discrepancy='force',
        log_prior=base.hypothesis.log_prior + math.log(UNNAMED_ODDS),
    )
    found = fit(model, [hypothesis], [start(model, hypothesis, base.best)])[0]
    # of the best period to that of all, and over what weather that swings all the time explains
    less = gain.max() - _mean(gain) + _weather(model, base, longest_s)
    return replace(found, log_evidence=found.log_evidence - less)


def _mean(gain: Float64) -> float:
    """Return the logarithm of the mean of Bayes factors."""
    return float(logsumexp(gain)) - math.log(gain.size)


def _weather(model: CoastModel, base: Fit, longest_s: float) -> float:
    """Return by how much weather that swings before and after the stop alike raises evidence."""
    lead_in_s = max(run.lead_in_s for run in model.seen)
    periods_s = _periods_s(longest_s, apart_s=longest_s + lead_in_s)
    gain, _ = _gains(model, base, periods_s, before=True)
    if not np.isfinite(gain).all():
        return 0.0
    swings = math.log(_WEATHER) + _mean(gain)
    return float(np.logaddexp(math.log1p(-_WEATHER), swings))


def with_swinging(found: SearchResult, model: CoastModel) -> SearchResult:
    """
    Fit a force that swings from the stop on, and nothing else that is missing.

    Parameters
    ----------
    found
        From `search`.
    model
        Of the same runs.

    Returns
    -------
    SearchResult
        The same where such a force gains nothing.
    """
    swings = swinging(model, found.nothing)
    return found if swings is None else replace(found, fits=(*found.fits, swings))


def swing_notes(found: Fit, model: CoastModel) -> tuple[str, ...]:
    """
    Say how a force swings in each run; nothing where none does.

    Parameters
    ----------
    found
        Of any hypothesis.
    model
        Of the same runs.
    """
    notes = []
    for part, place in found.hypothesis.parts:
        if not isinstance(part, SwingTerm):
            continue
        sine, cosine = found.best.z[place : place + 2]
        share = _SD * math.hypot(sine, cosine)
        notes.append(
            f'{model.seen[part.run].name}: a force swings over about {part.period_s:.0f} s, by '
            f'{100.0 * share:.0f} % of the resistance at the stop, as none did in the steady '
            'record before: a tow, an anchor, weed or a controller that is not off may do so'
        )
    return tuple(notes)


def size_m_s2(ship: Ship, speed_m_s: float) -> float:
    """
    Return the standard deviation of a swinging force before the data.

    Parameters
    ----------
    ship
        With a baseline.
    speed_m_s
        At the stop.

    Returns
    -------
    float
        Over the mass [m/s^2].
    """
    low, high = ship.baseline_range_m_s
    return _SD * float(ship.resistance_n(np.clip(speed_m_s, low, high))) / ship.mass_kg


def swung(
    seen: Observation, speed_m_s: Float64, periods_s: Float64, *, before: bool = False
) -> Float64:
    """
    Return what swinging forces do to the rows along the heading.

    Parameters
    ----------
    seen
        The run.
    speed_m_s : (m,)
        Through water without the force, at the times of the observation.
    periods_s : (p,)
    before
        Whether they swing in the steady record already.

    Returns
    -------
    (2 p, n)
        Per m/s^2 of the force over the mass; sines first, then cosines.

    Notes
    -----
    du/dt = (f - (dr/dv) u) / (1 + n_r), about the motion without it.
    """
    first_s = -seen.lead_in_s if before else 0.0
    steps = max(_STEPS, int((seen.duration_s - first_s) / 2.0))
    time = np.linspace(first_s, seen.duration_s, steps)
    speed = np.interp(time, seen.time_s - seen.lead_in_s, speed_m_s)
    damping, inertia = damping_of(seen.ship, speed)
    damped = cumulative_trapezoid(damping, time, initial=0.0)
    turns = 2.0 * np.pi / periods_s[:, None] * time
    force = np.concatenate([np.sin(turns), np.cos(turns)]) / inertia
    grown = cumulative_trapezoid(force * np.exp(damped), time, axis=1, initial=0.0)
    change = np.exp(-damped) * grown
    way = cumulative_trapezoid(change, time, axis=1, initial=0.0)
    since = np.clip(seen.along.rows.time_s - seen.lead_in_s, first_s, time[-1])
    place = (since - first_s) / (time[1] - time[0])
    at = np.minimum(place.astype(np.int64), len(time) - 2)
    part = place - at
    of_row = np.where(seen.along.rows.kind == POSITION, way[:, at], change[:, at])
    behind = np.where(seen.along.rows.kind == POSITION, way[:, at + 1], change[:, at + 1])
    result: Float64 = of_row + part * (behind - of_row)
    return result


def _periods_s(longest_s: float, *, apart_s: float) -> Float64:
    """Return periods up to the length of a run, that one of another length can separate."""
    slowest = 1.0 / min(_LONGEST_S, longest_s)
    frequency = np.arange(slowest, 1.0 / _SHORTEST_S, _APART / apart_s)
    return 1.0 / np.append(frequency, 1.0 / _SHORTEST_S)


def _gains(
    model: CoastModel, base: Fit, periods_s: Float64, *, before: bool = False
) -> tuple[Float64, list[tuple[int, ...]]]:
    """Return the log Bayes factors, (ways, periods), and the runs of each way."""
    columns = [_whitened(model, j, base, periods_s, before) for j in range(len(model.seen))]
    matrix, _ = base.best.normal_equations
    shared = np.concatenate(
        [
            column @ table[1:, : column.shape[1]].T
            for table, column in zip(base.best.tables, columns, strict=True)
        ]
    )
    # the rest of the hypothesis gives way
    precision = -shared @ np.linalg.lstsq(matrix, shared.T, rcond=1e-13)[0]
    negative_gradient = []
    for j, (table, column) in enumerate(zip(base.best.tables, columns, strict=True)):
        own = slice(j * len(column), (j + 1) * len(column))
        precision[own, own] += column @ column.T
        negative_gradient.append(column @ table[0, : column.shape[1]])
    precision[np.diag_indices_from(precision)] += 1.0
    gradient = np.concatenate(negative_gradient)
    runs: list[tuple[int, ...]] = [(j,) for j in range(len(columns))]
    runs += [tuple(range(len(columns)))] * (len(columns) > 1)
    gain = np.empty((len(runs), len(periods_s)))
    for way, chosen in enumerate(runs):
        for i in range(len(periods_s)):
            at = [(2 * j + k) * len(periods_s) + i for j in chosen for k in range(2)]
            factored, pull = Factored.of(precision[np.ix_(at, at)]), gradient[at, np.newaxis]
            gain[way, i] = 0.5 * (float((pull * factored.solve(pull)).sum()) - factored.log_det)
    return gain, runs


def _whitened(model: CoastModel, run: int, base: Fit, periods_s: Float64, before: bool) -> Float64:
    """Return what a force of the usual size does to the whitened rows, (2 p, n)."""
    seen = model.seen[run]
    speed = model.predict(run, base.best).speed
    size = size_m_s2(seen.ship, seen.speed_m_s)
    return apply(seen.along.whitener, size * swung(seen, speed, periods_s, before=before))
