# SPDX-License-Identifier: Apache-2.0
"""
From several runs of one ship to the effect that they share and nobody has a name for.

Forms are hypotheses like the effects of the library, in the one posterior of docs/model.md, and
something smooth without a formula stands beside them. A form is written where it holds the
probability, and where each half of the runs shows it too.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.diagnosis import CoastRun
from shipdrag_ros.diagnosis.diagnose import effects_about, observed, of_one_day, stated_in
from shipdrag_ros.diagnosis.observation import Observation, day_of, lowest_m_s, ship_runs
from shipdrag_ros.diagnosis.result import RunSize, Where
from shipdrag_ros.diagnosis.verdict import ComparedRuns, held_out, runs_differ, where
from shipdrag_ros.errors import DiagnosisError, EffectFileError
from shipdrag_ros.inference.decision import CERTAIN, NONE, UNKNOWN, Names
from shipdrag_ros.inference.linear import inverse_of
from shipdrag_ros.inference.rows import LOG
from shipdrag_ros.learning.forms import LearnableForm, Span, forms
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import Comparing, Fitted
from shipdrag_ros.posterior.effects import EffectWay
from shipdrag_ros.posterior.hypotheses import RunSight
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.declared import TermParameter
from shipdrag_ros.ship.model import drag_n
from shipdrag_ros.ship.term import LearntTerm, TermEvidence, TermLimit

_FITTED, _KINDS = 16, 10  # forms that are fitted, the best of so many kinds first
_HALF = math.log(1.0 / 3.0)  # least Bayes factor of a form in each half, against the best there
_LEFT = 0.02  # probability of a form that is said to be left
_LOOK_ALIKE = 3
_UPPER = 1.645
_MANY, _APART_D, _DEEPER = 3, 0.5, 1.1  # runs, days and ratio of depths that can show a form


_DECIDES = {
    'heading': 'on another heading',
    'depth': 'in water of another depth',
    'date': 'some weeks later',
}


@dataclass(frozen=True)
class Learnt:
    """
    What was learnt of some runs.

    Attributes
    ----------
    term
        None where none may be written; then `reason` says why.
    reason, next_run
        Sentences; '' with a term.
    probability
        Of nothing, of the library's names, of something smooth, and of forms by variable and
        shape; most probable first.
    where
        In which channel, when and at which speeds model and data disagree; None where they do
        not.
    likeliest
        Channel, variable and shape of the likeliest form alone, written or not; None without one.
    largest_percent
        How large that is where it is largest: a force, of the resistance; an error of the log, of
        its reading. NaN without one.
    runs
        Names of the runs that were used.
    runs_differ
        Sizes of an effect of the library, where it explains the runs and no one size fits all.
    notes
        On those that were not, and on the way.
    """

    term: LearntTerm | None
    reason: str
    next_run: str
    probability: dict[str, float]
    where: Where | None
    likeliest: tuple[str, str, str] | None
    largest_percent: float
    runs: tuple[str, ...]
    runs_differ: tuple[RunSize, ...]
    notes: tuple[str, ...]


def learn(
    runs: Sequence[CoastRun],
    ship: Ship,
    parameters: Parameters,
    *,
    name: str = 'learnt',
    progress: Progress = silent,
) -> Learnt:
    """
    Learn an effect from runs of one ship.

    Parameters
    ----------
    runs
        In the order in which they were made; each half of them, every second run, must show it.
    ship
        With a baseline; the effects of her file are part of the model.
    parameters
        For the noise of the sensors and the convention of the heading.
    name
        That a term is given.
    progress
        Called with each stage, how much of it is done, and of how much.

    Returns
    -------
    Learnt
        With a term, or with what is known without one.

    Raises
    ------
    DiagnosisError
        If the ship has no baseline, or no run enough steady record.

    Notes
    -----
    Source: evidence of models, MacKay (2003), *Information Theory, Inference, and Learning
    Algorithms*, chapter 28.
    """
    if ship.baseline is None:
        raise DiagnosisError(
            f'ship {ship.name!r} has no baseline, and what is learnt is what it lacks; add '
            '`baseline` to her ship file, or learn one with `shipdrag baseline`'
        )
    seen, notes = observed(runs, ship, parameters, progress=progress)
    case = _LearningCase.of(runs, seen, ship, progress)
    return _Judged(case, name, (*notes, *of_one_day(case)), progress).answer()


@dataclass(frozen=True)
class _LearningCase(ComparedRuns):
    """Runs with forms and the library's effects compared."""

    runs: tuple[CoastRun, ...]
    forms: dict[str, LearnableForm]
    ways: dict[str, list[EffectWay]]

    @classmethod
    def of(
        cls, runs: Sequence[CoastRun], seen: Sequence[Observation], ship: Ship, progress: Progress
    ) -> _LearningCase:
        every = {form.term.name: form for form in forms(ship, _span(seen))}
        progress('looking for forms', 0, 0)
        longest = max(run.duration_s for run in seen)
        ways = {name: form.ways(ship, longest, len(seen)) for name, form in every.items()}
        ranked: dict[str, list[EffectWay]] = {}
        for way in _comparing(runs, seen, ship, ways, library=False).promising():
            ranked.setdefault(way.effect.name, []).append(way)
        first: dict[object, str] = {}  # the best of each kind
        for name in ranked:
            first.setdefault(every[name].kind, name)
        chosen = list(dict.fromkeys((*list(first.values())[:_KINDS], *ranked)))[:_FITTED]
        kept = {name: every[name] for name in chosen}
        begun = {name: ranked[name] for name in chosen}
        # noise is learnt with the traces of forms: with those that fit, not those that were tried
        alone = cls.compared(runs, seen, ship, kept, begun, progress, library=False)
        return cls.compared(runs, seen, ship, kept, alone.fitted_ways(), progress)

    @classmethod
    def compared(
        cls,
        runs: Sequence[CoastRun],
        seen: Sequence[Observation],
        ship: Ship,
        kept: dict[str, LearnableForm],
        ways: dict[str, list[EffectWay]],
        progress: Progress,
        *,
        library: bool = True,
    ) -> _LearningCase:
        progress('comparing forms', 0, 0)
        comparing = _comparing(runs, seen, ship, ways, library=library)
        return cls(tuple(seen), comparing, comparing.compare(), ship, tuple(runs), kept, ways)

    def fitted_ways(self) -> dict[str, list[EffectWay]]:
        """Return the ways of each form, begun where they were fitted."""
        found: dict[str, list[EffectWay]] = {}
        first = self.comparing.first
        for fit in self.found.fitted:
            if self.is_form(fit.names):
                way = fit.hypothesis.ways[-1]
                at = fit.at[first : first + len(way.unknowns)]
                found.setdefault(fit.names[0], []).append(replace(way, start=tuple(at.tolist())))
        return found

    def half(self, which: int, progress: Progress) -> _LearningCase:
        """Return the same of every second run."""
        return _LearningCase.compared(
            self.runs, self.seen[which::2], self.ship, self.forms, self.ways, progress
        )

    def is_form(self, names: Names) -> bool:
        """Say whether a hypothesis is one form alone."""
        return len(names) == 1 and names[0] in self.forms

    def of_kind(self, names: Names) -> str:
        """Return what a hypothesis is called: of forms, variable and shape."""
        if names == NONE:
            return 'nothing is missing'
        if names == UNKNOWN:
            return 'something smooth'
        # a form is what it is, whatever of the library may be beside it
        of_forms = {kind_text(self.forms[name].kind) for name in names if name in self.forms}
        return ' and '.join(sorted(of_forms or names))


