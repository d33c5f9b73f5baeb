# SPDX-License-Identifier: Apache-2.0
"""
Sensor effects and current from any sailing, without a coastdown.

The log is held against the way made good over ground, on many courses and at
many speeds. No baseline is needed, and no force can be told. Slow water,
turbulence at the log and small errors that every instrument has are noise, whose
colour is learnt beside all effects at once: none of them can hide in it, and it
cannot pass for one of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from shipdrag_ros.diagnosis.direct import DirectModel, diagnosis_of_speeds, learn_factor
from shipdrag_ros.diagnosis.fitting import Fit, fit
from shipdrag_ros.diagnosis.legs import Direction, Legs, SailingRecord, told
from shipdrag_ros.diagnosis.model import UNNAMED_ODDS, Hypothesis, nothing_missing, start
from shipdrag_ros.diagnosis.result import LOG_TRACK, Diagnosis, Where
from shipdrag_ros.diagnosis.search import Found, search, with_pairs
from shipdrag_ros.diagnosis.terms import EffectTerm, cubic_bsplines
from shipdrag_ros.diagnosis.verdict import judge
from shipdrag_ros.parameter import Parameter, free, normal
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.simulation import Action, Frame, Scenario
from shipdrag_ros.simulation.effect import Effect, Measure, Scope, WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY, inseparable

_LOG = 'speed_through_water'
_OUTLIER = 5.0  # whitened
_SPLINES, _SPLINE_SD = 6, 0.05  # of an error of the log without a name, of the highest speed
_SCALE_TOLERANCE = 0.005  # that a log in order has
_CURRENT_TOLERANCE_M_S = 0.04  # steady current that is not worth a word
_WIDE = 10.0  # prior widths of the effects while noise is learnt
_TYPICAL_S = (120.0, 1200.0)  # correlation of the log's error and of slow water
_WATER_M_S = 0.04
_SD_OF_LOG = np.array([1.0, 1.0, 0.7, 0.8, 0.8])
_EVALUATIONS = 400
_QUARTERS = ('east', 'north', 'west', 'south')
# what log and track show acts alike on all ships, so that any will do
_ANY_SHIP = Ship(
    length_m=1.0, displaced_volume_m3=1.0, added_mass=ConstantAddedMass(value=0.0, sd=0.0)
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
        return tuple(effect for effect in _shown() if effect.in_geodetic or not self.legs.geodetic)

    @cached_property
    def inseparable(self) -> tuple[frozenset[str], ...]:
        """Confounders that no sailing, or none of which the courses are unknown, tells apart."""
        measured = [Measure.OTHER_SPEED]
        if self.legs.direction is not Direction.UNKNOWN:
            measured.append(Measure.RECIPROCAL_RUN)
        return inseparable(self.effects, measured=measured)

    @cached_property
    def together(self) -> tuple[Effect, ...]:
        """As many effects as sailing tells apart."""
        found: list[Effect] = []
        sets = inseparable(self.effects, measured=(Measure.OTHER_SPEED, Measure.RECIPROCAL_RUN))
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

    def _predict(self, hypothesis: Hypothesis, z: Float64) -> Float64:
        action, extra = Action(), np.zeros(len(self.legs))
        for part, place in hypothesis.parts:
            values = [u.prior.at(float(z[place + i])) for i, u in enumerate(part.unknowns)]
            if isinstance(part, EffectTerm):
                action += part.action(self._frame, 0, values)
            else:
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


def _shown() -> list[Effect]:
    """Return the effects that log and track show."""
    return [e for e in LIBRARY.values() if WithoutBaseline.LOG_TRACK in e.without_baseline]


def diagnose_sailing(
    records: Sequence[SailingRecord],
    parameters: Parameters,
    *,
    no_coastdown: str = 'No coastdown is used.',
) -> Diagnosis:
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
    legs = Legs.of(records, parameters)
    model = SailingModel.learnt(legs)
    # legs that no effect and no noise explains
    outlier = np.abs(model.fit_of(model.together).best.tables[0][0]) > _OUTLIER
    if outlier.any():
        legs = legs[np.flatnonzero(~outlier)]
        model = SailingModel.learnt(legs)
    found = with_pairs(search(model))
    judged = judge(found)
    return diagnosis_of_speeds(
        judged,
        _where(model, found.best),
        baseline='none',
        notes=(
            *_about(model, int(outlier.sum())),
            *(_why(model, found) if judged.missing else ()),
        ),
        examined=(LOG_TRACK,),
        no_coastdown=no_coastdown,
    )


def _where(model: SailingModel, best: Fit) -> Where:
    """Return where log and ground disagree; which is wrong is known only of a name."""
    legs, names = model.legs, best.hypothesis.names
    of_log = bool(names) and all(LIBRARY[name].scope is Scope.SENSOR for name in names)
    half = 0.5 * legs.length_s
    return Where(
        'log' if of_log and legs.geodetic else 'log_radar',
        (float(legs.time_s.min()) - half, float(legs.time_s.max()) + half),
        (float(legs.log_m_s.min()), float(legs.log_m_s.max())),
    )


def _about(model: SailingModel, outliers: int) -> list[str]:
    """Tell what was used."""
    legs = model.legs
    found = [
        f'log and way over ground are compared on {len(legs)} legs of {legs.length_s:.0f} s, '
        f'whose direction is by {legs.direction}; left out: '
        f'{told(legs.left_out)}' + (f', outlier {outliers}' if outliers else '')
    ]
    if legs.direction is Direction.UNKNOWN:
        found.append(
            'without position and heading the courses are not known: a current and an offset '
            'of the log look alike'
        )
    ruled_out = [effect.name for effect in _shown() if effect not in model.effects]
    if ruled_out:
        found.append(
            'the positions are latitude and longitude, whose scale is that of the Earth: '
            f'{", ".join(ruled_out)} is ruled out'
        )
    return found


def _why(model: SailingModel, found: Found) -> list[str]:
    """Tell why it is this and none of the others."""
    legs, best, names = model.legs, found.best, found.best.hypothesis.names
    told = [f'log over ground: {_by_speed(legs)}']
    if legs.direction is not Direction.UNKNOWN:
        told.append(f'log over ground by course: {_by_course(legs)}')
    for effect in model.together:
        alike = [sets for sets in model.inseparable if effect.name in sets and sets & set(names)]
        if effect.name in names or alike:
            continue
        alone = found.posterior.best[(effect.name,)]
        told.append(
            f'why not {effect.name}: {effect.without_baseline[WithoutBaseline.LOG_TRACK]}; alone '
            f'it leaves chi2 {alone.chi2_per_row:.2f} a leg, {" and ".join(names)} '
            f'{best.chi2_per_row:.2f}, and is less probable by '
            f'{best.log_likelihood - alone.log_likelihood:.0f} nats'
        )
    return told


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
