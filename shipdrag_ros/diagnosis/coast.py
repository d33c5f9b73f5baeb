# SPDX-License-Identifier: Apache-2.0
"""
Coastdowns held against a stated baseline: the hypotheses about them.

Effects are found in the library; none is known here by its name.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import ClassVar

import numpy as np
from scipy.special import ndtri

from shipdrag_ros.diagnosis.carried import Carried
from shipdrag_ros.diagnosis.coast_terms import (
    BaselineTerm,
    ForceTerm,
    MeasurementTerm,
    ModelErrorTerm,
    RunNuisance,
    SpeedErrorTerm,
    Term,
)
from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.filters import FilterNuisance
from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.measured import damping_of
from shipdrag_ros.diagnosis.model import UNNAMED_ODDS, Hypothesis, nothing_missing
from shipdrag_ros.diagnosis.simulated import CoastSimulation
from shipdrag_ros.diagnosis.terms import EffectTerm, scope_runs
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.inference.rows import LOG, OVER_GROUND
from shipdrag_ros.parameter import Parameter, Shape, normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effect import Effect, Scope
from shipdrag_ros.simulation.effects import LIBRARY, find, inseparable

DISCREPANCIES = ('force', 'log', 'radar')
_SWINGING = 1  # place of something that swings in time
_EVERYWHERE = (0.03, 0.08, 0.16, 0.27, 0.42, 0.58, 0.79)  # shares of the longest run
_APART = (-0.8, 0.8)  # z of parameters besides the size that a fit may not find from 0


@dataclass(frozen=True)
class CoastModel(CoastSimulation):
    """
    The hypotheses about some runs, and their simulation; a `Model`.

    Attributes
    ----------
    facts
        Of the log book; None: none are stated.
    earlier
        Diagnoses of the ship; None: none are known.
    """

    facts: Facts | None = None
    earlier: Carried | None = None

    # each iteration is a simulation
    iterations: ClassVar[int] = 16
    converged: ClassVar[float] = 0.02
    hopeless: ClassVar[float] = 80.0

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Those of the library that can act on this ship."""
        return tuple(effect for effect in LIBRARY.values() if not effect.missing(self.ship))

    @cached_property
    def nothing(self) -> Hypothesis:
        """The ship as its file states it, and no more."""
        if self.ship.baseline is None:
            raise DiagnosisError(
                f'ship {self.ship.name!r} has no baseline to hold a run against; '
                'add `baseline` to its ship file, or learn one with `shipdrag baseline`'
            )
        ship = self.bare
        stated = ship.propulsion.run_down_s if ship.propulsion else 0.0
        baseline = BaselineTerm(
            ship,
            1.05 * max(run.speed_m_s for run in self.seen),
            tuple(run.run_down_s - stated for run in self.seen),
            max(run.run_down_sd_s for run in self.seen),
        )
        scatter = self.ship.baseline.run_scatter
        places = tuple(
            RunNuisance(
                j,
                run.heading_sd_rad,
                run.stop_sd_s,
                run.across is not None,
                scatter,
                stop_s=-run.stop_moved_s,
            )
            for j, run in enumerate(self.seen)
        )
        given: list[Term] = [
            EffectTerm(
                find(effect.name),
                ship,
                given=tuple(
                    normal(effect.parameters[q.name].sd, mean=effect.parameters[q.name].value)
                    if q.name in effect.parameters
                    else normal(0.0, mean=float(np.nan_to_num(q.of(ship).value)))
                    for q in find(effect.name).parameters
                ),
                stated=True,
            )
            for effect in self.ship.effects
        ]
        log_prior = math.log(nothing_missing(self.effects, places=len(DISCREPANCIES) + _SWINGING))
        found = Hypothesis((), (baseline, *given, self._filters), places, log_prior=log_prior)
        return replace(found, log_prior=log_prior + self._log_evidence(found))

    @cached_property
    def _filters(self) -> FilterNuisance:
        """Those that log and speed over ground have without anything missing."""
        kinds = set(np.concatenate([run.along.rows.kind for run in self.seen]).tolist())
        top = np.array([max(run.speed_m_s for run in self.seen)])
        # v over r is about 2 over dr/dv
        slow_down_s = 2.0 / float(damping_of(self.bare, top)[0][0])
        return FilterNuisance(slow_down_s, LOG in kinds, OVER_GROUND in kinds)

    def _log_evidence(self, hypothesis: Hypothesis) -> float:
        """Return the log evidence of facts and of earlier diagnoses; it is no prior."""
        facts = 0.0 if self.facts is None else self.facts.log_likelihood(hypothesis)
        return facts + (0.0 if self.earlier is None else self.earlier.log_weight(hypothesis))

    def with_effect(self, base: Hypothesis, effect: Effect) -> list[Hypothesis]:
        """
        Return a hypothesis with one effect more, in the ways that it may be there.

        They differ in where a fit begins, in what is a choice, in signs, in which run
        an effect of a single run was, and in whether it is as an earlier diagnosis found it,
        which comes last.

        Parameters
        ----------
        base
            Of this model.
        effect
            That may act on the ship.

        Returns
        -------
        list of Hypothesis
            The effect is their last term.
        """
        free = [q for q in effect.parameters if q.prior.shape is not Shape.CHOICE]
        choices = [q for q in effect.parameters if q.prior.shape is Shape.CHOICE]
        signed = [q for q in free if q.prior.shape is Shape.EITHER_SIGN]
        signs = list(product((1.0, -1.0), repeat=len(signed)))
        longest_s = max(run.duration_s for run in self.seen)
        starts = list(product(*(_starts(q, longest_s, first=q is free[0]) for q in free)))
        words = list(product(*((q.prior.first, q.prior.second) for q in choices)))
        runs = scope_runs(effect, len(self.seen))
        ways = len(words) * len(signs) * len(runs)
        terms = [
            EffectTerm(
                effect,
                self.bare,
                start,
                fixed=_named(choices, word),
                signs=_named(signed, sign),
                only_run=run,
            )
            for start, word, sign, run in product(starts, words, signs, runs)
        ]
        found = [self._with_term(base, term, ways) for term in terms]
        kept = () if self.earlier is None else self.earlier.kept(effect.name)
        if kept:
            term = EffectTerm(effect, self.bare, given=kept, kept=True)
            found.append(self._with_term(base, term, 1))
        return found

    def _with_term(self, base: Hypothesis, term: EffectTerm, ways: int) -> Hypothesis:
        """Return a hypothesis with one effect more, in one of so many ways."""
        sd = term.effect.formula_sd
        more = base.with_effect(
            term.effect.name,
            term,
            log_odds=math.log(term.effect.odds),
            ways=ways,
            model_errors=(ModelErrorTerm(term, sd),) if sd > 0.0 else (),
        )
        gained = self._log_evidence(more) - self._log_evidence(base)
        return replace(more, log_prior=more.log_prior + gained)

    def with_nameless(self, base: Hypothesis, term: EffectTerm, plain: EffectTerm) -> Hypothesis:
        """
        Return a hypothesis in which one of the effects is something without a name.

        Parameters
        ----------
        base
            Of this model.
        term
            Of the effect, in the hypothesis.
        plain
            What stands in its place.

        Returns
        -------
        Hypothesis
            With prior odds of `UNNAMED_ODDS` in place of those of the effect.
        """
        swapped = replace(
            base,
            names=tuple(name for name in base.names if name != term.effect.name),
            terms=tuple(plain if each is term else each for each in base.terms),
            model_errors=tuple(
                replace(each, term=plain) if each.term is term else each
                for each in base.model_errors
            ),
            discrepancy='force',
            log_odds=base.log_odds - math.log(term.effect.odds),
        )
        less = math.log(UNNAMED_ODDS / term.effect.odds)
        ways = math.log(2.0) * (len(term.signs) - len(plain.signs))
        gained = self._log_evidence(swapped) - self._log_evidence(base)
        return replace(swapped, log_prior=base.log_prior + less + ways + gained)

    def with_discrepancy(self, base: Hypothesis, channel: str) -> Hypothesis:
        """
        Return a hypothesis with something smooth and unnamed besides.

        Parameters
        ----------
        base
            Of this model.
        channel
            One of `channels`.

        Returns
        -------
        Hypothesis
            With prior log odds of `UNNAMED_ODDS` more.
        """
        log_prior = base.log_prior + math.log(UNNAMED_ODDS)
        found = replace(base, discrepancy=channel, log_prior=log_prior)
        if channel == 'force':
            top = 1.05 * max(run.speed_m_s for run in self.seen)
            return replace(found, terms=(*base.terms, ForceTerm(self.bare, top)))
        errors: list[MeasurementTerm] = [
            SpeedErrorTerm(j, channel == 'log', run.speed_m_s) for j, run in enumerate(self.seen)
        ]
        return replace(found, measurement_terms=(*base.measurement_terms, *errors))

    def transferred(self, other: Hypothesis, *, runs: Sequence[int]) -> Hypothesis:
        """
        Return a hypothesis about more runs as one about these.

        Parameters
        ----------
        other
            About more runs.
        runs
            Which of the others these are. What is in a single run comes last, and
            is left out where that is none of them.

        Returns
        -------
        Hypothesis
            Of this model.
        """
        kept: list[Term] = []
        own: list[Term] = []
        for term in other.terms[len(self.nothing.terms) :]:
            if not isinstance(term, EffectTerm):
                continue
            if term.effect.scope is not Scope.RUN:
                kept.append(term)
            elif term.only_run is None:
                own.append(term)
            elif term.only_run in runs:
                own.append(replace(term, only_run=runs.index(term.only_run)))
        return replace(self.nothing, names=other.names, terms=(*self.nothing.terms, *kept, *own))

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Where something unnamed can be."""
        kinds = set(np.concatenate([run.along.rows.kind for run in self.seen]).tolist())
        if kinds == {LOG} or LOG not in kinds:
            return ('force',)
        return DISCREPANCIES

    def stop_moved_s(self, fit: Fit, run: int) -> float:
        """
        Return by how much a fit moves the stop of a run.

        Parameters
        ----------
        fit
            Of this model.
        run
            Its place among the runs.

        Returns
        -------
        float
            Later than it was taken for [s].
        """
        for part, place in fit.hypothesis.parts:
            if isinstance(part, RunNuisance) and part.run == run:
                at = part.place_of_stop
                return part.unknowns[at].prior.at(float(fit.best.z[place + at]))
        raise AssertionError(f'run {run} has no place')

    @property
    def inseparable(self) -> tuple[frozenset[str], ...]:
        """Confounders that no record of a coastdown separates."""
        return inseparable(self.effects)

    @property
    def free(self) -> Float64:
        """Steady speeds of the runs [m/s]."""
        return np.array([run.speed_m_s for run in self.seen])


def _starts(quantity: Parameter, longest_s: float, *, first: bool) -> tuple[float, ...]:
    """Return z that fits begin from; a uniform prior is that of a time: within the longest run."""
    shape = quantity.prior.shape
    if first:
        return {Shape.HALF_NORMAL: (0.3,), Shape.LOG_NORMAL: _APART}.get(shape, (0.0,))
    if shape is Shape.UNIFORM:
        low, high = quantity.prior.first, quantity.prior.second
        part = min(longest_s / (high - low), 1.0)
        return tuple(float(ndtri(part * each)) for each in _EVERYWHERE)
    return (0.0,) if shape in (Shape.NORMAL, Shape.EITHER_SIGN) else _APART


def _named(
    choices: Sequence[Parameter], values: tuple[float, ...]
) -> tuple[tuple[str, float], ...]:
    return tuple((q.name, value) for q, value in zip(choices, values, strict=True))
