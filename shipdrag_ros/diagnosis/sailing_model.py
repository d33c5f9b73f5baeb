# SPDX-License-Identifier: Apache-2.0
"""
What a log reads in any sailing, held against the way over ground: the hypotheses.

Slow water, turbulence at the log and small errors that every instrument has are
noise, whose colour is learnt beside all effects at once: none of them can hide in
it, and it cannot pass for one of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from shipdrag_ros.diagnosis.direct import DirectModel, learn_factor
from shipdrag_ros.diagnosis.fitting import Fit, fit
from shipdrag_ros.diagnosis.legs import Direction, Legs
from shipdrag_ros.diagnosis.model import UNNAMED_ODDS, Hypothesis, nothing_missing, start
from shipdrag_ros.diagnosis.terms import EffectTerm, cubic_bsplines
from shipdrag_ros.parameter import Parameter, free, normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.simulation import Action, Frame, Scenario
from shipdrag_ros.simulation.effect import Effect, Measure, WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY, inseparable

_LOG = 'speed_through_water'
_SPLINES, _SPLINE_SD = 6, 0.05  # of an error of the log without a name, of the highest speed
_SCALE_TOLERANCE = 0.005  # that a log in order has
_CURRENT_TOLERANCE_M_S = 0.02  # steady current that is not worth a word
_WIDE = 10.0  # prior widths of the effects while noise is learnt
_TYPICAL_S = (120.0, 1200.0)  # correlation of the log's error and of slow water
_WATER_M_S = 0.04
_SD_OF_LOG = np.array([1.0, 1.0, 0.7, 0.8, 0.8])
_EVALUATIONS = 400
_SAILED = (Measure.OTHER_SPEED, Measure.RECIPROCAL_RUN, Measure.ANOTHER_COURSE)
# what log and track show acts alike on all ships, so that any will do
_ANY_SHIP = Ship(
    length_m=10.0, displaced_volume_m3=10.0, added_mass=ConstantAddedMass(value=0.07, sd=0.0)
)


@dataclass(frozen=True)
class LogErrorTerm:
    """
    An error of the log that bends with the speed, beyond a scale and an offset.

    Attributes
    ----------
    sd_m_s
        Of each of its sizes.
    """

    sd_m_s: float
    one_size: ClassVar[Sequence[int]] = ()

    @cached_property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Sizes about some speeds [m/s]."""
        return tuple(free(f'log {k}', normal(self.sd_m_s)) for k in range(_SPLINES))


