# SPDX-License-Identifier: Apache-2.0
"""
What a log reads in any sailing, compared with the way over ground: the hypotheses.

Slow water, turbulence at the log and small errors that every instrument has are
noise, whose colour is learnt beside all effects at once: none of them can hide in
it, and it cannot pass for one of them.

Readings of exactly 0 while the ship moves: a speed below which a log stands still.

Zeros that come at any speed are drop-outs; a ship that drifts with the water has a
log that rightly reads 0, and one way over ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares, minimize
from scipy.special import betaln, expit, logsumexp

from shipdrag_ros.diagnosis.legs import Direction, Legs, SailingRecord, Stretches
from shipdrag_ros.diagnosis.result import EffectEstimate, Where
from shipdrag_ros.inference.decision import NONE, UNKNOWN
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.compare import LIKELY, ComparedHypotheses, WeighedFit
from shipdrag_ros.posterior.effects import EffectWay, ways_of
from shipdrag_ros.posterior.hypotheses import IN_LOG, Explanation, bsplines
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.simulation import Action, Frame, Scenario
from shipdrag_ros.simulation.effect import Effect, Measure, WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY, inseparable

_LOG = 'speed_through_water'
_WIDE = 10.0  # prior widths of the effects while noise is learnt
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
# what log and track show acts alike on all ships, so that any will do
ANY_SHIP = Ship(
    length_m=10.0, displaced_volume_m3=10.0, added_mass=ConstantAddedMass(value=0.07, sd=0.0)
)


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
        slopes = white.factor @ rough.slopes * _WIDE
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
        with_it = tuple(standing.joined(fit) for fit in weighed)
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
        found: Float64 = priors.SMOOTH_SIZES[1] * float(speed.max()) * bent.T
        return found


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


_MOVES_M_S = 0.1  # slower is at rest, as positions show it
_SCATTER_M_S = 0.08  # of the way over ground while the log reads 0, that no drift explains
_APART = 3.0  # stretches in which a wheel sticks once: neighbours are no new evidence
_LAPSES = (0.01, 0.05)  # readings that are otherwise than the speed says
_WIDTHS = (0.02, 0.05, 0.1)  # of the speed at which a wheel begins to turn, relative
_Z = np.linspace(-5.0, 5.0, 401)  # of that speed


@dataclass(frozen=True)
class StandingLog:
    """
    What zeros say of a log that stands still below some speed.

    Attributes
    ----------
    way
        The dead band.
    log_factor
        Logarithm of its Bayes factor over zeros that come at any speed.
    z, sd
        Of the speed.
    at_m_s : (k,)
        Speeds over ground of the stretches in which the log reads 0.
    share
        Of the stretches below that speed, in which it does.
    length_s
        Of the longest record.
    """

    way: EffectWay
    log_factor: float
    z: float
    sd: float
    at_m_s: Float64
    share: float
    length_s: float

    @classmethod
    def of(cls, records: Sequence[SailingRecord], parameters: Parameters) -> StandingLog | None:
        """
        Look at the zeros of a log; None where there are none, or the water may move the ship.

        Parameters
        ----------
        records
            With frozen readings of 0.
        parameters
            For the convention of the heading.

        Raises
        ------
        DiagnosisError
            If there is no log, or nothing over ground.
        """
        stretches = Stretches.of(records, parameters)
        moving = np.abs(stretches.way_m_s) > _MOVES_M_S
        way, zero = stretches.way_m_s[moving], stretches.zero[moving]
        speed = np.abs(way)
        if not zero.any() or zero.all() or _drifts(way[zero], stretches.by_place):
            return None
        (effect,) = (e for e in LIBRARY.values() if WithoutBaseline.ZEROS in e.without_baseline)
        (band,) = effect.parameters
        bands = np.array([band.prior.at(z) for z in _Z.tolist()])
        weight = np.exp(-0.5 * _Z**2)
        each = np.log(weight / weight.sum()) + _log_likelihood(bands, speed, zero) / _APART
        n, k = len(zero), int(zero.sum())
        at_any_speed = float(betaln(k / _APART + 1.0, (n - k) / _APART + 1.0))
        weight = np.exp(each - logsumexp(each))
        z = float(weight @ _Z)
        below = speed < band.prior.at(z)
        return cls(
            next(ways_of(effect, ANY_SHIP, 0.0, 1)),
            float(logsumexp(each)) - at_any_speed,
            z,
            math.sqrt(float(weight @ (_Z - z) ** 2)),
            speed[zero],
            float(zero[below].mean()) if below.any() else 0.0,
            stretches.length_s,
        )

    def joined(self, fit: SailingFit) -> SailingFit:
        """Return a hypothesis about the readings that are not 0, with the dead band in it."""
        ways = fit.hypothesis.ways
        place = sum(len(way.unknowns) for way in ways)
        return replace(
            fit,
            hypothesis=replace(fit.hypothesis, ways=(*ways, self.way)),
            z=np.insert(fit.z, place, self.z),
            sd=np.insert(fit.sd, place, self.sd),
            log_evidence=fit.log_evidence + self.log_factor,
        )

    @property
    def named(self) -> EffectEstimate:
        """The dead band, as probable as the zeros alone make it, whatever else there is."""
        (band,) = self.way.unknowns
        size = Parameter(band.prior.at(self.z), band.prior.slope(self.z) * self.sd)
        probability = float(expit(self.log_factor + self.way.log_odds))
        return EffectEstimate(self.way.effect.name, probability, {band.name: size})

    @property
    def note(self) -> str:
        """For the reader."""
        band = self.way.unknowns[0].prior.at(self.z)
        return (
            f'the log reads exactly 0 in {len(self.at_m_s)} stretches in which she moved over '
            f'ground, at {self.at_m_s.min():.2f} to {self.at_m_s.max():.2f} m/s: in '
            f'{100.0 * self.share:.0f} % of all below {band:.2f} m/s'
        )

    @property
    def where(self) -> Where:
        """Where it shows."""
        span = float(self.at_m_s.min()), float(self.at_m_s.max())
        return Where('log', (0.0, self.length_s), span)

    @property
    def rms_m_s(self) -> float:
        """Of the speed that the log does not show."""
        return float(np.sqrt(np.mean(self.at_m_s**2)))


def _drifts(way: NDArray[np.complex128], by_place: bool) -> bool:
    """Say whether one velocity of the water may be all that moves the ship."""
    if not by_place:
        way = np.abs(way).astype(np.complex128)
    return float(np.sqrt(np.mean(np.abs(way - way.mean()) ** 2))) < _SCATTER_M_S


def _log_likelihood(bands: Float64, speed: Float64, zero: NDArray[np.bool_]) -> Float64:
    """Return that of zeros below each band, averaged over lapses and widths, (bands,)."""
    found = []
    for lapse in _LAPSES:
        for width in _WIDTHS:
            below = expit((1.0 - speed / bands[:, None]) / width)
            chance = lapse + (1.0 - 2.0 * lapse) * below
            found.append(np.log(np.where(zero, chance, 1.0 - chance)).sum(axis=1))
    total: Float64 = logsumexp(np.array(found), axis=0) - np.log(len(found))
    return total
