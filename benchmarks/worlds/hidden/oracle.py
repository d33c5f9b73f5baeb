# SPDX-License-Identifier: Apache-2.0
"""
The best that could be done: a diagnosis that knows the physics of the cases.

Each hypothesis is simulated with the generator's own simulator and weighed by
its Laplace evidence, under the true covariance of all that is random and with
the true shares of the kinds of cases. What no diagnosis can know, it cannot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular

from benchmarks.worlds.hidden.cases import PAIRS, RECIPROCAL, SHARES, TESTS, Known, Observation
from benchmarks.worlds.hidden.effect import Effect, Size
from benchmarks.worlds.hidden.hull import Array
from benchmarks.worlds.hidden.library import FIRST_SHELF, SECOND_SHELF
from benchmarks.worlds.hidden.oracle_data import SeenRun

ALARM_BELOW = 0.1  # probability that nothing is hidden
NAME_FROM = 0.9
HELD = 0.99  # by the set of candidates
LACK_NATS = 5.0  # by which a smooth discrepancy may beat the name alone
_STEPS = 9
_HOPELESS_NATS = 40.0
_DRAWN = 8  # starts from the prior
_STARTS = 2  # of the signs that signed parameters may have
_COURSE_SD_RAD = 0.2
_BY_NAME = {kind.name: kind for kind in (*FIRST_SHELF, *SECOND_SHELF)}
Names = tuple[str, ...]


@dataclass(frozen=True)
class _Fit:
    """
    A hypothesis at its best.

    Attributes
    ----------
    names
    log_evidence
        With the share of its kind among the cases.
    theta, precision
        Parameters of the fit, and the posterior precision.
    effects
    residual, jacobian
        Whitened, at the best; of the measurements alone.
    prior
        Precision.
    """

    names: Names
    log_evidence: float
    theta: Array
    precision: Array
    effects: tuple[Effect, ...]
    residual: Array
    jacobian: Array
    prior: Array


def diagnose(seen: Observation, known: Known) -> dict[str, Any]:
    """
    Answer in the form of `diagnose --json`.
    """
    return _Oracle(seen, known).answer()


class _Oracle:
    def __init__(self, seen: Observation, known: Known) -> None:
        self.runs = [SeenRun(seen, number, known) for number in range(len(seen.runs))]
        parts = [run.disturbed() for run in self.runs]
        shared = np.vstack([part[1] for part in parts])
        self.covariance = block_diag(*(part[0] for part in parts)) + shared @ shared.T
        self.generic = {
            channel: block_diag(*(part[2][channel] for part in parts))
            for channel in ('force', 'log', 'radar')
        }
        self.measured = np.concatenate([run.measured for run in self.runs])
        context, variances = self._context_measured()
        self.measured = np.concatenate([self.measured, context])
        extra = len(context)
        self.covariance = block_diag(self.covariance, np.diag(variances))
        self.generic = {
            channel: block_diag(matrix, np.zeros((extra, extra)))
            for channel, matrix in self.generic.items()
        }
        self.factor = np.linalg.cholesky(self.covariance)
        self.inputs = set(seen.runs[0])
        # common parameters: speed and course of each run
        n = len(self.runs)
        self.common = np.array([[run.speed_m_s for run in self.runs], [0.0] * n]).T.ravel()
        self.common_sd = np.array([[1.5] * n, [_COURSE_SD_RAD] * n]).T.ravel()

    def answer(self) -> dict[str, Any]:
        fits = [self._fit(())]
        for name in _BY_NAME:
            fits.append(self._fit((name,), floor=max(fit.log_evidence for fit in fits)))
        generic = {channel: self._generic(fits[0], channel) for channel in self.generic}
        best = max(fits, key=lambda fit: fit.log_evidence)
        if self._lacks(best, nats=0.0):
            fits += [self._fit(pair, floor=best.log_evidence) for pair in PAIRS]
        logs = np.array([fit.log_evidence for fit in fits] + list(generic.values()))
        chances = np.exp(logs - np.max(logs))
        chances /= np.sum(chances)
        ranked = sorted(zip(chances, fits, strict=False), key=lambda pair: -pair[0])
        return self._verdict(ranked, float(np.sum(chances[len(fits) :])))

    def _verdict(self, ranked: Sequence[tuple[float, _Fit]], unknown: float) -> dict[str, Any]:
        nothing = next(chance for chance, fit in ranked if not fit.names)
        listed = [(chance, fit.names) for chance, fit in ranked]
        listed = sorted([*listed, (unknown, ('unknown',))], key=lambda pair: -pair[0])
        held = np.cumsum([chance for chance, _ in listed])
        listed = listed[: int(np.searchsorted(held, HELD)) + 1]
        named = [pair for pair in ranked if pair[1].names]
        chance, best = named[0]
        verdict, effects = 'one_of', []
        if nothing >= ALARM_BELOW:
            verdict = 'none'
        elif unknown > 0.5 or self._lacks(best):
            verdict = 'unknown'
            if listed[0][1] != ('unknown',):
                listed = [(NAME_FROM, ('unknown',)), (1.0 - NAME_FROM, listed[0][1])]
        elif chance >= NAME_FROM:
            verdict, effects = 'named', self._effects(chance, best)
        candidates = [{'names': list(names), 'probability': float(p)} for p, names in listed]
        return {
            'verdict': verdict,
            'effects': effects,
            'candidates': candidates,
            'would_decide': self._would_decide([set(names) for _, names in listed]),
            'gap': {'held_out_after': {'chi2_per_sample': self._held_out(best)}},
        }

    def _effects(self, chance: float, fit: _Fit) -> list[dict[str, Any]]:
        """State the parameters, with the sd of each from the posterior."""
        covariance = np.linalg.inv(fit.precision)
        place, found = len(self.common), []
        for effect in fit.effects:
            values = effect.parameters()
            sizes = effect.sizes
            sds = np.sqrt(np.diag(covariance))[place : place + len(sizes)]
            found.append(
                {
                    'name': effect.name,
                    'probability': float(chance),
                    # the fit is of logarithms
                    'parameters': {
                        size.name: {
                            'value': values[size.name],
                            'sd': abs(values[size.name]) * float(sd),
                        }
                        for size, sd in zip(sizes, sds)
                        if size.name in values
                    },
                }
            )
            place += len(sizes)
        return found

    def _would_decide(self, candidates: Sequence[set[str]]) -> list[str]:
        """Recommend by rule what splits the candidates."""
        names = set().union(*candidates)
        wanted = []
        if len(self.runs) == 1:
            wanted.append(
                (RECIPROCAL, {'current', 'wind', 'waves', 'log_offset', 'current_change'})
            )
            wanted.append((RECIPROCAL, {'residual_thrust', 'turning'}))
        wanted += [
            ('speed_over_ground', {'log_scale', 'radar_scale'}),
            ('shaft', {'locked_propeller', 'windmilling_propeller', 'residual_thrust'}),
            ('depth', {'shallow_water'}),
            ('wind_apparent', {'wind'}),
            ('heading', {'turning'}),
        ]
        tests = [test for test, of in wanted if names & of and test not in self.inputs]
        return [test for test in dict.fromkeys(tests) if test in TESTS]

    def _fit(self, names: Names, *, floor: float = -np.inf) -> _Fit:
        """Climb from the best of a few starts; far below the floor is not climbed on."""
        sizes = [size for name in names for size in _BY_NAME[name].sizes]
        prior = np.concatenate([1.0 / self.common_sd**2, [1.0 / _spread(s) ** 2 for s in sizes]])
        centre = np.concatenate([self.common, [_middle(size) for size in sizes]])
        signs = product(*(((1.0, -1.0) if size.signed else (1.0,)) for size in sizes))
        starts = [(np.array(sign), centre) for sign in signs]
        if len(sizes) > 1:
            drawn = np.random.default_rng(0).standard_normal((_DRAWN, len(sizes)))
            common = np.zeros((_DRAWN, len(self.common)))
            spread = np.column_stack([common, drawn]) / np.sqrt(prior)
            starts += [(sign, centre + off) for sign, _ in starts for off in spread]
        costs = [_square(self._residual(names, *start)) for start in starts]
        climbed = {}
        for i in np.argsort(costs):
            sign, start = starts[i]
            if tuple(sign) not in climbed and len(climbed) < _STARTS:
                climbed[tuple(sign)] = self._climb(names, sign, start, centre, prior, floor)
        share = np.log(SHARES[names])
        evidences = np.array([fit.log_evidence for fit in climbed.values()])
        best = max(climbed.values(), key=lambda fit: fit.log_evidence)
        halves = sum(size.signed for size in sizes) * np.log(2.0)
        total = float(np.logaddexp.reduce(evidences)) - halves + share
        return _Fit(
            names,
            total,
            best.theta,
            best.precision,
            best.effects,
            best.residual,
            best.jacobian,
            best.prior,
        )

    def _climb(
        self,
        names: Names,
        signs: Array,
        start: Array,
        centre: Array,
        prior: Array,
        floor: float,
    ) -> _Fit:
        """Levenberg-Marquardt on the whitened residuals and the prior."""
        theta, damping = start.copy(), 1e-3
        residual = self._residual(names, signs, theta)
        cost = _cost(residual, theta - centre, prior)
        jacobian = self._jacobian(names, signs, theta, residual)
        for _ in range(_STEPS):
            precision = jacobian.T @ jacobian + np.diag(prior)
            slope = jacobian.T @ residual - prior * (theta - centre)
            step = np.linalg.solve(precision + damping * np.diag(np.diag(precision)), slope)
            step = np.clip(step, -2.0 / np.sqrt(prior), 2.0 / np.sqrt(prior))
            tried = theta + step
            after = self._residual(names, signs, tried)
            cost_after = _cost(after, tried - centre, prior)
            if not cost_after < cost:
                damping = max(10.0 * damping, 1e-3)
                if damping > 1e4:
                    break
                continue
            gained, cost = cost - cost_after, cost_after
            theta, residual, damping = tried, after, 0.1 * damping
            jacobian = self._jacobian(names, signs, theta, residual)
            hopeless = -0.5 * cost < floor - _HOPELESS_NATS and gained < 0.3 * cost
            if gained < 0.1 or hopeless:
                break
        precision = jacobian.T @ jacobian + np.diag(prior)
        evidence = (
            -0.5 * cost - 0.5 * np.linalg.slogdet(precision)[1] + 0.5 * np.sum(np.log(prior))
        )
        effects = self._effects_of(names, signs, theta)
        return _Fit(names, evidence, theta, precision, effects, residual, jacobian, prior)

    def _jacobian(self, names: Names, signs: Array, theta: Array, residual: Array) -> Array:
        """Return minus the slope of the residual."""
        columns = []
        for k in range(len(theta)):
            moved = theta.copy()
            h = 2e-4 if k < len(self.common) else 2e-3
            moved[k] += h
            columns.append((residual - self._residual(names, signs, moved)) / h)
        return np.column_stack(columns)

    def _residual(self, names: Names, signs: Array, theta: Array) -> Array:
        effects = self._effects_of(names, signs, theta)
        first_rad = self.runs[0].frame_rad + theta[1]
        predicted = [
            run.predicted(effects, max(speed, 0.5), course, first_rad)
            for run, (speed, course) in zip(self.runs, theta[: len(self.common)].reshape(-1, 2))
        ]
        off = self.measured - np.concatenate([*predicted, self._context_predicted(effects)])
        return solve_triangular(self.factor, off, lower=True, check_finite=False)

    def _effects_of(self, names: Names, signs: Array, theta: Array) -> tuple[Effect, ...]:
        sizes = signs * np.exp(theta[len(self.common) :])
        leg = self.runs[0].leg(max(float(theta[0]), 0.5))
        effects, place = [], 0
        for name in names:
            kind = _BY_NAME[name]
            n = len(kind.sizes)
            effects.append(kind.of(leg, sizes[place : place + n].tolist()))
            place += n
        return tuple(effects)

    def _context_measured(self) -> tuple[Array, Array]:
        values, variances = [], []
        for run in self.runs:
            if (wind := run.true_wind) is not None:
                values += list(wind[0])
                variances += list(wind[1])
            if (shoal := run.shoal) is not None:
                values.append(shoal[0])
                variances.append(shoal[1])
            if (factor := run.radar_factor) is not None:
                values.append(factor[0])
                variances.append(factor[1])
        return np.array(values), np.array(variances)

    def _context_predicted(self, effects: tuple[Effect, ...]) -> Array:
        wind = np.array([effect.wind_m_s() for effect in effects] or [(0.0, 0.0)]).sum(axis=0)
        depths = [depth for effect in effects if (depth := effect.depth_m()) is not None]
        values = []
        for run in self.runs:
            if run.true_wind is not None:
                values += list(wind)
            if (shoal := run.shoal) is not None:
                # any depth may be read where the water does not matter
                deep = min(shoal[0], 0.12)
                values.append(run.known.hull.draught_m / depths[0] if depths else deep)
            if run.radar_factor is not None:
                values.append(_radar_factor(run, effects))
        return np.array(values)

    def _generic(self, nothing: _Fit, channel: str) -> float:
        """Return the evidence of a smooth discrepancy of a channel."""
        return self._with_discrepancy(nothing, channel) + np.log(SHARES[('unknown',)] / 3.0)

    def _lacks(self, fit: _Fit, *, nats: float = LACK_NATS) -> bool:
        """Say whether a name leaves more than noise."""
        alone = fit.log_evidence - np.log(SHARES[fit.names])
        beside = max(self._with_discrepancy(fit, channel) for channel in self.generic)
        return beside > alone + nats

    def _with_discrepancy(self, fit: _Fit, channel: str) -> float:
        """Return the evidence, linear about the best, under a wider covariance."""
        half = solve_triangular(self.factor, self.generic[channel], lower=True)
        wider = np.eye(len(self.measured)) + solve_triangular(self.factor, half.T, lower=True)
        centre = np.concatenate([self.common, np.zeros(len(fit.theta) - len(self.common))])
        for k, size in enumerate(s for e in fit.effects for s in e.sizes):
            centre[len(self.common) + k] = _middle(size)
        at_centre = fit.residual + fit.jacobian @ (fit.theta - centre)
        factor = cho_factor(wider, lower=True)
        weighed = cho_solve(factor, np.column_stack([fit.jacobian, at_centre]))
        precision = fit.jacobian.T @ weighed[:, :-1] + np.diag(fit.prior)
        slope = fit.jacobian.T @ weighed[:, -1]
        chi2 = at_centre @ weighed[:, -1] - slope @ np.linalg.solve(precision, slope)
        determinant = 2.0 * np.sum(np.log(np.diag(factor[0]))) - np.sum(np.log(fit.prior))
        return float(-0.5 * (chi2 + determinant + np.linalg.slogdet(precision)[1]))

    def _held_out(self, fit: _Fit) -> float | None:
        """Return chi^2 per sample of the last run, given the others."""
        if len(self.runs) < 2:
            return None
        # whitened in order, the second run is what the first does not foretell
        first = len(self.runs[0].measured)
        residual = fit.residual[first : first + len(self.runs[1].measured)]
        return float(residual @ residual) / len(residual)


def _radar_factor(run: SeenRun, effects: tuple[Effect, ...]) -> float:
    leg, place = run.leg(run.speed_m_s), np.array([[1.0, 0.0]])
    for effect in effects:
        place = effect.radar(leg, np.zeros(1), place)
    return float(place[0, 0])


def _middle(size: Size) -> float:
    return 0.5 * float(np.log(size.low) + np.log(size.high))


def _spread(size: Size) -> float:
    return float(np.log(size.high / size.low)) / np.sqrt(12.0)


def _square(residual: Array) -> float:
    square = float(residual @ residual)
    return square if np.isfinite(square) else np.inf


def _cost(residual: Array, off: Array, prior: Array) -> float:
    return _square(residual) + float(prior @ off**2)
