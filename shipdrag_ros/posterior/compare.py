# SPDX-License-Identifier: Apache-2.0
"""
Hypotheses compared by their evidence: fitted under usual noise, weighed over all of it.

Every hypothesis sees the same rows and the same settings of the noise, learnt with the likeliest
of them at hand, so that no effect is taken for noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from scipy.special import log_ndtr, logit

from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.inference import decision
from shipdrag_ros.inference.decision import NONE, UNKNOWN, Names, SizePosterior
from shipdrag_ros.inference.learning import Seen, learn
from shipdrag_ros.inference.learning import prior as prior_of
from shipdrag_ros.inference.linear import (
    Families,
    evidences,
    products_of,
    solve,
    solve_scaled,
    whitened_products,
)
from shipdrag_ros.inference.rows import LOG, NoisePosterior, Settings, noise_of, whiten
from shipdrag_ros.parameter import Shape
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.effects import EffectWay, stated_way, ways_of
from shipdrag_ros.posterior.hypotheses import (
    IN_GROUND,
    IN_LOG,
    IN_SPEED,
    IN_TIME,
    QUICK_IN_LOG,
    QUICK_IN_TIME,
    Explanation,
    RunSight,
    RunTable,
    ShipRuns,
    half,
)
from shipdrag_ros.posterior.problem import EXACT
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effect import Action, Effect, Scope
from shipdrag_ros.simulation.effects import checked

_ITERATIONS = 30  # of Gauss and Newton
_CLOSE = 0.05  # nats that a step may still promise
_REFUSED = 5  # shorter and shorter steps that lead nowhere
_LONGEST = 1.5  # of a step in z
_HOPELESS, _TRIED = 15.0, 3  # nats behind the best, from where none is fitted on, and not before
_STUCK = 4.0  # nats behind nothing, from where the fit of an effect begins anew
_STARTS = 2  # of each way that are fitted
_AT_ONCE = 100  # ways scored together: each is compared with each
_TAUGHT = 6  # likeliest effects with which the noise is learnt
_PAIRED, _PAIRS = 4, 10
_PAIR_NATS = 7.0  # behind the best, by the linear score, from where a pair is not fitted
LIKELY = 0.03  # probability of names that may leave something smooth
_AMOUNT_SD = 0.6  # of a size that is not 0, in parts of the one that is tried


class WeighedFit:
    """What has been fitted of a hypothesis; `z` and `sd` are of the unknowns of its effects."""

    hypothesis: Explanation
    log_evidence: float
    z: Float64 | None
    sd: Float64 | None

    @property
    def names(self) -> Names:
        """As the decision takes them."""
        return UNKNOWN if self.hypothesis.unnamed else self.hypothesis.names

    @property
    def log_weight(self) -> float:
        """Logarithm of evidence times prior odds."""
        return self.log_evidence + self.hypothesis.log_odds


Fit = TypeVar('Fit', bound=WeighedFit)


@dataclass
class Fitted(WeighedFit):
    """
    A hypothesis on its way to its best, and then its evidence.

    Attributes
    ----------
    hypothesis
    at : (p,)
    tables
        One a run; linear about `at`.
    cost
        -2 ln of the posterior under usual noise.
    promised
        What the linear model promises beyond that, which was not reached: no evidence [nats].
    usual
        Noise of each run that is usual if this is the truth, once it is known.
    log_evidence
        Without the prior odds.
    z, sd : (q,)
        Mean and standard deviation of the unknowns of the effects, over noise and families.
    """

    hypothesis: Explanation
    at: Float64
    tables: list[RunTable] | None = None
    cost: float = math.inf
    promised: float = 0.0
    usual: list[Settings] | None = None
    log_evidence: float = -math.inf
    z: Float64 | None = None
    sd: Float64 | None = None

    @property
    def linear(self) -> list[RunTable]:
        """
        Tables, of which there must be some.

        Raises
        ------
        DiagnosisError
            If the motion cannot be computed.
        """
        if self.tables is None:
            raise DiagnosisError(
                'the motion of this ship cannot be computed at the speeds of the runs: check '
                'baseline, effects, added mass and propulsion of the ship file'
            )
        return self.tables


class _RunNoise(NamedTuple):
    """Noise of a run, weights of the prior of its settings (logarithm), and the usual one."""

    learnt: NoisePosterior
    log_prior: Float64
    typical: Settings


class _Step(NamedTuple):
    """Cost at some unknowns; step, log evidence and promise of the model that is linear there."""

    cost: float
    step: Float64
    log_evidence: float = -math.inf
    promised: float = 0.0


class RunResidual(NamedTuple):
    """
    What a hypothesis leaves of a run.

    Attributes
    ----------
    along : (n,)
        Of the rows of the motion.
    rest : (q,)
        Of what is measured besides.
    whitened : (n + q,)
        Under usual noise.
    """

    along: Float64
    rest: Float64
    whitened: Float64


@dataclass(frozen=True)
class ComparedHypotheses(Generic[Fit]):
    """
    All hypotheses with their evidence.

    Attributes
    ----------
    effects
    fitted
        The best of each.
    """

    effects: tuple[Effect, ...]
    fitted: tuple[Fit, ...]

    @cached_property
    def probability(self) -> dict[Names, float]:
        """Of each set of names, most probable first; a `DiagnosisError` where none comes near."""
        weighed = [(each.names, each.log_weight) for each in self.fitted]
        try:
            return decision.probabilities(weighed)
        except ValueError as error:
            raise DiagnosisError(
                'no explanation comes near what was read: check units and times of the record, '
                'and length and volume of the ship file'
            ) from error

    @cached_property
    def best(self) -> dict[Names, Fit]:
        """The likeliest way of each set of names."""
        ordered = sorted(self.fitted, key=lambda fit: fit.log_weight)
        return {each.names: each for each in ordered}

    def sizes(self, name: str) -> list[SizePosterior]:
        """
        Return the size of an effect under each hypothesis that holds it.
        """
        found = []
        for names, fit in self.best.items():
            for way, own in fit.hypothesis.placed:
                mine = way.effect.name == name and not way.stated and names != UNKNOWN
                if mine and fit.z is not None and fit.sd is not None:
                    weight, prior = self.probability[names], way.unknowns[0].prior
                    z, sd = float(fit.z[own.start]), float(fit.sd[own.start])
                    found.append(SizePosterior(weight, z, sd, prior, way.power))
        # given that it is there: how improbable that is does not matter
        total = sum(each.weight for each in found)
        return found if total > 0.0 else [each._replace(weight=1.0) for each in found]


class Comparing:
    """
    The comparison of hypotheses about some runs of a ship.

    Parameters
    ----------
    runs
    ship
    effects
        That may be missing.
    log_known
        Logarithm of how probable facts and earlier diagnoses are, under a hypothesis.
    kept
        Further ways, of effects that are as an earlier diagnosis found them.
    may_differ
        Effects that may have another size in each run, but for those that act in one alone.
    """

    def __init__(
        self,
        runs: ShipRuns,
        ship: Ship,
        effects: Sequence[Effect],
        log_known: Callable[[Explanation], float] = lambda hypothesis: 0.0,
        kept: Sequence[EffectWay] = (),
        may_differ: Sequence[Effect] = (),
    ) -> None:
        self.runs, self.effects, self.log_known = runs, tuple(effects), log_known
        several = len(runs.runs) > 1
        self.may_differ = tuple(e for e in may_differ if several and e.scope is not Scope.RUN)
        self.stated = tuple(stated_way(each, ship) for each in checked(ship).effects)
        self.base = Explanation(self.stated)
        self.noise: list[_RunNoise] = []
        kinds = {int(k) for run in runs.runs for k in np.unique(run.model.rows.kind)}
        both = LOG in kinds and len(kinds) > 1
        # without a baseline the hull is something smooth in any case
        in_speed = (IN_SPEED,) if runs.runs[0].model.law.stated else ()
        between = (IN_LOG, QUICK_IN_LOG, IN_GROUND) if both else ()
        self.smooth = (*in_speed, IN_TIME, QUICK_IN_TIME, *between)
        longest = max(float(run.model.rows.time_s[-1]) for run in runs.runs)
        self.ways: dict[str, list[EffectWay]] = {
            effect.name: list(ways_of(effect, ship, longest, len(runs.runs)))
            for effect in self.effects
        }
        for way in kept:
            self.ways[way.effect.name].append(way)
        for effect in self.may_differ:  # alike, or not: together they are as probable as stated
            alike = math.log1p(-self._differs(effect))
            ways = self.ways[effect.name]
            ways[:] = [replace(way, log_odds=way.log_odds + alike) for way in ways]

    @property
    def first(self) -> int:
        """Place of the first unknown of what may be missing."""
        return self.runs.size + len(self.base.unknowns)

    def compare(self) -> ComparedHypotheses[Fitted]:
        """
        Fit and weigh nothing, each effect, pairs where they may count, and something smooth.
        """
        nothing = self.fit_nothing()
        ways = [way for each in self.ways.values() for way in each]
        scores, amounts, responses = self._score(nothing, ways)
        self._learn(nothing, ways, scores, responses)
        singles, beside = self._likeliest(nothing, ways, scores, amounts, responses)
        smooth = [replace(self.base, smooth=where) for where in self.smooth]
        nothing.cost = math.inf
        every = [nothing, *(Fitted(each, self.widened(nothing, each)) for each in smooth)]
        every = self._fitted(every + singles)
        self._keep_better(every, self._stuck(every, beside))
        for more in (self._pairs, self._differing):
            every += self._fitted(more(every), max(fit.log_weight for fit in every))
        self._again(every)
        every += self._weigh(self._beside(every))
        return ComparedHypotheses(self.effects, tuple(every))

    def promising(self) -> list[EffectWay]:
        """
        Return all ways, that which explains most by the linear response first.
        """
        ways = [way for each in self.ways.values() for way in each]
        nothing = self.fit_nothing()
        parts = [
            self._score(nothing, ways[first : first + _AT_ONCE])[0]
            for first in range(0, len(ways), _AT_ONCE)
        ]
        return [ways[i] for i in np.argsort(-np.concatenate(parts)).tolist()]

    def fit_nothing(self) -> Fitted:
        """Fit the runs with nothing missing, under usual noise."""
        self.noise = [self._usual(j) for j in range(len(self.runs.runs))]
        start = np.zeros(self.runs.width(self.base))
        start[: self.runs.size] = self.runs.start
        self.nothing = Fitted(self.base, start)
        self._climb([self.nothing])
        # where a shaft stops is a step in its readings: no climb leads there from afar
        starts = self.runs.stopping_elsewhere(self.nothing.at)
        tables = self.runs.linearise([self.base] * len(starts), starts) if starts else []
        costs = [self._step(self.nothing, *each).cost for each in zip(tables, starts, strict=True)]
        if costs and min(costs) < self.nothing.cost:
            self.nothing = Fitted(self.base, starts[int(np.argmin(costs))])
            self._climb([self.nothing])
        return self.nothing

    def equations(self, fit: Fitted) -> list[Float64]:
        """
        Return products of the whitened rows of each run, (1 + p, 1 + p), under usual noise.

        Residual first, then the derivatives by all unknowns.
        """
        found = []
        for j, table in enumerate(fit.linear):
            total = np.zeros((1 + len(fit.at), 1 + len(fit.at)))
            _put(total, self._of_run(j, table, self.noise[j].typical)[0][0], table.place)
            found.append(total)
        return found

    def information(self, fit: Fitted) -> Float64:
        """Return the inverse covariance (p, p) of the unknowns, under usual noise."""
        shown: Float64 = np.sum(self.equations(fit), axis=0)[1:, 1:]
        return shown + np.diag(self.prior_of(fit)[2])

    def prior_of(self, fit: Fitted) -> tuple[int, Float64, Float64]:
        """Return the likeliest family of a hypothesis: number, mean and precision (p,)."""
        families = self.runs.priors(fit.hypothesis, fit.at)
        total = np.sum(self.equations(fit), axis=0)
        logs = evidences(total[None], families.mean, families.precision)[0]
        best = int(np.argmax(logs + families.log_chance))
        return best, families.mean[best], families.precision[best]

    def white(self, j: int, table: RunTable, like: RunSight) -> Float64:
        """Return the lines of the motion of a table, whitened as those of run j."""
        rows, lines = like.model.rows, table.along.copy()
        whiten(
            rows, lines, noise_of(self.noise[j].typical, 0, rows, table.white, like.model.steady)
        )
        return lines

    def noise_sd(self, j: int, table: RunTable) -> Float64:
        """Return the standard deviation of each row of the motion, slow disturbances in it."""
        lines = np.eye(table.along.shape[1])
        whitener = self.white(j, table._replace(along=lines), self.runs.runs[j]).T
        result: Float64 = np.sqrt(np.sum(np.linalg.inv(whitener) ** 2, axis=1))
        return result

    def water_m_s(self, j: int) -> float:
        """Return the usual size of the slow motion of the water in a run."""
        return self.noise[j].learnt.slow.water_m_s

    @property
    def as_stated(self) -> Fitted:
        """The ship as her file states her, and how the runs began."""
        fit = Fitted(replace(self.base, frozen=True), self.nothing.at.copy())
        fit.at[: self.runs.size] = self.runs.as_stated(self.nothing.at)
        self._climb([fit])
        return fit

    def residuals(self, fit: Fitted) -> list[RunResidual]:
        """
        Return what a hypothesis leaves of each run, at its best.
        """
        found = []
        for j, table in enumerate(fit.linear):
            line = self.white(j, table._replace(along=table.along[:1]), self.runs.runs[j])
            whitened = np.concatenate([line[0], table.rest[0]])
            found.append(RunResidual(table.along[0], table.residual, whitened))
        return found

    def _usual(self, j: int) -> _RunNoise:
        """Return usual noise, before anything is learnt."""
        run = self.runs.runs[j]
        nothing = Fitted(Explanation(), self.runs.start)
        nothing.tables = self.runs.linearise([nothing.hypothesis], [nothing.at])[0]
        table = nothing.linear[j]
        none = np.zeros((1, len(table.along) - 1))
        seen = Seen(run.model.rows, table.along, none, none, table.white, run.model.steady)
        return _noise(prior_of(seen, run.model.speed_m_s), np.zeros(0))

    def _fitted(self, fits: Sequence[Fitted], top: float = -math.inf) -> list[Fitted]:
        """Return the best of each hypothesis, likely ones fitted under the noise of their own."""
        self._climb(fits)
        found = self._weigh(fits)
        top = max([top, *(fit.log_weight for fit in found)])
        likely = [fit for fit in found if fit.log_weight > top - _PAIR_NATS]
        self._climb(likely)
        for fit in likely:
            self._weigh_one(fit)
        return found

    def _climb(self, fits: Sequence[Fitted]) -> None:
        """Fit hypotheses, all in step, under the usual noise of each run."""
        for fit in fits:
            fit.tables, fit.cost, fit.promised = None, math.inf, 0.0
        trials = [fit.at for fit in fits]
        steps = [np.zeros(0)] * len(fits)
        most = [-math.inf] * len(fits)  # log weight by the linear model, reached or not
        refused, active = [0] * len(fits), list(range(len(fits)))
        for number in range(_ITERATIONS):
            if not active:
                break
            tables = self.runs.linearise(
                [fits[i].hypothesis for i in active], [trials[i] for i in active]
            )
            going = []
            for i, table in zip(active, tables, strict=True):
                fit = fits[i]
                found = self._step(fit, table, trials[i])
                if found.cost < fit.cost:
                    fit.tables, fit.at, steps[i] = table, trials[i], found.step
                    fit.cost, fit.promised = found.cost, found.promised
                    most[i], refused[i] = found.log_evidence + fit.hypothesis.log_odds, 0
                    if found.promised < _CLOSE:
                        continue
                else:
                    steps[i], refused[i] = 0.3 * steps[i], refused[i] + 1
                    if refused[i] > _REFUSED or fit.tables is None:
                        continue
                trials[i] = fit.at + steps[i]
                going.append(i)
            reached = max(each - fit.promised for each, fit in zip(most, fits, strict=True))
            active = [i for i in going if number < _TRIED or most[i] > reached - _HOPELESS]

    def _usual_of(self, fit: Fitted, j: int) -> Settings:
        return fit.usual[j] if fit.usual else self.noise[j].typical

    def _step(self, fit: Fitted, tables: list[RunTable] | None, at: Float64) -> _Step:
        """Return the cost here, -2 ln of the posterior, and what the linear model makes of it."""
        if tables is None:
            return _Step(math.inf, np.zeros(len(at)))
        total, log_det = np.zeros((len(at) + 1, len(at) + 1)), 0.0
        for j, table in enumerate(tables):
            products, of_noise = self._of_run(j, table, self._usual_of(fit, j))
            _put(total, products[0], table.place)
            log_det += float(of_noise[0])
        if not np.isfinite(total).all():  # far from all that is read
            return _Step(math.inf, np.zeros(len(at)))
        families = self.runs.priors(fit.hypothesis, at)
        cost = _cost(total, families, np.zeros(len(at)))
        log_evidence, step = _mean_step(total, families)
        if not np.isfinite(step).all():
            return _Step(math.inf, np.zeros(len(at)))
        below = [i for i in half(fit.hypothesis, self.runs.size) if step[i] < -at[i]]
        if below:  # the others go where that one stays at its bound
            mean, precision = families.mean.copy(), families.precision.copy()
            mean[:, below], precision[:, below] = -at[below], EXACT**-2.0
            _, step = _mean_step(total, Families(mean, precision, families.log_chance))
            step[below] = -at[below]
        promised = 0.5 * max(cost - _cost(total, families, step), 0.0)
        first, q = self.runs.size, len(fit.hypothesis.unknowns)
        longest = float(np.max(np.abs(step[first : first + q]), initial=0.0))
        step *= min(1.0, _LONGEST / max(longest, 1e-12))
        return _Step(cost, step, log_evidence - 0.5 * log_det, promised)

    def _of_run(self, j: int, table: RunTable, settings: Settings) -> tuple[Float64, Float64]:
        model = self.runs.runs[j].model
        products, log_det = whitened_products(
            table.along, model.rows, table.white, model.steady, settings
        )
        return products + products_of(np.ascontiguousarray(table.rest)), log_det

    def _score(
        self, nothing: Fitted, ways: Sequence[EffectWay]
    ) -> tuple[Float64, Float64, list[Float64]]:
        """
        Return the log evidence that each start will about reach, in which amount.

        And its trace in each run.
        """
        hypotheses = [Explanation((*self.stated, way)) for way in ways]
        responses = [self.traces(j, nothing, hypotheses) for j in range(len(self.runs.runs))]
        return *self._gains(nothing, hypotheses, responses), responses

    def traces(self, j: int, base: Fitted, hypotheses: Sequence[Explanation]) -> Float64:
        """Return what the last effect of each hypothesis adds to a run's rows, (h, n + q)."""
        run, size = self.runs.runs[j], self.runs.size
        z = base.at[size : size + len(base.hypothesis.unknowns)]
        began = self.runs.began(j, base.at)
        air = self.runs.air(j, base.at)
        whole = Action.total(began.still, *base.hypothesis.actions(run.frame, j, z), air)
        ways = [each.ways[-1] for each in hypotheses]
        more = [way.action(run.frame, way.tried(), j) for way in ways]
        actions = [whole, *(whole + each for each in more)]
        shown = run.simulate(actions, began.speed_m_s, began.later_s)
        change = np.hstack([shown.along, shown.rest])
        change = change[1:] - change[0]
        change[~np.isfinite(change).all(axis=1)] = 0.0
        n = len(run.model.rows.time_s)
        change[:, n:] = change[:, n:] @ run.whitener.T
        result: Float64 = change
        return result

    def _gains(
        self, base: Fitted, hypotheses: Sequence[Explanation], responses: Sequence[Float64]
    ) -> tuple[Float64, Float64]:
        """
        Return log evidence over that of the base, by the linear response to one effect.

        And how much of what is tried there is.
        """
        score, information = self.given_way(base, responses)
        own = np.maximum(np.diag(information), 0.0)
        prior, held = np.array([_amount(h.ways[-1]) for h in hypotheses]).reshape(-1, 2).T
        slope = score + held * prior
        found: Float64 = 0.5 * (slope**2 / (own + held) - held * prior**2)
        found -= 0.5 * np.log((own + held) / held)
        found += np.array([each.ways[-1].log_odds for each in hypotheses])
        return found, slope / (own + held)

    def given_way(self, base: Fitted, responses: Sequence[Float64]) -> tuple[Float64, Float64]:
        """Return scores (h,) and information (h, h) of traces, less what the base takes up."""
        p, h = len(base.at), len(responses[0])
        total = np.zeros((1 + p + h, 1 + p + h))
        for j, table in enumerate(base.linear):
            n = table.along.shape[1]
            joined = replace_table(table, responses[j][:, :n], responses[j][:, n:], p)
            products, _ = self._of_run(j, joined, self.noise[j].typical)
            _put(total, products[0], joined.place)
        mean, precision, _ = self.runs.priors(base.hypothesis, base.at)
        widest = int(np.argmin(np.log(precision).sum(axis=1)))
        matrix = total[1 : 1 + p, 1 : 1 + p] + np.diag(precision[widest])
        right = total[1 : 1 + p, 0] + precision[widest] * mean[widest]
        solved = solve_scaled(matrix, np.column_stack([right, total[1 : 1 + p, 1 + p :]]))
        cross = total[1 + p :, 1 : 1 + p]
        score: Float64 = total[1 + p :, 0] - cross @ solved[:, 0]
        return score, total[1 + p :, 1 + p :] - cross @ solved[:, 1:]

    def _learn(
        self,
        nothing: Fitted,
        ways: Sequence[EffectWay],
        scores: Float64,
        responses: Sequence[Float64],
    ) -> None:
        """Learn the noise of each run with the likeliest effects at hand."""
        chosen: dict[str, int] = {}
        for i in np.argsort(-scores).tolist():
            chosen.setdefault(ways[i].effect.name, i)
        taught = list(chosen.values())[:_TAUGHT]
        noise = []
        for j, table in enumerate(nothing.linear):
            run = self.runs.runs[j]
            n, p = table.along.shape[1], len(table.along) - 1
            smooth = [
                self.runs.smooth(j, where, nothing.at)
                for where in self.smooth
                if where != IN_SPEED  # which is a prior of the hull
            ]
            lines = np.vstack([table.along, responses[j][taught][:, :n], *smooth])
            q = len(lines) - 1 - p
            means, precisions = [], []
            for where in ('', IN_SPEED):
                prior = self.runs.priors(replace(self.base, smooth=where), nothing.at)
                for mean, precision in zip(prior.mean, prior.precision):
                    means.append(np.concatenate([mean[table.place], np.zeros(q)]))
                    precisions.append(np.concatenate([precision[table.place], np.full(q, np.inf)]))
            for i, which in enumerate(taught):
                amount, held = _amount(ways[which])
                mean, precision = means[0].copy(), precisions[0].copy()
                mean[p + i], precision[p + i] = amount, held
                means.append(mean)
                precisions.append(precision)
            first = p + len(taught)
            for columns in smooth:
                for size in priors.SMOOTH_TAUGHT:
                    mean, precision = means[0].copy(), precisions[0].copy()
                    precision[first : first + len(columns)] = size**-2.0
                    means.append(mean)
                    precisions.append(precision)
                first += len(columns)
            seen = Seen(
                run.model.rows,
                lines,
                np.array(means),
                np.array(precisions),
                table.white,
                run.model.steady,
            )
            learnt = learn(seen, run.model.speed_m_s)
            products, log_det = whitened_products(
                lines, run.model.rows, table.white, run.model.steady, learnt.settings
            )
            logs = evidences(products, seen.mean, seen.precision)
            alike = np.logaddexp.reduce(logs, axis=1) - 0.5 * log_det - math.log(len(means))
            noise.append(_noise(learnt, alike))
        self.noise = noise

    def _likeliest(
        self,
        nothing: Fitted,
        ways: Sequence[EffectWay],
        scores: Float64,
        amounts: Float64,
        responses: Sequence[Float64],
    ) -> tuple[list[Fitted], list[Fitted]]:
        """Return the most promising starts of each way: as stated, and at the best of nothing."""
        kept: dict[tuple[object, ...], int] = {}
        found, beside = [], []
        shown = sum((np.abs(each).max(axis=1) for each in responses), np.zeros(len(ways)))
        for i in np.lexsort((-scores, shown == 0.0)).tolist():  # no fit leaves where nothing shows
            way = ways[i]
            kept[way.mode] = kept.get(way.mode, 0) + 1
            if kept[way.mode] > _STARTS:
                continue
            fit = self._begun(nothing, Explanation((*self.stated, way)), float(amounts[i]))
            beside.append(Fitted(fit.hypothesis, fit.at.copy()))
            # at the best of nothing, nuisances stand for the effect as far as they can
            fit.at[: self.runs.size] = self.runs.as_stated(nothing.at)
            found.append(fit)
        return found, beside

    def _begun(self, base: Fitted, hypothesis: Explanation, amount: float) -> Fitted:
        """Return where the fit of one more way begins, at so much of its trace."""
        way, at = hypothesis.ways[-1], self.widened(base, hypothesis)
        first = self.runs.size + len(base.hypothesis.unknowns)
        at[first : first + len(way.start)] = way.start
        at[first] = way.resized(amount)
        return Fitted(hypothesis, at)

    def widened(self, base: Fitted, hypothesis: Explanation) -> Float64:
        """Return where a fit of a larger hypothesis begins."""
        at = np.zeros(self.runs.width(hypothesis))
        kept = self.runs.size + len(base.hypothesis.unknowns)
        at[:kept] = base.at[:kept]
        return at

    def _weigh(self, fits: Sequence[Fitted]) -> list[Fitted]:
        """Give the best fit of each hypothesis its evidence, averaged over the noise."""
        best: dict[tuple[object, ...], Fitted] = {}
        for fit in fits:
            if fit.tables is None:
                continue
            key = (fit.hypothesis.smooth, *(way.mode for way in fit.hypothesis.ways))
            if key not in best or fit.cost < best[key].cost:
                best[key] = fit
        for fit in best.values():
            self._weigh_one(fit)
        return list(best.values())

    def _weigh_one(self, fit: Fitted) -> None:
        p = len(fit.at)
        families = self.runs.priors(fit.hypothesis, fit.at)
        usual = np.zeros((1 + p, 1 + p))
        typical = []
        for j, table in enumerate(fit.linear):
            products, _ = self._of_run(j, table, self._usual_of(fit, j))
            typical.append(products[0])
            _put(usual, products[0], table.place)
        several = len(fit.linear) > 1
        at_usual = self._evidence(fit, usual[None], families)[0][0] if several else 0.0
        log_evidence, weights, moments = 0.0, [], []
        for j, table in enumerate(fit.linear):
            noise = self.noise[j]
            products, log_det = self._of_run(j, table, noise.learnt.settings)
            whole = np.repeat(usual[None], len(products), axis=0)
            _put(whole, products - typical[j], table.place)
            logs, z, variance = self._evidence(fit, whole, families)
            logs = logs + noise.log_prior - 0.5 * log_det
            total = float(np.logaddexp.reduce(logs))
            log_evidence += total - (at_usual if several and j else 0.0)
            weights.append(np.exp(logs - total))
            moments.append((z, variance))
        fit.usual = [
            replace(each.learnt, settings=each.learnt.settings._replace(weight=weight)).typical
            for each, weight in zip(self.noise, weights, strict=True)
        ]
        log_evidence += self.log_known(fit.hypothesis) - fit.promised
        fit.log_evidence = log_evidence if math.isfinite(log_evidence) else -math.inf
        first = self.runs.size
        q = len(fit.hypothesis.unknowns)
        weight = np.concatenate(weights) / len(weights)
        z = np.concatenate([each for each, _ in moments])
        variance = np.concatenate([each for _, each in moments])
        mean = weight @ z
        fit.z = fit.at[first : first + q] + mean
        fit.sd = np.sqrt(np.maximum(weight @ (variance + z**2) - mean**2, 0.0))

    def _evidence(
        self, fit: Fitted, products: Float64, families: Families
    ) -> tuple[Float64, Float64, Float64]:
        """Return log evidence (s,), and mean and variance of the effects' unknowns (s, q)."""
        first, q = self.runs.size, len(fit.hypothesis.unknowns)
        every = np.ones((len(products), len(families.mean)), np.bool_)
        logs, steps, covariance = solve(
            products, families.mean, families.precision, every, first, q
        )
        logs = logs.reshape(every.shape) + families.log_chance
        own = steps[:, first : first + q].reshape(*every.shape, q)
        variances = np.diagonal(covariance, axis1=1, axis2=2).reshape(own.shape)
        for i in half(fit.hypothesis, 0):
            sd = np.sqrt(np.maximum(variances[..., i], 1e-300))
            logs = logs + math.log(2.0) + log_ndtr((fit.at[first + i] + own[..., i]) / sd)
        total = np.logaddexp.reduce(logs, axis=1)
        weight = np.exp(logs - np.where(np.isfinite(total), total, 0.0)[:, None])
        mean = np.einsum('sf,sfq->sq', weight, own)
        square = np.einsum('sf,sfq->sq', weight, variances + own**2)
        return total, mean, square - mean**2

    def _pairs(self, fits: Sequence[Fitted]) -> list[Fitted]:
        """Return pairs of the likeliest names with all others, that the linear score allows."""
        found = ComparedHypotheses(self.effects, tuple(fits))
        top = max(fit.log_weight for fit in fits)
        names = [each for each in found.probability if each not in (NONE, UNKNOWN)][:_PAIRED]
        # as each was found alone, and as it is looked for at first
        starts = [
            replace(way, start=tuple(fit.at[self.first : self.first + len(way.start)].tolist()))
            for fit in fits
            if len(fit.hypothesis.names) == 1 and not fit.hypothesis.smooth
            for way in fit.hypothesis.ways[-1:]
        ]
        starts += [each[0] for each in self.ways.values()]
        tried: list[tuple[float, Fitted]] = []
        for name in names:
            base = found.best[name]
            if base.tables is None or not math.isfinite(base.log_evidence):
                continue
            mine = base.hypothesis.ways[-1].effect
            ways = [way for way in starts if way.effect.goes_with(mine)]
            hypotheses = [Explanation((*base.hypothesis.ways, way)) for way in ways]
            responses = [self.traces(j, base, hypotheses) for j in range(len(self.runs.runs))]
            gains, amounts = self._gains(base, hypotheses, responses)
            for gain, amount, hypothesis in zip(gains + base.log_weight, amounts, hypotheses):
                if gain < top - _PAIR_NATS:
                    continue
                tried.append((float(gain), self._begun(base, hypothesis, float(amount))))
        kept: dict[Names, Fitted] = {}
        for _, fit in sorted(tried, key=lambda each: -each[0]):
            kept.setdefault(fit.hypothesis.names, fit)
        return list(kept.values())[:_PAIRS]

    def _differing(self, fits: Sequence[Fitted]) -> list[Fitted]:
        """Return effects with a size for each run: how one fits all tells nothing."""
        count = len(self.runs.runs)
        best = ComparedHypotheses(self.effects, tuple(fits)).best
        found = []
        for alike in (best[e.name,] for e in self.may_differ if (e.name,) in best):
            *stated, way = alike.hypothesis.ways
            own = [replace(way, run=j, log_odds=0.0) for j in range(count)]
            own[0] = replace(own[0], log_odds=way.log_odds + logit(self._differs(way.effect)))
            hypothesis = Explanation((*stated, *own))
            at, first, q = self.widened(self.nothing, hypothesis), self.first, len(way.unknowns)
            at[first : first + count * q] = np.tile(alike.at[first : first + q], count)
            found.append(Fitted(hypothesis, at))
        return found

    def _differs(self, effect: Effect) -> float:
        """Return how probable it is that an effect has a size for each run."""
        if not self.runs.apart:
            return priors.DIFFERS.mean
        of_earth = effect.scope is Scope.EARTH
        return (priors.DIFFERS_WEATHER if of_earth else priors.DIFFERS_LATER).mean

    def _alone(self, fits: Sequence[Fitted]) -> dict[tuple[object, ...], int]:
        """Return the place of each effect by itself."""
        return {
            fit.hypothesis.ways[-1].mode: i
            for i, fit in enumerate(fits)
            if len(fit.hypothesis.ways) == 1 + len(self.stated) and not fit.hypothesis.smooth
        }

    def _stuck(self, fits: Sequence[Fitted], beside: Sequence[Fitted]) -> list[Fitted]:
        """Return other starts of effects whose fit is far worse than that of nothing missing."""
        alone, least = self._alone(fits), fits[0].log_evidence - _STUCK
        found = ((alone.get(each.hypothesis.ways[-1].mode), each) for each in beside)
        return [each for i, each in found if i is not None and fits[i].log_evidence < least]

    def _again(self, fits: list[Fitted]) -> None:
        """Fit single effects from where likely larger hypotheses have them."""
        top = max(fit.log_weight for fit in fits)
        alone = self._alone(fits)
        found = []
        for fit in fits:
            placed = fit.hypothesis.placed[len(self.stated) :]
            if len(placed) < 2 or fit.log_weight < top - _PAIR_NATS:
                continue
            z = fit.at[self.runs.size :]
            for way, own in placed:
                i = alone.get(way.mode, alone.get(replace(way, run=None).mode))
                if i is not None:
                    single = fits[i].hypothesis
                    at = np.concatenate([fit.at[: self.first], z[own]])
                    beyond = np.zeros(self.runs.width(single) - len(at))
                    found.append(Fitted(single, np.concatenate([at, beyond])))
        self._keep_better(fits, found)

    def _keep_better(self, fits: list[Fitted], starts: Sequence[Fitted]) -> None:
        """Fit single effects from other starts; each stands for its own where it is better."""
        alone = self._alone(fits)
        for fit in self._fitted(starts, max(fit.log_weight for fit in fits)):
            i = alone[fit.hypothesis.ways[-1].mode]
            if fit.log_evidence > fits[i].log_evidence:
                fits[i] = fit

    def _beside(self, fits: Sequence[Fitted]) -> list[Fitted]:
        """Return likely names with something smooth besides, linear where the names are best."""
        found = ComparedHypotheses(self.effects, tuple(fits))
        tried = []
        for names, probability in found.probability.items():
            if names in (NONE, UNKNOWN) or probability < LIKELY:
                continue
            base = found.best[names]
            for where in self.smooth:
                hypothesis = Explanation(base.hypothesis.ways, where)
                at = np.zeros(self.runs.width(hypothesis))
                at[: len(base.at)] = base.at
                tried.append(Fitted(hypothesis, at))
        if tried:
            tables = self.runs.linearise([t.hypothesis for t in tried], [t.at for t in tried])
            for fit, table in zip(tried, tables, strict=True):
                fit.tables, fit.cost = table, 0.0
        return tried


