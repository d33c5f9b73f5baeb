# SPDX-License-Identifier: Apache-2.0
"""
What is known of runs before they are compared: the log book, and earlier diagnoses.

A fact is evidence with an error rate: a hypothesis under which it is not so is
as much less probable as such a fact is seldom stated wrongly. Which facts speak
about an effect, the effect declares.

An effect of hull or instruments that was there stays, unless it went unseen in the
time between, was cleaned off, or the diagnosis was wrong; how long it lasts, the
effect declares. Water, weather and helm are of their day and say nothing.
A diagnosis of before counts half, as what errs in both is no second witness: the ship
file's baseline, the noise as it was taken. Source: power priors, Ibrahim and Chen (2000),
Statistical Science 15, 46-60.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from shipdrag_ros.diagnosis.document import EarlierDiagnosis
from shipdrag_ros.diagnosis.result import CarriedEffect, SeenRun, WeighedEarlier, WeighedFact
from shipdrag_ros.display import utc
from shipdrag_ros.errors import EarlierError
from shipdrag_ros.inference.decision import UNKNOWN, Names, Verdict, decide, marginals, mixture
from shipdrag_ros.parameter import Parameter, Prior, Shape, normal
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.compare import ComparedHypotheses, Fitted
from shipdrag_ros.posterior.effects import EffectWay, kept_way
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.ship import Fact, Ship
from shipdrag_ros.ship.facts import DATE, KNOWN, overriding
from shipdrag_ros.simulation.effect import Effect, Scope
from shipdrag_ros.simulation.effects import effects_of, find

_DRIVEN = priors.DRIVEN_SHAFT.mean
# what the shaft does where no effect says otherwise, by what the baseline contains
_SHAFT: Mapping[str, Mapping[str, float]] = {
    'free': {'free': 1.0 - _DRIVEN, 'driven': _DRIVEN},
    'locked': {'locked': 1.0},
}


@dataclass(frozen=True)
class StatedFact:
    """
    A fact, and the run that it is stated of.

    Attributes
    ----------
    fact
    run
        Its place among the runs; None: all of them.
    time_ns
        Of the stop of that run, or of the first one [ns since the epoch].
    """

    fact: Fact
    run: int | None
    time_ns: int


@dataclass(frozen=True)
class Facts:
    """
    All facts that are stated.

    Attributes
    ----------
    ship
        For the propeller in the baseline.
    stated
    """

    ship: Ship
    stated: tuple[StatedFact, ...] = ()

    def log_likelihood(self, hypothesis: Explanation) -> float:
        """
        Return the logarithm of the probability that these facts are stated.

        Parameters
        ----------
        hypothesis
            About the runs that the facts are of.

        Returns
        -------
        float
            0 without facts.
        """
        return math.fsum(
            math.log(_likelihood(self._so(each, hypothesis), each.fact)) for each in self.stated
        )

    def weighed(
        self, posterior: ComparedHypotheses[Fitted], runs: Sequence[str]
    ) -> tuple[WeighedFact, ...]:
        """
        Return how probable it is that each fact is wrong.

        Parameters
        ----------
        posterior
            Of hypotheses, the facts included.
        runs
            Names of the runs.

        Returns
        -------
        tuple of WeighedFact
            In the order in which they were stated.
        """
        found = []
        for each in self.stated:
            shares = {}
            for names, probability in posterior.probability.items():
                so = self._so(each, posterior.best[names].hypothesis)
                wrong = (1.0 - so) * _stated_wrongly(each.fact)
                shares[names] = probability * wrong / _likelihood(so, each.fact)
            against = max(shares, key=lambda names: shares[names])
            found.append(
                WeighedFact(
                    each.fact,
                    '' if each.run is None else runs[each.run],
                    math.fsum(shares.values()),
                    () if against == UNKNOWN else against,
                )
            )
        return tuple(found)

    def naming(
        self, posterior: ComparedHypotheses[Fitted], inseparable: Sequence[frozenset[str]]
    ) -> dict[str, float]:
        """
        Return how probably something is named once a fact more is known.

        Parameters
        ----------
        posterior
            Of hypotheses, with the facts that are stated.
        inseparable
            Effects that no record separates.

        Returns
        -------
        dict
            By the name of each fact that is not stated yet and has no date; a fact that is
            not so counts as what the effects say that it denies.
        """
        known = {each.fact.name for each in self.stated}
        found = {}
        for name, kind in KNOWN.items():
            if name in known or kind.values == (DATE,):
                continue
            so = [
                {
                    names: self._so(StatedFact(Fact(name, value), None, 0), one.hypothesis)
                    for names, one in posterior.best.items()
                    if names in posterior.probability
                }
                for value in kind.values or ('',)
            ]
            if not kind.values:
                so.append({names: 1.0 - each for names, each in so[0].items()})
            found[name] = math.fsum(_named(posterior, each, inseparable) for each in so)
        return found

    def _so(self, stated: StatedFact, hypothesis: Explanation) -> float:
        """Return how probable it is that a fact is so under a hypothesis."""
        name = stated.fact.name
        effects = [effect for effect in hypothesis.effects_in(stated.run) if name in effect.facts]
        if effects:
            return min(_goes_with(effect, stated) for effect in effects)
        return self._usual(stated.fact)

    def _usual(self, fact: Fact) -> float:
        """Return how probable a fact is where no effect speaks about it."""
        values = KNOWN[fact.name].values
        if fact.value not in values:
            return 1.0
        propeller = self.ship.propeller
        state = propeller.state_in_baseline if propeller else ''
        if state not in _SHAFT:
            return 1.0 / len(values)
        return _SHAFT[state].get(fact.value, 0.0)


def stated_facts(
    ship: Ship, runs: Sequence[tuple[Sequence[Fact], int]], everywhere: Sequence[Fact] = ()
) -> Facts:
    """
    Gather the facts of the ship file, of single runs and of the diagnosis.

    Parameters
    ----------
    ship
        Her file's facts are of all runs, but of those that say otherwise themselves.
    runs
        Facts of each, and the time of its stop [ns since the epoch].
    everywhere
        Of all runs, whatever files say.

    Returns
    -------
    Facts
    """
    first_ns = runs[0][1] if runs else 0
    above = {fact.name for fact in everywhere}
    stated = [StatedFact(fact, None, first_ns) for fact in everywhere]
    own = {fact.name for facts, _ in runs for fact in facts}
    for fact in ship.facts:
        if fact.name not in above | own:
            stated.append(StatedFact(fact, None, first_ns))
    for j, (facts, time_ns) in enumerate(runs):
        of_ship = [fact for fact in ship.facts if fact.name in own]
        for fact in overriding(of_ship, facts):
            if fact.name not in above:
                stated.append(StatedFact(fact, j, time_ns))
    return Facts(ship, tuple(stated))


def _goes_with(effect: Effect, stated: StatedFact) -> float:
    """Return how probable a fact is where an effect is there that it speaks about."""
    said, since_ns = effect.facts[stated.fact.name], stated.fact.time_ns
    if since_ns is None:
        return float(stated.fact.value in said.values and bool(said.values))
    if stated.time_ns < since_ns:  # what was done later says nothing of the run
        return 1.0
    return -math.expm1(-(((stated.time_ns - since_ns) * 1e-9 / said.fades_s) ** 2))


def _stated_wrongly(fact: Fact) -> float:
    """Return how probable it is that it is stated although it is not so."""
    return fact.rate / max(len(KNOWN[fact.name].values) - 1, 1)


def _likelihood(so: float, fact: Fact) -> float:
    """Return how probable it is that a fact is stated."""
    return so * (1.0 - fact.rate) + (1.0 - so) * _stated_wrongly(fact)


def _named(
    posterior: ComparedHypotheses[Fitted],
    so: Mapping[Names, float],
    inseparable: Sequence[frozenset[str]],
) -> float:
    """Return the probability of an answer, if something is named after it; else 0."""
    joint = {names: so[names] * p for names, p in posterior.probability.items()}
    total = math.fsum(joint.values())
    if total <= 0.0:
        return 0.0
    after = decide({names: p / total for names, p in joint.items()}, inseparable)
    return total if after.verdict is Verdict.NAMED else 0.0


_SAME_NS = 60 * SECOND_NS  # stops of one ship so near to each other are one
_LENGTHS = 0.01  # relative, by which the lengths of one ship differ


def check(latest_first: Sequence[EarlierDiagnosis], ship: Ship, runs: Sequence[SeenRun]) -> None:
    """
    Refuse what cannot count for the runs at hand.

    Parameters
    ----------
    latest_first
        Earlier diagnoses.
    ship
        Of the runs.
    runs
        That are diagnosed.

    Raises
    ------
    EarlierError
        If one is of another ship or of later runs, or holds a run that would count twice.
    """
    for each in latest_first:
        if not each.runs:
            raise EarlierError(f'{each.name}: when its runs were is not known; leave it out')
        _refuse_other_ship(each, ship)
    _refuse_twice(latest_first, runs)
    first_ns = min(run.time_ns for run in runs)
    for each in latest_first:
        if each.last_ns > first_ns:
            raise EarlierError(
                f'{each.name}: its run of {utc(each.last_ns)} is later than the first one '
                f'diagnosed here, {utc(first_ns)}; give diagnoses of runs of before with '
                '--earlier FILE'
            )


def _refuse_other_ship(earlier: EarlierDiagnosis, ship: Ship) -> None:
    other = bool(earlier.ship and ship.name) and earlier.ship != ship.name
    if earlier.length_m is not None:
        other = other or abs(earlier.length_m / ship.length_m - 1.0) > _LENGTHS
    if other:
        length = '' if earlier.length_m is None else f' of {earlier.length_m:g} m'
        raise EarlierError(
            f'{earlier.name}: it is of the ship {earlier.ship!r}{length}, and these runs are of '
            f'{ship.name!r} of {ship.length_m:g} m; give diagnoses of one ship with --earlier FILE'
        )


def _refuse_twice(earlier: Sequence[EarlierDiagnosis], runs: Sequence[SeenRun]) -> None:
    """Refuse a run that would count twice."""
    known: list[tuple[SeenRun, str]] = [(run, 'here') for run in runs]
    for each in earlier:
        own = (*each.runs, *each.before)
        for run in own:
            twice = [
                where for other, where in known if abs(other.time_ns - run.time_ns) < _SAME_NS
            ]
            if twice:
                raise EarlierError(
                    f'{each.name}: it holds the run of {utc(run.time_ns)} ({run.name}), which '
                    f'counts {twice[0]} already; a run counts once, so leave one of them out'
                )
        known += [(run, f'in {each.name}') for run in own]


_HALF = priors.EARLIER_COUNTS.mean
_LEAST = 0.01  # probability that is worth a word


@dataclass(frozen=True)
class _Weighed:
    """
    One diagnosis, with what of it still holds.

    Attributes
    ----------
    diagnosis
    stays
        Probability that each effect, where it was there, is there still and as it
        was; without those of which it says nothing.
    unused
        Why it says nothing of an effect that it found, a sentence each.
    """

    diagnosis: EarlierDiagnosis
    stays: Mapping[str, float]
    unused: tuple[str, ...] = ()

    def log_weight(self, there: Collection[str], kept: Collection[str]) -> float:
        """
        Return the logarithm of by how much effects are likelier than without it.

        Parameters
        ----------
        there
            All that are there today.
        kept
            Those of them that are as this diagnosis found them.
        """
        known = math.fsum(each.probability for each in self.diagnosis.candidates)
        weight = 0.0 if kept else max(1.0 - known, 0.0)
        for each, ratio in zip(self.diagnosis.candidates, self._halved, strict=True):
            for name, stays in self.stays.items():
                was = name in each.effects
                ratio *= _ratio(find(name), stays, was=was, there=name in there, kept=name in kept)
            weight += ratio
        return math.log(weight) if weight > 0.0 else -math.inf

    @cached_property
    def _halved(self) -> list[float]:
        """Probabilities of the candidates, were the likelihood of each its root."""
        candidates = self.diagnosis.candidates
        prior = [math.prod(find(name).odds for name in each.effects) for each in candidates]
        found = [
            each.probability**_HALF * odds ** (1.0 - _HALF)
            for each, odds in zip(candidates, prior, strict=True)
        ]
        total = math.fsum(found)
        known = math.fsum(each.probability for each in candidates)
        return [known * each / total if total else 0.0 for each in found]


def _ratio(effect: Effect, stays: float, *, was: bool, there: bool, kept: bool) -> float:
    """
    Return by how much likelier an effect is there, or is not, as it was there or was not.

    Notes
    -----
    A chain of two states whose share in the long run is the prior probability. That a
    diagnosis does not list an effect says less than that it does: runs do not show all.
    """
    prior = effect.odds / (1.0 + effect.odds)
    if not was:
        stays *= 1.0 - priors.EARLIER_UNSEEN.mean
    if kept:
        return stays / prior if was else 0.0
    if there or was:
        return 1.0 - stays
    return (1.0 - (1.0 - stays) * prior) / (1.0 - prior)


@dataclass(frozen=True)
class Carried:
    """
    All that earlier diagnoses say of the runs at hand.

    Attributes
    ----------
    ship
        For the priors of the sizes.
    now_ns
        When the first run was stopped [ns since the epoch].
    weighed
        The latest first.
    """

    ship: Ship
    now_ns: int
    weighed: tuple[_Weighed, ...]

    def log_weight(self, hypothesis: Explanation) -> float:
        """
        Return the log evidence of the diagnoses for a hypothesis.

        Parameters
        ----------
        hypothesis
            About the runs at hand.

        Returns
        -------
        float
            0 on the average over the priors of the effects.
        """
        ways = [way for way in hypothesis.ways if not way.stated]
        there = {way.effect.name for way in ways}
        kept = {way.effect.name for way in ways if way.kept}
        return math.fsum(
            each.log_weight(there, {name for name in kept if self._source(name) is each})
            for each in self.weighed
        )

    def ways(self, effects: Sequence[Effect]) -> list[EffectWay]:
        """
        Return effects that are as they were found; of each that a diagnosis held possible.
        """
        return [
            kept_way(effect, self._kept[effect.name], self.ship)
            for effect in effects
            if effect.name in self._kept
        ]

    @cached_property
    def _kept(self) -> dict[str, tuple[Prior, ...]]:
        found = {}
        for name in {name for each in self.weighed for name in each.stays}:
            source = self._source(name)
            if source is not None:
                found[name] = self._sizes(find(name), source)
        return {name: priors for name, priors in found.items() if priors}

    def judged(self, found: ComparedHypotheses[Fitted]) -> tuple[WeighedEarlier, ...]:
        """
        Return what of each diagnosis counts, and what has become of it; the latest first.
        """
        now = marginals(found.probability)
        return tuple(
            WeighedEarlier(
                each.diagnosis.name,
                each.diagnosis.runs,
                tuple(
                    CarriedEffect(
                        name,
                        then,
                        stays,
                        now.get(name, 0.0),
                        resized=self._source(name) is each and _resized(name, found),
                    )
                    for name, stays in each.stays.items()
                    if (then := each.diagnosis.probability(name)) >= _LEAST
                ),
                each.unused,
                before=each.diagnosis.before,
            )
            for each in self.weighed
        )

    def _source(self, name: str) -> _Weighed | None:
        """Return the latest diagnosis that holds an effect possible."""
        for each in self.weighed:
            if each.stays.get(name, 0.0) > 0.0 and each.diagnosis.probability(name) > 0.0:
                return each
        return None

    def _sizes(self, effect: Effect, source: _Weighed) -> tuple[Prior, ...]:
        """Return priors of sizes about those found, wider by the time that has passed."""
        lasted = (self.now_ns - source.diagnosis.last_ns) * 1e-9 / effect.lasts_s
        holding = [each for each in source.diagnosis.candidates if effect.name in each.effects]
        sizes_now = []
        for quantity in effect.parameters_of(self.ship):
            sizes = [each.effects[effect.name][quantity.name] for each in holding]
            shares = [each.probability for each in holding]
            mean, found = mixture((p, size.value, _sd(size)) for p, size in zip(shares, sizes))
            sd = math.hypot(found / _HALF**0.5, mean * (priors.EARLIER_SIZE.sd + lasted))
            sizes_now.append(_about(quantity.prior, mean, sd))
        return tuple(sizes_now) if all(each.second > 0.0 for each in sizes_now) else ()


def _resized(name: str, found: ComparedHypotheses[Fitted]) -> bool:
    """Say whether an effect is likelier of any size than as it was found."""
    for names in found.probability:
        if name in names and names != UNKNOWN:
            ways = [way for way in found.best[names].hypothesis.ways if not way.stated]
            return not any(way.kept for way in ways if way.effect.name == name)
    return False


def _sd(size: Parameter) -> float:
    """Return the sd of a size; as large as itself where it is not known."""
    return abs(size.value) if math.isnan(size.sd) else size.sd


def _about(vague: Prior, mean: float, sd: float) -> Prior:
    """Return the prior of a size about what was found; of no width where there is none."""
    found = vague.shape is Shape.NORMAL or mean > 0.0
    return vague.about(mean, sd) if found else normal(0.0)


def carried(
    earlier: Sequence[EarlierDiagnosis],
    ship: Ship,
    runs: Sequence[SeenRun],
    facts: Facts,
    sought: Collection[str],
) -> Carried:
    """
    Hold earlier diagnoses against what is to be diagnosed.

    Parameters
    ----------
    earlier
        In any order.
    ship
        Of the runs; what her file states is not missing.
    runs
        That are diagnosed.
    facts
        Of the log book: what is dated between ends an effect.
    sought
        Names of the effects that her ship file and the runs can show.

    Raises
    ------
    DiagnosisError
        If one is of another ship, of later runs, or holds a run that would count twice.
    """
    latest_first = sorted(earlier, key=lambda each: -each.last_ns)
    now_ns = min(run.time_ns for run in runs)
    check(latest_first, ship, runs)
    weighed = []
    of_hull = next((each for each in latest_first if each.of_force), None)
    stated = {one.name for one in ship.effects}
    for each in latest_first:
        stays, unused = {}, []
        for name, effect in effects_of(ship).items():
            why = _unused(effect, each, stated, of_hull)
            if not why and name not in sought:
                why = 'neither her ship file nor an instrument of these runs can show it'
            if not why:
                stays[name] = _stays(effect, each, now_ns, facts)
            elif each.probability(name) >= _LEAST:
                unused.append(f'{name.replace("_", " ")}: {why}')
        weighed.append(_Weighed(each, stays, tuple(unused)))
    return Carried(ship, now_ns, tuple(weighed))


def _unused(
    effect: Effect,
    earlier: EarlierDiagnosis,
    stated: Collection[str],
    of_hull: EarlierDiagnosis | None,
) -> str:
    """Say why a diagnosis says nothing of an effect; '' where it does."""
    if effect.lasts_s <= 0.0:
        return 'water, weather and what was done in a run are of their day'
    if effect.name in stated or effect.name in earlier.stated:
        return 'the ship file states it, now or then'
    if effect.scope is Scope.HULL and earlier is not of_hull:
        # two that rest on one baseline are no two witnesses
        known = 'no baseline was stated' if of_hull is None else f'{of_hull.name} is later'
        return f'of the hull the latest diagnosis counts, and {known}'
    return ''


def _stays(effect: Effect, earlier: EarlierDiagnosis, now_ns: int, facts: Facts) -> float:
    """Return how probable it is that an effect that was found is still there as it was."""
    passed_s = (now_ns - earlier.last_ns) * 1e-9
    stays = (1.0 - priors.EARLIER_ERRS.mean) * math.exp(-passed_s / effect.lasts_s)
    for stated in facts.stated:
        since_ns = stated.fact.time_ns
        ended = since_ns is not None and earlier.last_ns <= since_ns <= now_ns
        if ended and stated.fact.name in effect.facts:
            stays *= stated.fact.rate
    return stays
