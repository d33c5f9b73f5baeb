# SPDX-License-Identifier: Apache-2.0
"""
What coastdowns of a ship without a stated baseline can still show.

A form of the resistance, -dv/dt = (a v + b v |v|) (1 + a small, smooth shape), is
fitted to the runs themselves. What has that form is then part of the baseline
and cannot be seen: fouling, propellers, cables. A constant part can, but one run
cannot say whether it is a force or a speed; runs on other headings show what
turns with the Earth. No single force is ever named.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.linalg import block_diag

from shipdrag_ros.compiled import compiled
from shipdrag_ros.diagnosis.direct import DirectModel, diagnosis_of_speeds, learn_factor
from shipdrag_ros.diagnosis.fitting import Fit, fit
from shipdrag_ros.diagnosis.model import Hypothesis, Part, start
from shipdrag_ros.diagnosis.result import FORCE, DiagnosisResult, Where
from shipdrag_ros.diagnosis.search import search, with_unnamed
from shipdrag_ros.diagnosis.speeds import CoastRun, MeanSpeeds
from shipdrag_ros.diagnosis.terms import EffectTerm, cubic_bsplines
from shipdrag_ros.diagnosis.verdict import Judgement, judge
from shipdrag_ros.parameter import Parameter, free, normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Frame, Scenario
from shipdrag_ros.simulation.effect import Effect, Scope, WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY

_SD_OF_LOG = 2.0  # of a and b
_SHAPES, _SHAPE_SD = 5, 0.15  # of the resistance about the fitted form, relative
_START_SD = 0.2  # of the first speed, relative
_FORCE_SD = 0.15  # of a constant force, relative to the first deceleration
_OFFSET_SD, _SPLINE_SD, _SPLINES = 0.1, 0.05, 6  # of the reading, relative to the first speed
_WIDE = 3.0  # prior widths while noise is learnt
_SD_OF_LOG_NOISE = np.array([1.5, 1.0])
_EVALUATIONS = 80
_APART_RAD = 0.5  # between headings of runs, from which they show what turns with the Earth
_NOTHING, _ONE, _UNNAMED = 0.5, 0.42, 0.08  # probabilities before the data
_SWINGS_RAD = 0.2


@dataclass(frozen=True)
class GaussianTerm:
    """
    Some unknowns with normal priors.

    Attributes
    ----------
    unknowns
    """

    unknowns: tuple[Parameter, ...]
    one_size: ClassVar[Sequence[int]] = ()


class ResistanceFormTerm(GaussianTerm):
    """ln a [1/s], ln b [1/m], the shape about that form, first speed of each run [m/s]."""


class ConstantForceTerm(GaussianTerm):
    """A constant force over mass along the first heading and to port of it [m/s^2]."""


class SmoothReadingTerm(GaussianTerm):
    """A smooth error of the reading of each run [m/s]."""


@dataclass(frozen=True)
class FormModel(DirectModel):
    """
    Coastdowns and the form of the resistance that is fitted to them; a `Model`.

    Attributes
    ----------
    ship
        For n_r and the mass; its baseline is not used.
    seen
    factor : (n, n)
        Lower triangular: the covariance of the noise is factor factor^T [m/s].
    """

    ship: Ship
    seen: Sequence[MeanSpeeds]
    factor: Float64
    channels: ClassVar[tuple[str, ...]] = ('reading',)

    @classmethod
    def learnt(cls, ship: Ship, seen: Sequence[MeanSpeeds]) -> FormModel:
        """
        Learn the noise, colour included, of the runs themselves: none is known before.

        Parameters
        ----------
        ship
        seen
            One or more.
        """
        white = cls(ship, seen, np.eye(sum(len(coast.time_s) for coast in seen)) * 1e-2)
        pushed = replace(white.nothing, terms=(*white.nothing.terms, white._force))
        rough = fit(white, [pushed], [start(white, pushed)])[0].best
        residual = rough.residuals[0]
        units = np.array([max(float(residual.std()), 1e-6), 0.1 * white._duration_s])
        factor = learn_factor(
            lambda x: _covariance(seen, units * np.exp(x)),
            residual,
            white.factor @ rough.tables[0][1:].T * _WIDE,
            sd_of_log=_SD_OF_LOG_NOISE,
            evaluations=_EVALUATIONS,
        )
        return cls(ship, seen, factor)

    @property
    def by_log(self) -> bool:
        """Whether all runs have a speed through water."""
        return all(coast.by_log for coast in self.seen)

    @cached_property
    def apart(self) -> bool:
        """Whether the headings of the runs differ, and are known."""
        turned = np.array([coast.heading_rad - self.seen[0].heading_rad for coast in self.seen])
        if not np.isfinite(turned).all():
            return False
        return float(np.abs(np.angle(np.exp(1j * turned))).max()) > _APART_RAD

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Those whose trace is a constant part; what turns with the Earth comes first."""
        shown = [
            effect
            for effect in LIBRARY.values()
            if WithoutBaseline.CONSTANT_FORCE in effect.without_baseline
            and (self.by_log or effect.scope is not Scope.SENSOR)
        ]
        return tuple(sorted(shown, key=lambda effect: effect.scope is Scope.SENSOR))

    @property
    def unseen(self) -> tuple[Effect, ...]:
        """Those of the hull that the fitted form has taken up."""
        return tuple(
            effect
            for effect in LIBRARY.values()
            if effect.scope is Scope.HULL and effect not in self.effects
        )

    @cached_property
    def inseparable(self) -> tuple[frozenset[str], ...]:
        """All that is a constant force; on one heading an error of the log as well."""
        return (frozenset(effect.name for effect in self.effects if self._is_force(effect)),)

    def _is_force(self, effect: Effect) -> bool:
        return effect.scope is not Scope.SENSOR or not self.apart

    @cached_property
    def nothing(self) -> Hypothesis:
        """The form alone."""
        first = [float(coast.speed_m_s[0]) for coast in self.seen]
        top, duration = self._top_m_s, self._duration_s
        unknowns = (
            free('ln a', normal(_SD_OF_LOG, mean=math.log(1.0 / duration))),
            free('ln b', normal(_SD_OF_LOG, mean=math.log(1.0 / (duration * top)))),
            *(free(f'shape {k}', normal(_SHAPE_SD)) for k in range(_SHAPES)),
            *(free(f'first {j}', normal(_START_SD * v, mean=v)) for j, v in enumerate(first)),
        )
        return Hypothesis((), (ResistanceFormTerm(unknowns),), log_prior=math.log(_NOTHING))

    def with_effect(self, base: Hypothesis, effect: Effect) -> list[Hypothesis]:
        """
        Return a hypothesis with an effect; two constant parts are not looked for.
        """
        if base.names:
            return []
        term: Part = self._force
        if not self._is_force(effect):
            term = EffectTerm(effect, self.ship, given=(normal(_OFFSET_SD * self._top_m_s),))
        log_odds = math.log(_ONE / len(self.effects) / _NOTHING)
        return [base.with_effect(effect.name, term, log_odds=log_odds)]

    def with_discrepancy(self, base: Hypothesis, channel: str) -> Hypothesis:
        """
        Return a hypothesis with a smooth error of the reading besides.
        """
        sd = _SPLINE_SD * self._top_m_s
        sizes = tuple(
            free(f'{channel} {j} {k}', normal(sd))
            for j in range(len(self.seen))
            for k in range(_SPLINES)
        )
        log_prior = base.log_prior + math.log(_UNNAMED / _NOTHING)
        return replace(
            base,
            terms=(*base.terms, SmoothReadingTerm(sizes)),
            log_prior=log_prior,
            discrepancy=channel,
        )

    @cached_property
    def measured(self) -> Float64:
        """Speeds that are read [m/s]."""
        return np.concatenate([coast.speed_m_s for coast in self.seen])

    def predict(self, hypothesis: Hypothesis, z: Float64) -> Float64:
        """
        Return the speeds that are read [m/s], (n, k), at unknowns (p, k).
        """
        count = z.shape[1]
        force, offset, splines = np.zeros((2, count)), np.zeros(count), None
        for part, place in hypothesis.parts:
            value = np.array(
                [[u.prior.at(each) for each in z[place + i]] for i, u in enumerate(part.unknowns)]
            )
            if isinstance(part, ResistanceFormTerm):
                (a, b), shape = np.exp(value[:2]), value[2 : 2 + _SHAPES]
                first = value[2 + _SHAPES :]
            elif isinstance(part, ConstantForceTerm):
                force = value
            elif isinstance(part, EffectTerm):
                offset = np.array(
                    [part.action(self._frame, 0, each).log_offset_m_s for each in value.T]
                )
            else:
                splines = value.reshape(len(self.seen), _SPLINES, count)
        found = []
        for j, coast in enumerate(self.seen):
            turned = coast.heading_rad - self.seen[0].heading_rad
            turned = turned if math.isfinite(turned) else 0.0
            constant = force[0] * math.cos(turned) + force[1] * math.sin(turned)
            speed = _coasting(coast.time_s, first[j], a, b, shape, self._top_m_s, constant)
            if splines is not None:
                since = (coast.time_s - coast.time_s[0]) / coast.duration_s
                speed = speed + cubic_bsplines(since, _SPLINES).T @ splines[j]
            found.append(speed + offset)
        return np.concatenate(found)

    @property
    def _top_m_s(self) -> float:
        return max(float(coast.speed_m_s[0]) for coast in self.seen)

    @property
    def _duration_s(self) -> float:
        return max(coast.duration_s for coast in self.seen)

    @cached_property
    def _force(self) -> ConstantForceTerm:
        sd = _FORCE_SD * 2.0 * self._top_m_s / self._duration_s
        return ConstantForceTerm(
            (
                free('ahead', normal(sd)),
                free('to port', normal(sd)),
            )
        )

    @cached_property
    def _frame(self) -> Frame:
        return Frame(self.ship, Scenario(speed_m_s=self._top_m_s), self.seen[0].heading_rad)