def _cost(total: Float64, families: Families, step: Float64) -> float:
    """Return -2 ln of the posterior a step (p,) away, by the products of the linear model."""
    mean, precision, log_chance = families
    density = log_chance + 0.5 * np.log(precision).sum(axis=1)
    density -= 0.5 * (precision * (mean - step) ** 2).sum(axis=1)
    data = total[0, 0] - 2.0 * total[0, 1:] @ step + step @ total[1:, 1:] @ step
    return float(data - 2.0 * np.logaddexp.reduce(density))


def _mean_step(total: Float64, families: Families) -> tuple[float, Float64]:
    """Return log evidence by the linear model, and the step to its mean."""
    every = np.ones((1, len(families.mean)), np.bool_)
    logs, steps, _ = solve(total[None], families.mean, families.precision, every, 0, 0)
    weighted = logs + families.log_chance
    whole = float(np.logaddexp.reduce(weighted))
    if not math.isfinite(whole):
        return whole, np.full(steps.shape[-1], np.nan)
    return whole, np.exp(weighted - whole) @ steps


def replace_table(table: RunTable, along: Float64, rest: Float64, p: int) -> RunTable:
    """Return the rows of a run with lines more, whose places are behind all."""
    return table._replace(
        along=np.vstack([table.along, along]),
        rest=np.vstack([table.rest, rest]),
        place=np.concatenate([table.place, p + np.arange(len(along))]),
    )


def _noise(learnt: NoisePosterior, alike: Float64) -> _RunNoise:
    """Return settings with the logarithms of their weights before any evidence."""
    weight = np.log(np.maximum(learnt.settings.weight, 1e-300))
    return _RunNoise(learnt, weight - alike if len(alike) else weight, learnt.typical)


def _put(total: Float64, products: Float64, place: Int64) -> None:
    """Add the products of a run to those of all, (..., 1 + p, 1 + p)."""
    at = np.append(0, 1 + place)
    total[..., at[:, None], at] += products


def _amount(way: EffectWay) -> tuple[float, float]:
    """Return mean and precision of the size, in parts of that which is tried."""
    shape = way.unknowns[0].prior.shape
    tried = way.tried()[0]
    if shape is Shape.HALF_NORMAL or way.start[0] == 0.0:
        return 0.0, tried**2
    return 1.0, 1.0 / _AMOUNT_SD**2
