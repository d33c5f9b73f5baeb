# SPDX-License-Identifier: Apache-2.0
"""
Sensor effects and current from any sailing, without a coastdown.

The log is held against the way made good over ground, on many courses and at
many speeds. No baseline is needed, and no force can be seen. Slow water, turbulence at the log and
small errors that every instrument has are noise, whose colour is learnt beside all effects at
once: none of them can hide in it, and it cannot pass for one of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares, minimize

from shipdrag_ros.diagnosis.advice import declared
from shipdrag_ros.diagnosis.diagnose import asked, waiting
from shipdrag_ros.diagnosis.legs import (
    ANY_SHIP,
    Direction,
    Legs,
    SailingRecord,
    StandingLog,
    left_text,
)
from shipdrag_ros.diagnosis.result import LOG_TRACK, DiagnosisResult, Gap, Where
from shipdrag_ros.diagnosis.verdict import judge
from shipdrag_ros.diagnosis.words import of_the_earth
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.inference.decision import CERTAIN, NONE, UNKNOWN, Verdict
from shipdrag_ros.inference.rows import OUTLIER
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.compare import LIKELY, ComparedHypotheses, WeighedFit
from shipdrag_ros.posterior.effects import EffectWay, ways_of
from shipdrag_ros.posterior.hypotheses import IN_LOG, Explanation, bsplines
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation import Action, Frame, Scenario
from shipdrag_ros.simulation.effect import Effect, Measure, Scope, WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY, inseparable

_LOG = 'speed_through_water'
_SPLINES = 6  # over the speed, of an error without a name
_NOISE = (
    priors.SAILING_LOG,
    priors.SAILING_LOG,
    priors.SAILING_WATER,
    priors.SAILING_LOG_TIME,
    priors.SAILING_WATER_TIME,
)
_SD_OF_LOG = np.array([each.sd for each in _NOISE])
_EVALUATIONS = 400
_LONGEST_S = 1.0  # no effect that sailing shows is counted from a time
_SAILED = (Measure.OTHER_SPEED, Measure.RECIPROCAL_RUN, Measure.ANOTHER_COURSE)


@dataclass(frozen=True)
class SailingFit(WeighedFit):
    """
    A hypothesis about legs at its best.

    Attributes
    ----------
    hypothesis
        Something smooth is an error of the log that bends with the speed.
    z, sd : (p,)
        Unknowns, standard normal under the prior, those of the effects first.
    residual_m_s, white : (n,)
        What is left, and the same in units of the noise.
    slopes : (n, p)
        Of what is read by the unknowns, whitened.
    log_evidence
        By Laplace's method, without the prior odds.
    """

    hypothesis: Explanation
    z: Float64
    sd: Float64
    residual_m_s: Float64
    white: Float64
    slopes: Float64
    log_evidence: float

    @property
    def chi2(self) -> float:
        """Of a leg."""
        return float(np.mean(self.white**2))

    def joined(self, standing: StandingLog) -> SailingFit:
        """Return the same of the readings that are not 0, with a dead band in it."""
        ways = self.hypothesis.ways
        place = sum(len(way.unknowns) for way in ways)
        return replace(
            self,
            hypothesis=replace(self.hypothesis, ways=(*ways, standing.way)),
            z=np.insert(self.z, place, standing.z),
            sd=np.insert(self.sd, place, standing.sd),
            log_evidence=self.log_evidence + standing.log_factor,
        )


@dataclass(frozen=True)
class SailingModel:
    """
    What a log reads on legs, by hypothesis.

    Attributes
    ----------
    legs
    factor : (n, n)
        Lower triangular: the covariance of the noise is factor factor^T [m/s].
    """

    legs: Legs
    factor: Float64

    @classmethod
    def learnt(cls, legs: Legs) -> SailingModel:
        """
        Learn the noise of legs.

        Parameters
        ----------
        legs

        Returns
        -------
        SailingModel
            With the most probable covariance, the effects profiled out under wide
            priors.
        """
        white = cls(legs, np.eye(len(legs)) * 0.05)
        rough = white.all_together
        residual = rough.residual_m_s
        typical = max(float(np.median(np.abs(residual))), 1e-3)
        units = np.array([each.mean for each in _NOISE])
        units[:2] *= typical
        slopes = white.factor @ rough.slopes
        open_ = slopes @ slopes.T

        def cost(x: Float64) -> float:
            factor = np.linalg.cholesky(_covariance(legs, units * np.exp(x)) + open_)
            left = solve_triangular(factor, residual, lower=True, check_finite=False)
            log_det = 2.0 * float(np.log(np.diag(factor)).sum())
            return float(left @ left) + log_det + float(((x / _SD_OF_LOG) ** 2).sum())

        corners = np.vstack([np.zeros(len(_SD_OF_LOG)), 0.7 * np.eye(len(_SD_OF_LOG))])
        options = {
            'maxfev': _EVALUATIONS,
            'xatol': 0.05,
            'fatol': 0.05,
            'initial_simplex': corners,
        }
        found = minimize(cost, corners[0], method='Nelder-Mead', options=options)
        covariance = _covariance(legs, units * np.exp(found.x))
        return cls(legs, np.asarray(np.linalg.cholesky(covariance), np.float64))

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Those that log and track show."""
        return tuple(effect for effect in shown() if effect.in_geodetic or not self.legs.geodetic)

    @cached_property
    def inseparable(self) -> tuple[frozenset[str], ...]:
        """Confounders that no sailing, or none of which the courses are unknown, separates."""
        measured = [Measure.OTHER_SPEED]
        if self.legs.direction is not Direction.UNKNOWN:
            measured += [Measure.RECIPROCAL_RUN, Measure.ANOTHER_COURSE]
        return inseparable(self.effects, measured=measured)

    @cached_property
    def together(self) -> tuple[Effect, ...]:
        """As many effects as sailing separates."""
        found: list[Effect] = []
        sets = inseparable(self.effects, measured=_SAILED)
        for effect in self.effects:
            if not any({effect.name, other.name} in sets for other in found):
                found.append(effect)
        return tuple(found)

    @cached_property
    def all_together(self) -> SailingFit:
        """The fit of all effects that sailing separates at once."""
        return self.fit(Explanation(self._plain(self.together)))

    @staticmethod
    def _plain(effects: Sequence[Effect]) -> tuple[EffectWay, ...]:
        """Return effects whose sizes are any near 0, of either sign."""
        return tuple(next(ways_of(effect, ANY_SHIP, _LONGEST_S, 1)) for effect in effects)

    def compare(self, standing: StandingLog | None = None) -> ComparedHypotheses[SailingFit]:
        """
        Compare nothing, each effect, pairs of them, and what errs smoothly besides.

        Parameters
        ----------
        standing
            What zeros of the log say, independent of what it reads otherwise.
        """
        ways = self._plain(self.effects)
        pairs = [
            both for both in combinations(ways, 2) if both[0].effect.goes_with(both[1].effect)
        ]
        every = [Explanation(each) for each in ((), *((way,) for way in ways), *pairs)]
        fits = [self.fit(each) for each in (*every, Explanation(smooth=IN_LOG))]
        found = ComparedHypotheses(self.effects, tuple(fits))
        beside = [
            self.fit(replace(found.best[names].hypothesis, smooth=IN_LOG))
            for names, p in found.probability.items()
            if names not in (NONE, UNKNOWN) and p > LIKELY
        ]
        weighed = (*fits, *beside)
        if standing is None:
            return ComparedHypotheses(self.effects, weighed)
        with_it = tuple(fit.joined(standing) for fit in weighed)
        return ComparedHypotheses((*self.effects, standing.way.effect), weighed + with_it)

    def action(self, ways: Sequence[EffectWay], z: Float64) -> Action:
        """
        Return what effects do together at some unknowns.
        """
        return Action.total(*Explanation(tuple(ways)).actions(self._frame, 0, z))

    def fit(self, hypothesis: Explanation) -> SailingFit:
        """
        Return the fit of a hypothesis.

        Where something smooth is there and nothing else, a scale and an offset are part of it.
        """
        ways, smooth = hypothesis.ways, bool(hypothesis.smooth)
        # what stands alone as an error of the log may also be straight
        straight = [e for e in self.effects if _LOG in e.errs_in] if smooth and not ways else []
        acting = (*ways, *self._plain(straight))
        own = sum(len(way.unknowns) for way in acting)
        start = np.zeros(own + (_SPLINES if smooth else 0))
        start[:own] = [each for way in acting for each in way.start]
        n = len(self.legs)

        def left(z: Float64) -> Float64:
            read = self._reads(acting, z)
            if smooth:
                read = read + z[own:] @ self._splines
            white = solve_triangular(
                self.factor, self.legs.log_m_s - read, lower=True, check_finite=False
            )
            return np.concatenate([white, z])

        if len(start) == 0:
            best, slopes = start, np.zeros((n, 0))
        else:
            found = least_squares(left, start, method='lm')
            best, slopes = found.x, found.jac[:n]
        both = left(best)
        hessian = slopes.T @ slopes + np.eye(len(best))
        log_det = float(np.linalg.slogdet(hessian)[1])
        return SailingFit(
            hypothesis,
            best,
            np.sqrt(np.diag(np.linalg.inv(hessian))),
            self.factor @ both[:n],
            both[:n],
            slopes,
            -0.5 * (float(both @ both) + log_det),
        )

    def _reads(self, ways: Sequence[EffectWay], z: Float64) -> Float64:
        action = self.action(ways, z)
        # distances that are too long by a factor: the current is by the same
        radar = 1.0 + action.radar_factor
        east, north = action.current_m_s
        through = self.legs.through_water((east * radar, north * radar)) / radar
        delay_s = _usual_delay(self.legs)[0] + action.log_lag_s + action.log_late_s
        read = (1.0 + action.log_factor) * through + action.log_offset_m_s
        return np.asarray(read - delay_s * self.legs.acceleration_m_s2, np.float64)

    @cached_property
    def _frame(self) -> Frame:
        """A current is stated along the first leg."""
        return Frame(ANY_SHIP, Scenario(speed_m_s=1.0), float(self.legs.direction_rad[0]))

    @cached_property
    def _splines(self) -> Float64:
        """What neither a scale nor an offset is, (6, n) [m/s]."""
        # not by the way over ground: its noise is in what is left, and would bend with itself
        speed = np.abs(self.legs.log_m_s)
        splines = bsplines(speed / speed.max(), _SPLINES).T
        line = np.array([np.ones(len(speed)), speed]).T
        bent = splines - line @ np.linalg.lstsq(line, splines, rcond=1e-6)[0]
        return np.asarray(priors.SMOOTH_SIZES[1] * float(speed.max()) * bent.T, np.float64)