def diagnose_fitted(runs: Sequence[CoastRun], ship: Ship) -> DiagnosisResult:
    """
    Say what is missing in a resistance that is fitted to the runs.

    Parameters
    ----------
    runs
        One or more; the speed through water is used, or else over ground.
    ship
        For n_r and the mass; its baseline is not used.

    Returns
    -------
    Diagnosis
        Of baseline 'fitted_here'.

    Raises
    ------
    DiagnosisError
        If a run has too few samples of a speed.
    """
    seen = [MeanSpeeds.of(run) for run in runs]
    model = FormModel.learnt(ship, seen)
    found = with_unnamed(search(model))
    judged = judge(found, {effect.name: effect.odds for effect in model.unseen})
    explained = found.best if judged.missing else found.nothing
    speeds = np.concatenate([coast.speed_m_s for coast in seen])
    times = np.concatenate([coast.time_s for coast in seen])
    place = Where(
        'force',
        (float(times.min()), float(times.max())),
        (float(speeds.min()), float(speeds.max())),
    )
    return diagnosis_of_speeds(
        judged,
        place,
        baseline='fitted_here',
        notes=tuple(_notes(model, judged, explained)),
        coastdowns_used=len(seen),
        examined=(FORCE,),
    )


def _covariance(seen: Sequence[MeanSpeeds], sizes: Float64) -> Float64:
    """Return the covariance of the noise; sizes are its slow part [m/s] and a time [s]."""
    slow, time_s = sizes
    blocks = [
        slow**2 * np.exp(-np.abs(coast.time_s[:, None] - coast.time_s) / time_s)
        + np.diag(coast.white_sd_m_s**2)
        for coast in seen
    ]
    return np.asarray(block_diag(*blocks), np.float64)