def _comparing(
    runs: Sequence[CoastRun],
    seen: Sequence[Observation],
    ship: Ship,
    ways: dict[str, list[EffectWay]],
    *,
    library: bool,
) -> Comparing:
    """Return a comparison of forms, beside the library or not."""
    own = effects_about(seen) if library else []
    effects = [*own, *(each[0].effect for each in ways.values())]
    known = stated_in(runs, seen, ship).log_likelihood
    comparing = Comparing(ship_runs(seen, ship), ship, effects, known, may_differ=own)
    comparing.ways.update(ways)
    return comparing


def kind_text(kind: tuple[str, str, str]) -> str:
    """
    Return channel, variable and shape in words.
    """
    channel, variable, shape = kind
    return f'{channel} by {variable} ({shape})'


def _span(seen: Sequence[Observation]) -> Span:
    """Return what runs hold, by which forms may be told apart."""
    rows = [run.rows.kind for run in seen]
    days = [day_of(run) for run in seen]
    depths = [run.context.depth_m or 0.0 for run in seen]
    several = len(seen) >= _MANY
    return Span(
        min(lowest_m_s(run) for run in seen),
        max(run.speed_m_s for run in seen),
        max(run.duration_s for run in seen),
        log=any((kind == LOG).any() and (kind != LOG).any() for kind in rows),
        days=(round(min(days), 1), round(max(days) + 0.1, 1))
        if several and max(days) - min(days) > _APART_D
        else None,
        depth_m=(round(min(depths), 2), round(max(depths) + 0.01, 2))
        if several and max(depths) > _DEEPER * min(depths) > 0.0
        else None,
    )


