# SPDX-License-Identifier: Apache-2.0
"""
What earlier diagnoses of a ship say of hypotheses about her today.

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

from shipdrag_ros.diagnosis.earlier import EarlierDiagnosis, check
from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.result import CarriedEffect, SeenRun, WeighedEarlier
from shipdrag_ros.inference.decision import UNKNOWN, marginals
from shipdrag_ros.parameter import Parameter, Prior, Shape, log_normal, normal
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.compare import ComparedHypotheses, Fitted
from shipdrag_ros.posterior.effects import EffectWay, kept_way
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effect import Effect, Scope
from shipdrag_ros.simulation.effects import effects_of, find

_HALF = priors.EARLIER_COUNTS.mean
_WIDEST = 1.0  # sd of the logarithm of a size ...
_WIDE = 2.0  # ... and a relative sd that is wider
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
        total = math.fsum(each.probability for each in holding)
        sizes_now = []
        for quantity in effect.parameters_of(self.ship):
            sizes = [each.effects[effect.name][quantity.name] for each in holding]
            shares = [each.probability / total for each in holding]
            mean = math.fsum(p * size.value for p, size in zip(shares, sizes))
            variance = math.fsum(
                p * (_sd(size) ** 2 + (size.value - mean) ** 2) for p, size in zip(shares, sizes)
            )
            sd = math.hypot(math.sqrt(variance / _HALF), mean * (priors.EARLIER_SIZE.sd + lasted))
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
    if vague.shape is Shape.NORMAL:
        return normal(sd, mean=mean)
    if mean <= 0.0:
        return normal(0.0)
    relative = min(sd / mean, _WIDE)  # a file may state any; the square of a large one overflows
    return log_normal(mean, min(math.sqrt(math.log1p(relative**2)), _WIDEST))


def carried(
    earlier: Sequence[EarlierDiagnosis],
    ship: Ship,
    runs: Sequence[SeenRun],
    facts: Facts,
    sought: Collection[str],
) -> Carried | None:
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

    Returns
    -------
    Carried or None
        None without an earlier diagnosis.

    Raises
    ------
    DiagnosisError
        If one is of another ship, of later runs, or holds a run that would count twice.
    """
    if not earlier:
        return None
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