def _notes(model: FormModel, judged: Judgement, fit: Fit) -> list[str]:
    seen, parts = model.seen, fit.hypothesis.parts
    a, b = np.exp([u.prior.at(z) for u, z in zip(parts[0][0].unknowns[:2], fit.best.z.tolist())])
    found = [
        f'the ship file has no baseline: -dv/dt = a v + b v^2 with a = {a:.3g} 1/s and '
        f'b = {b:.3g} 1/m is fitted to the {len(seen)} run(s) themselves; what has that form '
        '(fouling, propeller, cable) cannot be seen, and no single force is named',
        'the noise is learnt from the coastdown itself: what changes slowly hides in it',
    ]
    for part, place in parts:
        if isinstance(part, ConstantForceTerm):
            ahead, z = part.unknowns[0], float(fit.best.z[place])
            force = ahead.prior.at(z)
            sd = ahead.prior.slope(z) * math.sqrt(fit.covariance[place, place])
            n_r = float(model.ship.n_r(np.array([abs(float(seen[0].speed_m_s[0]))]))[0])
            found.append(
                f'a constant part of {force:.3g} ± {sd:.1g} m/s^2 is there besides: a force of '
                f'{force * model.ship.mass_kg * (1.0 + n_r):.3g} N, or a speed of the water of '
                f'{force / a:.3g} m/s or less'
            )
    if model.by_log and len(seen) == 1:
        remarks = (e.without_baseline[WithoutBaseline.CONSTANT_FORCE] for e in model.effects)
        found += filter(None, remarks)
    swing = max(coast.swing_rad for coast in seen)
    if swing > _SWINGS_RAD:
        found.append(
            f'the heading swings over {math.degrees(swing):.0f} degrees: the drag of drifting '
            'and turning is part of the fitted form'
        )
    return found


@compiled
def _rate(speed: float, a: float, b: float, shape: Float64, top: float, force: float) -> float:
    """Return dv/dt; the shape is a factor, linear between even speeds up to the top."""
    place = min(abs(speed) / top, 1.0) * (len(shape) - 1)
    k = min(int(place), len(shape) - 2)
    factor = 1.0 + shape[k] + (place - k) * (shape[k + 1] - shape[k])
    return float(-(a + b * abs(speed)) * speed * factor - force)


@compiled
def _coasting(
    time_s: Float64,
    first: Float64,
    a: Float64,
    b: Float64,
    shape: Float64,
    top: float,
    force: Float64,
) -> Float64:
    """Integrate by Runge and Kutta, (n, k)."""
    found = np.empty((len(time_s), len(first)))
    for c in range(len(first)):
        speed = first[c]
        own = shape[:, c].copy()
        for i in range(len(time_s)):
            if i:
                dt = time_s[i] - time_s[i - 1]
                one = _rate(speed, a[c], b[c], own, top, force[c])
                two = _rate(speed + 0.5 * dt * one, a[c], b[c], own, top, force[c])
                three = _rate(speed + 0.5 * dt * two, a[c], b[c], own, top, force[c])
                four = _rate(speed + dt * three, a[c], b[c], own, top, force[c])
                speed += dt / 6.0 * (one + 2.0 * two + 2.0 * three + four)
            found[i, c] = speed
    return found