def shown() -> list[Effect]:
    """
    Return the effects that log and track show.
    """
    return [e for e in LIBRARY.values() if WithoutBaseline.LOG_TRACK in e.without_baseline]


def _usual_delay(legs: Legs) -> tuple[float, float]:
    """Return mean and sd of the delay of the log behind the way over ground [s]."""
    mean, sd = priors.any_log_lag()
    if legs.direction is Direction.TRACK:
        return mean, sd
    return mean - priors.GROUND_LAG.mean, math.hypot(sd, priors.GROUND_LAG.sd)


def _covariance(legs: Legs, sizes: Float64) -> Float64:
    """Return the covariance of the noise; sizes are white, log, water [m/s], two times [s]."""
    white, log, water, log_s, water_s = sizes
    apart = np.abs(legs.time_s[:, None] - legs.time_s)
    together = legs.record[:, None] == legs.record
    course = np.cos(legs.direction_rad[:, None] - legs.direction_rad)
    slow = log**2 * np.exp(-apart / log_s) + water**2 * np.exp(-apart / water_s) * course
    speed = legs.ground_m_s
    found = np.where(together, slow + priors.SAILING_CURRENT.sd**2 * course, 0.0)
    found += priors.SAILING_SCALE.sd**2 * np.outer(speed, speed)
    found += _usual_delay(legs)[1] ** 2 * np.outer(legs.acceleration_m_s2, legs.acceleration_m_s2)
    found[np.diag_indices_from(found)] += white**2
    return np.asarray(found, np.float64)


