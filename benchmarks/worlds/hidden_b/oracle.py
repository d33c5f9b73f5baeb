# SPDX-License-Identifier: Apache-2.0
"""
What can be had in world B: a diagnosis that knows its physics.

Each hypothesis is sailed by the generator's own laws and weighed by its Laplace evidence, under
the covariance of all that is random and with the true shares of the kinds of cases. Of the ship
it knows the lines, the propeller and the kind of instruments; her resistance and added mass as
the ship file states them, with the stated errors. Sizes of effects have priors as wide as
manuals would have them, not those that are drawn from.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from benchmarks.worlds.hidden_b.cases import Known, Observation
from benchmarks.worlds.hidden_b.effects import Hidden
from benchmarks.worlds.hidden_b.hulls import Array, Hull
from benchmarks.worlds.hidden_b.oracle_noise import Scatter
from benchmarks.worlds.hidden_b.oracle_priors import (
    SIZES,
    Names,
    drawn,
    free,
    possible,
    shares,
)
from benchmarks.worlds.hidden_b.oracle_sail import (
    Change,
    Run,
    made,
    run_of,
    sailed,
    shared,
    stated,
)
from benchmarks.worlds.hidden_b.plans import PAIRS
from benchmarks.worlds.hidden_b.setting import Setting
from benchmarks.worlds.hidden_b.voyage import steady_point

ALARM_BELOW = 0.1  # probability that nothing is hidden
NAME_FROM = 0.9
HELD = 0.99  # by the set of candidates
LACK_NATS = 5.0  # by which a smooth discrepancy may beat the name alone
_STEPS = 12
_STARTS = 3  # where the first point may be on the wrong slope
_WORTH_NATS = 15.0  # below the best: not looked at closely
_SPEED_SD, _COURSE_SD = 0.3, 0.2  # relative; [rad]
_GUSTY = {'wind', 'waves'}  # what scatters more itself
_HOPELESS = 3.0  # chi^2 over the best; more gusts will not mend that
_DEEP = (0.0625, 0.0125)  # draught over depth where the water does not matter


EDDIES = (0.055, 0.1, 0.185)  # percent of the speed: middles of thirds of what is drawn
HELM = (0.35, 0.65)  # degrees: of halves
Weather = tuple[float, float]  # sizes of eddies and of helm


@dataclass(frozen=True)
class Terms:
    """
    What the evidence of a fit is made of.

    Attributes
    ----------
    parts
        Covariances: of all but eddies and helm, of either of size 1.
    smooth
        Columns of smooth unknowns, by name.
    whole
        What is off at the middle of the prior, linear about the best.
    slopes
        By standard normal numbers.
    less
        To be taken from the logarithm.
    """

    parts: Sequence[Array]
    smooth: dict[str, Array]
    whole: Array
    slopes: Array
    less: float

    def evidence(self, weather: Weather, kind: str | None = None) -> float:
        """
        Return the logarithm of the evidence, with an unknown of a kind beside it.
        """
        n = len(self.parts[0])
        covariance = self.slopes @ self.slopes.T + np.eye(len(self.whole))
        covariance[:n, :n] += summed(self.parts, weather) - np.eye(n)
        if kind is not None:
            covariance[:n, :n] += self.smooth[kind] @ self.smooth[kind].T
        factor = np.linalg.cholesky(covariance)
        white = solve_triangular(factor, self.whole, lower=True, check_finite=False)
        return -0.5 * float(white @ white) - float(np.sum(np.log(np.diag(factor)))) - self.less

    def beside(self, weather: Weather) -> dict[str, float]:
        """
        Return the same with each kind of unknown.
        """
        return {kind: self.evidence(weather, kind) for kind in self.smooth}

    def weather(self) -> Weather:
        """
        Return how large eddies and helm are, by what explains most; unknowns are let in.
        """

        def best(weather: Weather) -> float:
            kinds = (None, 'force, quick', 'force and helm')
            return max(self.evidence(weather, kind) for kind in kinds)

        return max(product(EDDIES, HELM), key=best)


def summed(parts: Sequence[Array], weather: Weather) -> Array:
    """
    Return the covariance of a row in a weather, of its parts.
    """
    return parts[0] + weather[0] ** 2 * parts[1] + weather[1] ** 2 * parts[2]


@dataclass(frozen=True)
class Fit:
    """
    A hypothesis at its best.

    Attributes
    ----------
    names, signs
    z
        Speeds and courses of the runs, then the sizes: standard normal numbers.
    cost
        Chi^2 with the prior.
    evidence
        Its logarithm, with the share of its kind.
    """

    names: Names
    signs: tuple[float, ...]
    z: Array
    cost: float = np.inf
    evidence: float = -np.inf


def diagnose(seen: Observation, known: Known) -> dict[str, Any]:
    """
    Answer in the form of `diagnose --json`.
    """
    return _Oracle(seen, known).answer()


class _Oracle:
    def __init__(self, seen: Observation, known: Known) -> None:
        self.known = known
        self.stated = stated(seen.ship_file, known)
        hull = self.stated.hull
        self.runs = [Run(run, number, known, hull) for number, run in enumerate(seen.runs)]
        self.scatters = [Scatter(run) for run in self.runs]
        need = float(np.interp(hull.speed_m_s, hull.grid_m_s, hull.still_n))
        first = run_of(known, hull, 0, hull.speed_m_s, 0.0)
        self.steady = steady_point(first, need)
        self.common = 2 * len(self.runs)
        self._about(Fit((), (), np.zeros(self.common)))

    # what would be seen

    def _settings(self, fit: Fit, hull: Hull | None = None) -> list[Setting]:
        hull = hull or self.stated.hull
        effects, z = self._effects(fit), fit.z
        settings: list[Setting] = []
        for k, run in enumerate(self.runs):
            speed = run.speed_m_s * float(np.clip(1.0 + _SPEED_SD * z[2 * k], 0.2, 3.0))
            heading = run.heading_rad + _COURSE_SD * float(z[2 * k + 1])
            setting = run_of(self.known, hull, k, speed, heading)
            setting.first_rad = settings[0].heading_rad if k else heading
            for effect in effects:
                if effect.scope != 'run' or k == 0:
                    effect.apply(setting)
            settings.append(setting)
        return settings

    def _effects(self, fit: Fit) -> list[Hidden]:
        found = []
        left = iter(zip(fit.z[self.common :].tolist(), fit.signs, strict=True))
        for name in fit.names:
            given = drawn(name, [size.at(*next(left)) for size in SIZES[name]])
            found.append(made(name, given, self.stated.hull, self.known, self.steady))
        return found

    def _row(self, settings: list[Setting]) -> Array:
        sail = [sailed(setting, self.known) for setting in settings]
        return np.concatenate([run.predicted(each) for run, each in zip(self.runs, sail)])

    def _about(self, fit: Fit) -> None:
        """Linearize about a fit what is not fitted: what all runs share, speeds and courses."""

        def row(change: Change, hull: Hull) -> Array:
            settings = self._settings(fit, hull)
            for each in settings:
                change(each)
            return self._row(settings)

        self.shared = shared(row, self.stated)
        self.slopes = self._slopes(fit, range(self.common))
        covariance = summed(self._scatter(fit)[0], (EDDIES[1], HELM[1]))
        self.factor = np.linalg.cholesky(covariance)

    def _scatter(self, fit: Fit) -> tuple[list[Array], dict[str, Array]]:
        """Return covariances, apart, of eddies and of helm, and columns of smooth unknowns."""
        settings = self._settings(fit)
        parts = [
            scatter.about(setting, sailed(setting, self.known))
            for scatter, setting in zip(self.scatters, settings)
        ]
        found = [block_diag(*(part[k] for part in parts)) for k in range(3)]
        found[0] += self.shared @ self.shared.T
        smooth = {}
        for kind in parts[0][3]:
            # forces and air under the log are of one run, a gyro of all
            blocks = [part[3][kind] * (k == 0 or kind == 'gyro') for k, part in enumerate(parts)]
            smooth[kind] = np.concatenate(blocks)
        return found, smooth

    def _shoals(self, names: Names, settings: list[Setting]) -> Iterator[tuple[float, float]]:
        """Yield by how much each echo sounder is off, in sd, and the sd."""
        for run, setting in zip(self.runs, settings):
            if run.shoal is not None:
                shallow = 'shallow_water' in names
                wanted = self.known.hull.draught_m / setting.depth_m if shallow else _DEEP[0]
                sd = 0.03 * wanted if shallow else _DEEP[1]
                yield (run.shoal - wanted) / sd, sd

    # fits

    def _whitened(self, fit: Fit) -> Array:
        return self._white(self._whole(fit)[0])

    def _slopes(self, fit: Fit, which: Sequence[int]) -> Array:
        """Return minus the slope of the residual (not whitened), echo sounders with it."""
        columns, here = [], self._whole(fit)[0]
        for k in which:
            step = np.zeros(len(fit.z))
            step[k] = 3e-4 if k < self.common else 0.01
            columns.append((here - self._whole(replace(fit, z=fit.z + step))[0]) / step[k])
        return np.stack(columns, axis=1) if columns else np.zeros((len(here), 0))

    def _whole(self, fit: Fit) -> tuple[Array, list[float]]:
        """Return by how much all is off, the echo sounders in their sd, and these sd."""
        settings = self._settings(fit)
        shoals = list(self._shoals(fit.names, settings))
        off = np.concatenate([run.measured for run in self.runs]) - self._row(settings)
        return np.concatenate([off, [each for each, _ in shoals]]), [sd for _, sd in shoals]

    def _white(self, columns: Array) -> Array:
        n = len(self.factor)
        white = solve_triangular(self.factor, columns[:n], lower=True, check_finite=False)
        return np.concatenate([white, columns[n:]])

    def _begun(self, names: Names, starts: Mapping[str, Fit]) -> list[Fit]:
        """Return where to begin with a hypothesis: the best of a few points for each sign."""
        sizes = [size for name in names for size in SIZES[name]]
        varied = free(names)
        if len(names) == 1:
            points = {0: 1, 1: 5, 2: 4}.get(len(varied), 0)
            grid = np.array(list(product(*[np.linspace(-1.3, 1.3, points)] * len(varied))))
            if not points:
                grid = np.random.default_rng(0).uniform(-1.4, 1.4, (40, len(varied)))
        else:
            bests = np.concatenate([starts[name].z[self.common :] for name in names])
            spread = np.random.default_rng(0).uniform(-1.4, 1.4, (8, len(sizes)))
            grid = np.concatenate([[bests], spread])[:, varied]
        nuisance = self._white(self.slopes)
        precision = nuisance.T @ nuisance + np.eye(self.common)
        begun = []
        for signs in product(*[(1.0, -1.0) if size.sign else (1.0,) for size in sizes]):
            tried = []
            for point in grid:
                z = np.zeros(self.common + len(sizes))
                z[self.common + np.array(varied, int)] = point
                white = self._whitened(Fit(names, signs, z))
                z[: self.common] = np.linalg.solve(precision, nuisance.T @ white)
                white = white - nuisance @ z[: self.common]
                tried.append(Fit(names, signs, z, float(white @ white + z @ z)))
            tried.sort(key=lambda fit: fit.cost)
            begun += tried[: _STARTS if len(varied) > 2 else 1]
        return begun

    def _climbed(self, fit: Fit, floor: float = np.inf) -> Fit:
        """
        Climb by Levenberg-Marquardt; what stays far above the floor is left.

        The slopes of speed and course stay those of the plain run.
        """
        which = [self.common + k for k in free(fit.names)]
        used = [*range(self.common), *which]
        white = self._whitened(fit)
        fit, damping = replace(fit, cost=float(white @ white + fit.z @ fit.z)), 1e-3
        plain = self._white(self.slopes)
        slopes = np.concatenate([plain, self._white(self._slopes(fit, which))], 1)
        for done in range(_STEPS):
            precision = slopes.T @ slopes + np.eye(len(used))
            turn = precision + damping * np.diag(np.diag(precision))
            step = np.linalg.solve(turn, slopes.T @ white - fit.z[used])
            z = fit.z.copy()
            z[used] += np.clip(step, -1.5, 1.5)
            after = replace(fit, z=z)
            after_white = self._whitened(after)
            cost = float(after_white @ after_white + z @ z)
            if not cost < fit.cost:
                damping = max(10.0 * damping, 0.01)
                if damping > 1e2:
                    break
                continue
            gained, fit, white = fit.cost - cost, replace(after, cost=cost), after_white
            damping *= 0.1
            # what more runs cost in any case is no hope of gaining more; far off, slopes mislead
            above = cost - floor
            hopeless = above > 4.0 * _WORTH_NATS and gained < 0.2 * above
            if gained < 0.3 or (done > 1 and hopeless):
                break
            slopes[:, self.common :] = self._white(self._slopes(fit, which))
        return fit

    # evidence

    def _terms(self, fit: Fit) -> Terms:
        """Return what the evidence of a fit is made of."""
        around = self._scatter(fit) if set(fit.names) & _GUSTY else self.around
        off, sds = self._whole(fit)
        sizes = range(self.common, len(fit.z))
        slopes = self._slopes(fit, sizes)
        slopes = np.concatenate([self.slopes, slopes], axis=1)
        whole = off + slopes @ fit.z
        halves = sum(size.sign for name in fit.names for size in SIZES[name])
        less = float(np.sum(np.log(sds or [1.0]))) + halves * np.log(2.0)
        return Terms(*around, whole, slopes, less - float(np.log(shares()[fit.names])))

    def answer(self) -> dict[str, Any]:
        """Weigh all, and say what they come to."""
        nothing = self._climbed(Fit((), (), np.zeros(self.common)))
        begun = [fit for name in possible(self.known) for fit in self._begun((name,), {})]
        fits = [nothing, *self._all_climbed(begun, nothing.cost)]
        starts = {fit.names[0]: fit for fit in sorted(fits[1:], key=lambda f: -f.cost)}
        near = min(fits, key=lambda fit: fit.cost)
        self._about(near)
        close = [fit for fit in fits[1:] if fit.cost < near.cost + 4.0 * _WORTH_NATS]
        nothing = self._climbed(nothing)
        fits = [nothing, *self._all_climbed(close, nothing.cost)]
        weighed = self._worth(fits)
        best, terms = max(weighed, key=lambda each: each[0].evidence)
        pairs = [tuple(sorted(pair)) for pair in PAIRS if set(pair) <= starts.keys()]
        if max(terms.beside(self.weather).values()) < best.evidence:  # a name alone may do
            pairs = [pair for pair in pairs if set(best.names) & set(pair)]
        begun = [fit for pair in pairs for fit in self._begun(pair, starts)]
        if begun:
            fits += self._all_climbed(begun, min(fit.cost for fit in fits))
            weighed = self._worth(fits)
        return self._verdict(weighed)

    def _all_climbed(self, begun: Sequence[Fit], floor: float) -> list[Fit]:
        """Climb from the best on, so that the hopeless are known; one fit of each sign."""
        found: dict[tuple[Names, tuple[float, ...]], Fit] = {}
        for each in sorted(begun, key=lambda fit: fit.cost):
            fit = self._climbed(each, floor)
            if set(fit.names) & _GUSTY and fit.cost < _HOPELESS * floor:
                fit = self._in_its_own_weather(fit)
            kind = fit.names, fit.signs
            found[kind] = min(found.get(kind, fit), fit, key=lambda fit: fit.cost)
            floor = min(floor, fit.cost)
        return list(found.values())

    def _in_its_own_weather(self, fit: Fit) -> Fit:
        """Climb again, under the scatter that goes with what was found."""
        plain = self.factor
        self.factor = np.linalg.cholesky(summed(self._scatter(fit)[0], (EDDIES[1], HELM[1])))
        fit = self._climbed(fit)
        wider = float(np.sum(np.log(np.diag(self.factor) / np.diag(plain))))
        self.factor = plain
        return replace(fit, cost=fit.cost + 2.0 * wider)

    def _worth(self, fits: Sequence[Fit]) -> list[tuple[Fit, Terms]]:
        """Weigh what is near the best, and nothing hidden in any case."""
        near = min(fits, key=lambda fit: fit.cost)
        calm = [fit for fit in fits if not set(fit.names) & _GUSTY]
        self.around = self._scatter(min(calm, key=lambda fit: fit.cost))
        self.weather = self._terms(near).weather()
        least, found = near.cost + 2.0 * _WORTH_NATS, []
        for fit in fits:
            if not fit.names or fit.cost < least:
                terms = self._terms(fit)
                found.append((replace(fit, evidence=terms.evidence(self.weather)), terms))
        return found

    def _verdict(self, weighed: Sequence[tuple[Fit, Terms]]) -> dict[str, Any]:
        by_names: dict[Names, list[Fit]] = {}
        for fit, _ in weighed:
            by_names.setdefault(fit.names, []).append(fit)
        logs = {
            names: float(np.logaddexp.reduce([fit.evidence for fit in fits]))
            for names, fits in by_names.items()
        }
        terms = {id(fit): each for fit, each in weighed}
        odds = np.log(shares()[('unknown',)] / shares()[()])
        kinds = terms[id(by_names[()][0])].beside(self.weather)
        logs[('unknown',)] = odds + float(
            np.logaddexp.reduce(list(kinds.values())) - np.log(len(kinds))
        )
        top = np.logaddexp.reduce(list(logs.values()))
        chances = {names: float(np.exp(log - top)) for names, log in logs.items()}
        listed = sorted(((p, names) for names, p in chances.items()), reverse=True)
        held = np.cumsum([p for p, _ in listed])
        listed = listed[: int(np.searchsorted(held, HELD)) + 1]
        names = (each for each in by_names if each)
        named = max(((chances[each], each) for each in names), default=(0.0, ()))
        best = max(by_names[named[1]], key=lambda fit: fit.evidence)
        beside = terms[id(best)].beside(self.weather)
        lacks = max(beside.values()) > best.evidence + LACK_NATS
        verdict, effects = 'one_of', []
        if chances[()] >= ALARM_BELOW:
            verdict = 'none'
        elif chances[('unknown',)] > 0.5 or lacks:
            verdict = 'unknown'
            if listed[0][1] != ('unknown',):
                listed = [(NAME_FROM, ('unknown',)), (1.0 - NAME_FROM, listed[0][1])]
        elif named[0] >= NAME_FROM:
            verdict, effects = 'named', self._stated(named[0], best)
        return {
            'verdict': verdict,
            'effects': effects,
            'candidates': [{'names': list(names), 'probability': p} for p, names in listed],
        }

    def _stated(self, chance: float, fit: Fit) -> list[dict[str, Any]]:
        return [
            {
                'name': effect.name,
                'probability': chance,
                'parameters': {name: {'value': v} for name, v in effect.parameters.items()},
            }
            for effect in self._effects(fit)
        ]