@dataclass(frozen=True)
class _Judged:
    """What is answered."""

    case: _LearningCase
    name: str
    notes: tuple[str, ...]
    progress: Progress

    def answer(self) -> Learnt:
        """Return a term, or why there is none."""
        case = self.case
        kinds: dict[str, float] = {}
        for names, p in case.found.probability.items():
            kind = case.of_kind(names)
            kinds[kind] = kinds.get(kind, 0.0) + p
        kinds = dict(sorted(kinds.items(), key=lambda each: -each[1]))
        best = next((n for n in case.found.probability if case.is_form(n)), None)
        by_library = {
            names: p
            for names, p in case.found.probability.items()
            if names not in (NONE, UNKNOWN) and not set(names) & set(case.forms)
        }
        explained = math.fsum(by_library.values())
        reason = self._reason(kinds, best, explained)
        differ: tuple[RunSize, ...] = ()
        if explained > 0.5:
            likeliest = case.found.best[next(iter(by_library))]
            differ = runs_differ(likeliest, [run.name for run in case.seen])
        term = None
        if not reason and best is not None:
            agree, why = self._halves(best)
            reason = '' if agree else why
        if not reason and best is not None:
            try:
                term = self._term(case.found.best[best], best[0])
            except EffectFileError as error:
                reason = f'{case.of_kind(best)} is too little known: {"; ".join(error.problems)}'
        return Learnt(
            term,
            reason,
            '' if term else self._next_run(kinds),
            kinds,
            self._where(kinds, of_force=bool(differ)),
            None if best is None else case.forms[best[0]].kind,
            math.nan if best is None else self._percent(best),
            tuple(run.name for run in case.seen),
            differ,
            self.notes,
        )

    def _reason(self, kinds: dict[str, float], best: Names | None, by_library: float) -> str:
        """Say why nothing may be written before the halves are looked at; '' where it may."""
        first, probability = next(iter(kinds.items()))
        count = len(self.case.seen)
        if first == self.case.of_kind(NONE):
            return f'nothing is missing in {count} run(s), probability {probability:.2f}'
        if by_library > 0.5:
            return (
                f'effects of the library explain it, probability {by_library:.2f}, first {first}, '
                f'{kinds[first]:.2f}; `shipdrag diagnose` says which, or what would decide'
            )
        if count < 2:
            return 'one run never tells forms apart'
        if first == self.case.of_kind(UNKNOWN):
            return f'something smooth explains it without a formula, probability {probability:.2f}'
        if best is None or kinds[self.case.of_kind(best)] < CERTAIN:
            left = ', '.join(kind for kind, p in kinds.items() if p > _LEFT)
            return f'no form is certain; left are {left}'
        return ''

    def _halves(self, best: Names) -> tuple[bool, str]:
        """Say whether each half of the runs shows a form."""
        for which in (0, 1):
            half = self.case.half(which, self.progress)
            # with another effect beside it, it is shown too
            kind = self.case.of_kind(best)
            mine = [f.log_evidence for f in half.found.fitted if half.of_kind(f.names) == kind]
            top = max(fit.log_evidence for fit in half.found.fitted)
            if not mine or max(mine) - top < _HALF:
                names = ', '.join(run.name for run in half.seen)
                return False, (
                    f'{self.case.of_kind(best)} explains all runs, and half of them ({names}) say '
                    'otherwise'
                )
        return True, ''

    def _term(self, fit: Fitted, name: str) -> LearntTerm:
        """Return the form as it was fitted, with what it rests on."""
        form, case = self.case.forms[name], self.case
        values, covariance = _fitted(case.comparing, fit)
        sds = np.sqrt(np.diag(covariance))
        names, used = list(form.term.parameters), {run.name for run in case.seen}
        alone = [f for f in case.found.fitted if not f.hypothesis.names]
        evidence = {
            other: max(f.log_evidence for f in alone if f.names == other)
            for other in (NONE, UNKNOWN)
        }
        before = held_out(case.seen, case.comparing, case.comparing.as_stated)
        after = held_out(case.seen, case.comparing, fit)
        cut = -1.0
        if before and after and before.rms_speed_m_s and after.rms_speed_m_s is not None:
            cut = 1.0 - after.rms_speed_m_s / before.rms_speed_m_s
        return replace(
            form.term,
            name=self.name,
            parameters={
                key: TermParameter(float(f'{value:.6g}'), float(f'{sd:.4g}'))
                for key, value, sd in zip(names, values, sds, strict=True)
            },
            covariance=tuple(tuple(float(f'{x:.6g}') for x in row) for row in covariance),
            evidence=TermEvidence(
                tuple(_digest(run) for run in case.runs if run.name in used),
                round(float(fit.log_evidence - evidence[NONE]), 1),
                round(float(fit.log_evidence - evidence[UNKNOWN]), 1),
                halves_agree=True,
                held_out_gap_cut=round(float(cut), 3),
            ),
            looks_like=self._looks_like(),
            limits={names[0]: TermLimit(float(f'{abs(values[0]) + _UPPER * sds[0]:.4g}'))},
        )

    def _looks_like(self) -> tuple[str, ...]:
        """Return the effects of the library that come nearest."""
        single = [
            (fit.log_evidence, names[0])
            for names, fit in self.case.found.best.items()
            if len(names) == 1 and names != UNKNOWN and names[0] not in self.case.forms
        ]
        return tuple(name for _, name in sorted(single, reverse=True)[:_LOOK_ALIKE])

    def _where(self, kinds: dict[str, float], *, of_force: bool) -> Where | None:
        case, stated = self.case, self.case.comparing.as_stated
        if next(iter(kinds)) == case.of_kind(NONE):
            return None
        return where(case, stated, stated, (), of_force=of_force)

    def _percent(self, best: Names) -> float:
        """Return how large a form is, of the resistance, where it is largest."""
        case, fit = self.case, self.case.found.best[best]
        way = fit.hypothesis.ways[-1]
        assert fit.z is not None
        values = [q.prior.at(z) for q, z in zip(way.unknowns, fit.z[-len(way.unknowns) :])]
        runs = zip(case.comparing.runs.runs, case.seen, strict=True)
        return max(self._percent_in(run, seen, way, values) for run, seen in runs)

    def _percent_in(
        self, run: RunSight, seen: Observation, way: EffectWay, values: Sequence[float]
    ) -> float:
        """Return the same in one run."""
        speed = np.linspace(lowest_m_s(seen), seen.speed_m_s, 50)
        action = way.effect.action(run.frame, *values)
        if action.log_error:
            after = np.linspace(0.0, seen.duration_s, 50)
            wrong = [error(speed[::-1], after) / speed[::-1] for error in action.log_error]
            return float(100.0 * np.max(np.abs(wrong)))
        force = action.resistance_n(speed)
        if action.turns:  # one after the other
            areas = np.cumsum([turn.drag_area_m2 for turn in action.turns])
            force = drag_n(self.case.ship, float(np.abs(areas).max()), speed)
        return float(100.0 * np.max(np.abs(force) / self.case.ship.resistance_n(speed)))

    def _next_run(self, kinds: dict[str, float]) -> str:
        """Say which run would decide."""
        if next(iter(kinds)) == self.case.of_kind(NONE):
            return 'none: a diagnosis says how large an effect could still be'
        left = {
            self.case.forms[name].kind[:2]
            for names, p in self.case.found.probability.items()
            for name in names
            if p > _LEFT and name in self.case.forms
        }
        variables = {variable for _, variable in left}
        used = ', '.join(f'{v:g}' for v in sorted({round(r.speed_m_s, 1) for r in self.case.seen}))
        if len({channel for channel, _ in left}) > 1:
            return 'a run with a speed over ground from GNSS beside the log'
        for variable, run in _DECIDES.items():
            if variable in variables:
                return f'a run {run}, at a speed of one of these'
        if len(variables) > 1 or len(self.case.seen) < 2:
            return (
                f'a run from another speed than {used} m/s: what goes by the speed stays there, '
                'what goes by the time does not'
            )
        return 'a further run, from another speed and on another heading'


def _fitted(comparing: Comparing, fit: Fitted) -> tuple[Float64, Float64]:
    """Return values and covariance of the parameters of the last way of a fit."""
    way = fit.hypothesis.ways[-1]
    assert fit.z is not None
    assert fit.sd is not None
    count = len(way.unknowns)
    z, sd = fit.z[-count:], fit.sd[-count:]
    first = comparing.runs.size + len(fit.hypothesis.unknowns) - count
    own = inverse_of(comparing.information(fit))[first : first + count, first : first + count]
    spread = np.sqrt(np.diag(own))
    slopes = np.array([q.prior.slope(at) for q, at in zip(way.unknowns, z)]) * sd / spread
    values = np.array([q.prior.at(at) for q, at in zip(way.unknowns, z)])
    return values, own * np.outer(slopes, slopes)


def _digest(run: CoastRun) -> str:
    """Return what a run is known by: its readings."""
    found = hashlib.sha256()
    window = run.window
    for series in map(window.series, window.motion):
        found.update(np.ascontiguousarray(series.time_ns).tobytes())
        found.update(np.ascontiguousarray(series.value).tobytes())
    return found.hexdigest()[:16]