_POSSIBLE = 0.01  # probability from which nothing is said against an effect
_QUARTERS = ('east', 'north', 'west', 'south')


def diagnose_sailing(
    records: Sequence[SailingRecord],
    parameters: Parameters,
    *,
    no_coastdown: str = 'No coastdown is used.',
) -> DiagnosisResult:
    """
    Name what is wrong between log and way over ground.

    Parameters
    ----------
    records
        One or more, of the same ship; a current is stated along the first leg.
    parameters
        For the convention of the heading.
    no_coastdown
        For the reader: that there is no coastdown, and why.

    Returns
    -------
    Diagnosis
        Of baseline 'none'; it speaks of log and track alone.

    Raises
    ------
    DiagnosisError
        If there is no log, nothing over ground, or too little even sailing.
    """
    standing = StandingLog.of(records, parameters)
    try:
        legs = Legs.of(records, parameters)
    except DiagnosisError as error:
        if standing is None:
            raise
        return _zeros_alone(standing, str(error), no_coastdown)
    open_ = ~np.array([record.units_checked for record in records])[legs.record]
    ratio = legs.log_m_s[open_] / legs.ground_m_s[open_]
    question = asked(float(np.median(ratio))) if open_.any() else ''
    return waiting(_diagnosed(legs, standing, no_coastdown), question)


