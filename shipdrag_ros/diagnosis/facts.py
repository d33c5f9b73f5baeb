# SPDX-License-Identifier: Apache-2.0
"""
What facts of the log book say of hypotheses.

A fact is evidence with an error rate: a hypothesis under which it is not so is
as much less probable as such a fact is seldom stated wrongly. Which facts speak
about an effect, the effect declares.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from shipdrag_ros.diagnosis.result import WeighedFact
from shipdrag_ros.inference.decision import UNKNOWN, Names
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.compare import ComparedHypotheses, Fitted
from shipdrag_ros.ship import Fact, Ship
from shipdrag_ros.ship.facts import DATE, KNOWN, overriding
from shipdrag_ros.simulation.effect import Effect

_DRIVEN = priors.DRIVEN_SHAFT.mean
# what the shaft does where no effect says otherwise, by what the baseline contains
_SHAFT: Mapping[str, Mapping[str, float]] = {
    'free': {'free': 1.0 - _DRIVEN, 'driven': _DRIVEN},
    'locked': {'locked': 1.0},
}


class Missing(Protocol):
    """What may be missing, as facts see it."""

    def effects_in(self, run: int | None) -> list[Effect]:
        """Return the effects that are missing in a run; None: in any."""


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

    def log_likelihood(self, hypothesis: Missing) -> float:
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
        self,
        posterior: ComparedHypotheses[Fitted],
        decides: Callable[[Mapping[Names, float]], bool],
    ) -> dict[str, float]:
        """
        Return how probably something is named once a fact more is known.

        Parameters
        ----------
        posterior
            Of hypotheses, with the facts that are stated.
        decides
            Whether probabilities name something.

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
            found[name] = math.fsum(_decided(posterior.probability, each, decides) for each in so)
        return found

    def _so(self, stated: StatedFact, hypothesis: Missing) -> float:
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
    ship: Ship,
    runs: Sequence[tuple[Sequence[Fact], int]],
    everywhere: Sequence[Fact] = (),
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


def _decided(
    probability: Mapping[Names, float],
    so: Mapping[Names, float],
    decides: Callable[[Mapping[Names, float]], bool],
) -> float:
    """Return the probability of an answer, if something is named after it; else 0."""
    joint = {names: so[names] * p for names, p in probability.items()}
    total = math.fsum(joint.values())
    if total <= 0.0:
        return 0.0
    return total if decides({names: p / total for names, p in joint.items()}) else 0.0