@dataclass(frozen=True)
class SailingModel(DirectModel):
    """
    What a log reads on legs, by hypothesis; a `Model`.

    Attributes
    ----------
    legs
    factor : (n, n)
        Lower triangular: the covariance of the noise is factor factor^T [m/s].
    """

    legs: Legs
    factor: Float64
    channels: ClassVar[tuple[str, ...]] = ('log',)

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
        rough = white.fit_of(white.together).best
        residual = rough.residuals[0]
        typical = max(float(np.median(np.abs(residual))), 1e-3)
        units = np.array([typical, typical, _WATER_M_S, *_TYPICAL_S])
        factor = learn_factor(
            lambda x: _covariance(legs, units * np.exp(x)),
            residual,
            white.factor @ rough.tables[0][1:].T * _WIDE,
            sd_of_log=_SD_OF_LOG,
            evaluations=_EVALUATIONS,
        )
        return cls(legs, factor)

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
    def nothing(self) -> Hypothesis:
        """The log reads the speed through water, and the water lies still."""
        return Hypothesis((), (), log_prior=math.log(nothing_missing(self.effects, places=1)))

    def with_effect(self, base: Hypothesis, effect: Effect) -> list[Hypothesis]:
        """
        Return a hypothesis with one effect more.
        """
        term = EffectTerm(effect, _ANY_SHIP)
        return [base.with_effect(effect.name, term, log_odds=math.log(effect.odds))]

    def with_discrepancy(self, base: Hypothesis, channel: str) -> Hypothesis:
        """
        Return a hypothesis with a smooth error of the log besides.

        Where it stands alone, a scale and an offset are part of it.
        """
        straight = [e for e in self.effects if _LOG in e.errs_in and not base.names]
        more = (
            *(EffectTerm(effect, _ANY_SHIP) for effect in straight),
            LogErrorTerm(_SPLINE_SD * float(self.legs.ground_m_s.max())),
        )
        log_prior = base.log_prior + math.log(UNNAMED_ODDS)
        return replace(base, terms=(*base.terms, *more), log_prior=log_prior, discrepancy=channel)

    @property
    def measured(self) -> Float64:
        """What the log reads [m/s]."""
        return self.legs.log_m_s

    def predict(self, hypothesis: Hypothesis, z: Float64) -> Float64:
        """
        Return what the log reads [m/s], (n, k), at unknowns (p, k).
        """
        found = np.empty((len(self.legs), z.shape[1]))
        for k, column in enumerate(z.T):
            found[:, k] = self._predict(hypothesis, column)
        return found

    def action(self, hypothesis: Hypothesis, z: Float64) -> Action:
        """
        Return what the effects of a hypothesis do together.

        Parameters
        ----------
        hypothesis
        z : (p,)
            Its unknowns.
        """
        found = Action()
        for part, place in hypothesis.parts:
            if isinstance(part, EffectTerm):
                values = [u.prior.at(float(z[place + i])) for i, u in enumerate(part.unknowns)]
                found += part.action(self._frame, 0, values)
        return found

    def _predict(self, hypothesis: Hypothesis, z: Float64) -> Float64:
        action, extra = self.action(hypothesis, z), np.zeros(len(self.legs))
        for part, place in hypothesis.parts:
            if isinstance(part, LogErrorTerm):
                values = [u.prior.at(float(z[place + i])) for i, u in enumerate(part.unknowns)]
                extra += np.array(values) @ self._splines
        # distances that are too long by a factor: the current is by the same
        radar = 1.0 + action.radar_factor
        east, north = action.current_m_s
        through = self.legs.through_water((east * radar, north * radar)) / radar
        return (1.0 + action.log_factor) * through + action.log_offset_m_s + extra

    def fit_of(self, effects: Sequence[Effect]) -> Fit:
        """
        Return the fit of some effects at once.

        Parameters
        ----------
        effects
            Of this model.

        Returns
        -------
        Fit
            Of all of them in one hypothesis.
        """
        hypothesis = self.nothing
        for effect in effects:
            (hypothesis,) = self.with_effect(hypothesis, effect)
        return fit(self, [hypothesis], [start(self, hypothesis)])[0]

    @cached_property
    def _frame(self) -> Frame:
        """A current is stated along the first leg."""
        return Frame(_ANY_SHIP, Scenario(speed_m_s=1.0), float(self.legs.direction_rad[0]))

    @cached_property
    def _splines(self) -> Float64:
        """What neither a scale nor an offset is, (6, n)."""
        speed = self.legs.ground_m_s
        splines = cubic_bsplines(speed / speed.max(), _SPLINES).T
        line = np.array([np.ones(len(speed)), speed]).T
        found: Float64 = (splines - line @ np.linalg.lstsq(line, splines, rcond=1e-6)[0]).T
        return found


def shown() -> list[Effect]:
    """
    Return the effects that log and track show.
    """
    return [e for e in LIBRARY.values() if WithoutBaseline.LOG_TRACK in e.without_baseline]


def _covariance(legs: Legs, sizes: Float64) -> Float64:
    """Return the covariance of the noise; sizes are white, log, water [m/s], two times [s]."""
    white, log, water, log_s, water_s = sizes
    apart = np.abs(legs.time_s[:, None] - legs.time_s)
    together = legs.record[:, None] == legs.record
    course = np.cos(legs.direction_rad[:, None] - legs.direction_rad)
    slow = log**2 * np.exp(-apart / log_s) + water**2 * np.exp(-apart / water_s) * course
    speed = legs.ground_m_s
    found = np.where(together, slow + _CURRENT_TOLERANCE_M_S**2 * course, 0.0)
    found += _SCALE_TOLERANCE**2 * np.outer(speed, speed)
    found[np.diag_indices_from(found)] += white**2
    return np.asarray(found, np.float64)