def _diagnosed(legs: Legs, standing: StandingLog | None, no_coastdown: str) -> DiagnosisResult:
    """Diagnose legs on which the log turns."""
    model = SailingModel.learnt(legs)
    # legs that no effect and no noise explains
    outlier = np.abs(model.all_together.white) > OUTLIER
    if outlier.any():
        legs = legs[np.flatnonzero(~outlier)]
        model = SailingModel.learnt(legs)
    found = model.compare(standing)
    judged = judge(found, model.inseparable)
    verdict, best, effects = judged.decision.verdict, found.best[judged.top], judged.effects
    if standing and not effects and standing.named.probability >= CERTAIN:
        # a name that something without one, beside it, does not touch
        verdict, effects = Verdict.NAMED, (standing.named,)
    answer = judged.result(
        would_decide=declared(judged.candidates) if verdict is Verdict.ONE_OF else (),
        where=None if verdict is Verdict.NONE else _where(model, standing, best),
        before=_gap(found.best[NONE]),
        after=_gap(best) if judged.missing else None,
        baseline='none',
        notes=(
            *([standing.note] if standing else []),
            *legs.notes,
            *_about(model, int(outlier.sum())),
            *(_why(model, found, best) if judged.missing else ()),
        ),
        examined=(LOG_TRACK,),
        no_coastdown=no_coastdown,
    )
    return replace(answer, verdict=verdict, effects=effects)


def _gap(fit: SailingFit) -> Gap:
    return Gap(float(np.sqrt(np.mean(fit.residual_m_s**2))), None, fit.chi2)


def _zeros_alone(standing: StandingLog, why: str, no_coastdown: str) -> DiagnosisResult:
    """Return the result where too little is left beside the zeros."""
    none = np.zeros(0)
    nothing = SailingFit(Explanation(), none, none, none, none, np.zeros((0, 0)), 0.0)
    fits = nothing, nothing.joined(standing)
    found = ComparedHypotheses((standing.way.effect,), fits)
    judged = judge(found, ())
    return judged.result(
        where=standing.where if judged.missing else None,
        before=Gap(float(np.sqrt(np.mean(standing.at_m_s**2))), None, math.nan),
        baseline='none',
        notes=(standing.note, f'nothing else between log and track was examined: {why}'),
        examined=(LOG_TRACK,),
        no_coastdown=no_coastdown,
    )


