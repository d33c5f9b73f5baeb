# SPDX-License-Identifier: Apache-2.0
"""
Probabilities of hypotheses by Bayes' rule, and the one decision that is read from them.

Plain data in, plain data out: whatever fits the hypotheses may use it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.samples import Float64

Names = tuple[str, ...]
"""Of the effects that a hypothesis holds, sorted."""
Weighed = tuple[Names, float]
"""One way in which something may be missing: ln of its evidence times its prior odds."""

NONE: Names = ()
UNKNOWN: Names = ('unknown',)  # something without a name
CERTAIN = 0.9  # a wrong name costs nine times a missing one
LISTED = 0.99  # of all probability, in the candidates


class Verdict(StrEnum):
    """What is missing in a model."""

    NONE = 'none'
    NAMED = 'named'
    ONE_OF = 'one_of'
    UNKNOWN = 'unknown'


@dataclass(frozen=True)
class Decision:
    """
    What is answered.

    Attributes
    ----------
    verdict
    effects
        That are named, each with its probability over all hypotheses.
    candidates
        The fewest names that hold `LISTED`, most probable first, with their probabilities.
    """

    verdict: Verdict
    effects: Mapping[str, float]
    candidates: tuple[tuple[Names, float], ...]


def probabilities(hypotheses: Iterable[Weighed]) -> dict[Names, float]:
    """
    Return the posterior probability of each set of names.

    Parameters
    ----------
    hypotheses
        All that were compared, which exclude each other, less one constant; several may have the
        same names, and an evidence of -inf is none.

    Returns
    -------
    dict
        Most probable first; adds up to 1.

    Raises
    ------
    ValueError
        If none of them has an evidence.

    Notes
    -----
    Bayes' rule, MacKay (2003), *Information Theory, Inference, and Learning Algorithms*, (28.4).

    Examples
    --------
    >>> nothing, fouled = (NONE, -3.0), (('fouling',), -2.0)
    >>> {names: round(p, 2) for names, p in probabilities([nothing, fouled]).items()}
    {('fouling',): 0.73, (): 0.27}
    """
    logs = list(hypotheses)
    top = max((log for _, log in logs), default=-math.inf)
    if not math.isfinite(top):
        raise ValueError('no hypothesis has an evidence: nothing can be compared')
    weight: dict[Names, float] = {}
    for names, log in logs:
        weight[names] = weight.get(names, 0.0) + math.exp(log - top)
    total = math.fsum(weight.values())
    ordered = sorted(weight, key=lambda names: -weight[names])
    return {names: weight[names] / total for names in ordered}


def marginals(probability: Mapping[Names, float]) -> dict[str, float]:
    """
    Return the probability of each effect over all hypotheses that hold it.

    Parameters
    ----------
    probability
        From `probabilities`.

    Returns
    -------
    dict
        Most probable first; what has no name is no effect.
    """
    sums: dict[str, list[float]] = {}
    for names, p in probability.items():
        for name in names if names != UNKNOWN else ():
            sums.setdefault(name, []).append(p)
    total = {name: math.fsum(shares) for name, shares in sums.items()}
    return dict(sorted(total.items(), key=lambda each: -each[1]))


def smallest_set(
    probability: Mapping[Names, float], level: float
) -> tuple[tuple[Names, float], ...]:
    """
    Return the fewest names that hold a share of the probability, most probable first.

    Parameters
    ----------
    probability
    level
        The share, 0 .. 1.
    """
    kept: list[tuple[Names, float]] = []
    held = 0.0
    for names, p in sorted(probability.items(), key=lambda each: -each[1]):
        if held >= level:
            break
        kept.append((names, p))
        held += p
    return tuple(kept)


def decide(
    probability: Mapping[Names, float], inseparable: Sequence[Collection[str]] = ()
) -> Decision:
    """
    Decide what is answered.

    Parameters
    ----------
    probability
        From `probabilities`.
    inseparable
        Effects that no record separates, whatever their priors are: never named.

    Returns
    -------
    Decision
        A name whose probability over all hypotheses is `CERTAIN`, or nothing where that holds as
        much; unknown where that holds more than half; else one of the candidates.

    Examples
    --------
    >>> shallow, windy = ('shallow_water',), ('shallow_water', 'wind')
    >>> decision = decide({shallow: 0.54, windy: 0.44, NONE: 0.02})
    >>> str(decision.verdict), list(decision.effects)
    ('named', ['shallow_water'])
    """
    never = {name for group in inseparable for name in group}
    named = {
        name: p for name, p in marginals(probability).items() if p >= CERTAIN and name not in never
    }
    if named:
        verdict = Verdict.NAMED
    elif probability.get(NONE, 0.0) >= CERTAIN:
        verdict = Verdict.NONE
    elif probability.get(UNKNOWN, 0.0) > 0.5:
        verdict = Verdict.UNKNOWN
    else:
        verdict = Verdict.ONE_OF
    return Decision(verdict, named, smallest_set(probability, LISTED))


def names_one(
    names: Sequence[Names], probability: Float64, inseparable: Sequence[Collection[str]] = ()
) -> NDArray[np.bool_]:
    """
    Say where `decide` names an effect.

    Parameters
    ----------
    names
        Of hypotheses, each other ones.
    probability : (h, n)
        Of each of them, n times.
    inseparable
        As there.
    """
    never = set(UNKNOWN).union(*inseparable)
    effects = sorted({name for each in names for name in each} - never)
    holds = np.array([[effect in each for each in names] for effect in effects])
    certain = holds.reshape(-1, len(names)) @ probability >= CERTAIN
    return np.asarray(certain.any(axis=0), np.bool_)


def mixture(parts: Iterable[tuple[float, float, float]]) -> tuple[float, float]:
    """
    Return mean and standard deviation over hypotheses.

    Parameters
    ----------
    parts
        Weight, mean and standard deviation under each; weights need not add up to 1.

    Raises
    ------
    ValueError
        If no weight is above 0.
    """
    known = [each for each in parts if each[0] > 0.0]
    total = math.fsum(weight for weight, _, _ in known)
    if not known:
        raise ValueError('no hypothesis with a weight: there is no mean')
    mean = math.fsum(weight * value for weight, value, _ in known) / total
    square = math.fsum(weight * (sd**2 + (value - mean) ** 2) for weight, value, sd in known)
    return mean, math.sqrt(square / total)