def _where(model: SailingModel, standing: StandingLog | None, best: SailingFit) -> Where:
    """Return where log and ground disagree; which is wrong is known only of a name."""
    legs, names = model.legs, best.names
    if standing and names == (standing.way.effect.name,):
        return standing.where
    of_log = bool(names) and all(LIBRARY[name].scope is Scope.SENSOR for name in names)
    half = 0.5 * legs.length_s
    return Where(
        'log' if of_log and legs.geodetic else 'log_radar',
        (float(legs.time_s.min()) - half, float(legs.time_s.max()) + half),
        (float(legs.log_m_s.min()), float(legs.log_m_s.max())),
    )


def _about(model: SailingModel, outliers: int) -> list[str]:
    """Say what was used."""
    legs = model.legs
    found = [
        f'log and way over ground are compared on {len(legs)} legs of {legs.length_s:.0f} s, '
        f'whose direction is by {legs.direction}; left out: '
        f'{left_text(legs.left_out)}' + (f', outlier {outliers}' if outliers else '')
    ]
    if legs.direction is Direction.UNKNOWN:
        found.append(
            'without position and heading the courses are not known: a current and an offset '
            'of the log look alike'
        )
    if ruled_out := [effect for effect in shown() if effect not in model.effects]:
        found.append(of_the_earth(ruled_out))
    return found


def _why(
    model: SailingModel, found: ComparedHypotheses[SailingFit], best: SailingFit
) -> list[str]:
    """Say why it is this and none of the others."""
    legs, names = model.legs, best.names
    lines = [f'log over ground: {_by_speed(legs)}']
    action = model.action(best.hypothesis.ways, best.z)
    if any(action.current_m_s):
        east, north = action.current_m_s
        lines.append(f'the water moves by {east:+.3f} m/s to the east, {north:+.3f} to the north')
    if legs.direction is not Direction.UNKNOWN:
        lines.append(f'log over ground by course: {_by_course(legs)}')
    for effect in model.together:
        alike = [sets for sets in model.inseparable if effect.name in sets and sets & set(names)]
        probability = found.probability.get((effect.name,), 0.0)
        if effect.name in names or alike or probability > _POSSIBLE:
            continue
        alone = found.best[effect.name,]
        lines.append(
            f'why not {effect.name}: {effect.without_baseline[WithoutBaseline.LOG_TRACK]}; alone '
            f'it leaves chi2 {alone.chi2:.2f} a leg, {" and ".join(names)} '
            f'{best.chi2:.2f}, and is less probable by '
            f'{0.5 * len(legs) * (alone.chi2 - best.chi2):.0f} nats'
        )
    return lines


def _by_course(legs: Legs) -> str:
    quarter = np.round(legs.direction_rad / (0.5 * math.pi)).astype(int) % 4
    return ', '.join(
        f'{name} {_ratio(legs, quarter == k)}'
        for k, name in enumerate(_QUARTERS)
        if (quarter == k).any()
    )


def _by_speed(legs: Legs) -> str:
    low, high = np.quantile(legs.ground_m_s, (1.0 / 3.0, 2.0 / 3.0))
    slow, fast = legs.ground_m_s <= low, legs.ground_m_s >= high
    return (
        f'{_ratio(legs, slow)} up to {low:.1f} m/s, {_ratio(legs, fast)} from {high:.1f} m/s, '
        f'{_ratio(legs, slow | True)} in all'
    )


def _ratio(legs: Legs, part: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> str:
    ratio = float(legs.log_m_s[part].sum() / legs.ground_m_s[part].sum())
    return f'{ratio:.3f} ({np.count_nonzero(part)} legs)'
