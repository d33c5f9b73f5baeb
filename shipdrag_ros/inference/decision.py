# SPDX-License-Identifier: Apache-2.0
"""
From hypotheses to what is answered: probabilities, names, limits.

Probabilities by Bayes' rule, and the one decision that is read from them; how large an effect may
be, and from what size on a record names it. Plain data in, plain data out: whatever fits the
hypotheses may use it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.parameter import Prior, Shape
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


LineNumbers = NDArray[np.intp]
_UNLUCKY_SD = NormalDist().inv_cdf(CERTAIN)  # noise is kinder in so many of all runs


class SizePosterior(NamedTuple):
    """
    The size of an effect under one hypothesis that holds it.

    Attributes
    ----------
    weight
        Probability of the hypothesis.
    z, sd
        Mean and standard deviation of z, by a trace that is linear there, before what is beyond
        the end of a one-sided prior is left out.
    prior
        That makes a size of z.
    power
        Of the size in its trace.
    """

    weight: float
    z: float
    sd: float
    prior: Prior
    power: float = 1.0


def quantile(sizes: Sequence[SizePosterior], share: float) -> float:
    """
    Return a quantile of the absolute size of an effect, given that it is there.

    Parameters
    ----------
    sizes
        Under each hypothesis that holds it.
    share
        0 .. 1; 0.95 for an upper limit.

    Raises
    ------
    ValueError
        If no hypothesis has a weight.

    Notes
    -----
    The trace is in proportion to the amount a, not to z: with the slope da/dz at the mean of z,
    the information of the readings is I = (sd^-2 - 1) / slope^2 and their score there z / slope.
    The density over z is exp(-z^2 / 2 + score (a - a_0) - I (a - a_0)^2 / 2).

    Examples
    --------
    >>> from shipdrag_ros.parameter import normal
    >>> round(quantile([SizePosterior(1.0, 0.0, 1.0, normal(0.1))], 0.95), 3)
    0.196
    """
    known = [each for each in sizes if each.weight > 0.0 and np.isfinite(each.sd)]
    if not known:
        raise ValueError('no hypothesis with a weight: the size has no distribution')
    most = max(each.weight for each in known)  # it may be as small as a number can be
    values, weights = [], []
    for each in known:
        sd = max(each.sd, 1e-12)
        edge = np.union1d(each.z + sd * np.linspace(-8.0, 8.0, 400), np.linspace(-5.0, 5.0, 400))
        if each.prior.shape is Shape.HALF_NORMAL:
            edge = np.union1d(edge[edge >= 0.0], np.geomspace(1e-6, 10.0, 400))
        z = 0.5 * (edge[1:] + edge[:-1])
        value = np.array([each.prior.at(one) for one in (each.z, *z.tolist())])
        size = np.abs(value)
        amount = np.sign(value) * size**each.power
        slope = each.power * size[0] ** (each.power - 1.0) * each.prior.slope(each.z)
        apart = (amount[1:] - amount[0]) / slope
        information = max(sd**-2.0 - 1.0, 0.0)
        log = -0.5 * z**2 + each.z * apart - 0.5 * information * apart**2
        weight = np.exp(log - log.max()) * np.diff(edge)
        values.append(size[1:])
        weights.append(each.weight / most / weight.sum() * weight)
    value, weight = np.concatenate(values), np.concatenate(weights)
    order = np.argsort(value)
    value, weight = value[order], weight[order]
    # between points: a step of the distribution at the last digit of a weight is none of the limit
    weight /= weight.sum()
    return float(np.interp(share, np.cumsum(weight) - 0.5 * weight, value))


class Rival(NamedTuple):
    """
    An explanation of a record: at each of its sizes (g) a trace, and what is open about it.

    Attributes
    ----------
    log_odds
        Prior log odds over nothing.
    log_chance : (g,)
        Logarithm of the prior of each size.
    trace, slope : (g,)
        Line of what it leaves at each size, and of what a standard deviation of the size adds.
    open : (g, k)
        Lines of its other unknowns, which are standard normal.
    share : (g,)
        By which these are larger at each size.
    """

    log_odds: float
    log_chance: Float64
    trace: LineNumbers
    slope: LineNumbers
    open: LineNumbers
    share: Float64


class _Expected(NamedTuple):
    """
    What a rival makes of records (t) without noise.

    Attributes
    ----------
    gain : (t,)
        Log of its probability over that of nothing.
    lines : (j,)
        Of which what it expects is made.
    made : (j, t)
        How much of each line.
    square : (t,)
        Of what it expects.
    """

    gain: Float64
    lines: LineNumbers
    made: Float64
    square: Float64


def _expected(rival: Rival, information: Float64, truths: LineNumbers) -> _Expected:
    places = np.column_stack([rival.slope, rival.open])
    gains, parts = [], []
    for trace, mine, share, chance in zip(rival.trace, places, rival.share, rival.log_chance):
        scale = np.full((len(mine), 1), share)
        scale[0] = 1.0
        lines = scale * information[mine]
        block = lines[:, mine] * scale[:, 0] + np.eye(len(mine))
        score = lines[:, truths] - lines[:, [trace]]
        found = np.linalg.solve(block, score)
        gain = information[trace, truths] - 0.5 * information[trace, trace]
        gain += 0.5 * np.sum(score * found, axis=0) - 0.5 * np.linalg.slogdet(block)[1]
        gains.append(gain + chance)
        parts.append(np.vstack([np.ones(len(truths)), scale * found]))
    gain = np.logaddexp.reduce(gains, axis=0)
    lines, place = np.unique(np.column_stack([rival.trace, places]), return_inverse=True)
    made = np.zeros((len(lines), len(truths)))
    weight = np.exp(np.array(gains) - gain)
    np.add.at(made, place.ravel(), np.concatenate(weight[:, None] * np.array(parts)))
    square = np.sum(made * (information[np.ix_(lines, lines)] @ made), axis=0)
    return _Expected(gain + rival.log_odds, lines, made, square)


def chances_of_names(
    information: Float64, effects: Sequence[Rival], others: Sequence[Rival] = ()
) -> list[Float64]:
    """
    Return how probable each effect is at least, by nine of ten records in which it is.

    Parameters
    ----------
    information : (n, n)
        Products of whitened lines about nothing missing, less what the nuisances take up.
    effects
    others
        What else may be missing, without a name.

    Returns
    -------
    list of (g,)
        Of each effect at each of its sizes; what else it leaves open is where its trace has it.

    Notes
    -----
    About each of its sizes an explanation is x_i + K_i z with z standard normal. Its evidence over
    nothing, where a record is the trace t, is p_i N(t; x_i, 1 + K_i K_i') / N(t; 0, 1), summed
    over i, and noise adds its product with what it then expects. Over each rival that is taken
    which one record of ten falls below, to first order in the noise.
    """
    truths = np.concatenate([each.trace for each in effects])
    found = [_expected(each, information, truths) for each in (*effects, *others)]
    chances, first = [], 0
    for e, effect in enumerate(effects):
        here = slice(first, first + len(effect.trace))
        first = here.stop
        mine = found[e]
        with_all = mine.made[:, here].T @ information[mine.lines]
        total = np.zeros(len(effect.trace))
        for f, each in enumerate(found):
            ahead, noise = mine.gain[here], mine.square[here]  # of nothing, in its own place
            if f != e:
                shared = np.sum(with_all[:, each.lines].T * each.made[:, here], axis=0)
                ahead = ahead - each.gain[here]
                noise = noise + each.square[here] - 2.0 * shared
            least = ahead - _UNLUCKY_SD * np.sqrt(np.maximum(noise, 0.0))
            total += np.exp(-np.clip(least, -700.0, 700.0))
        chances.append(1.0 / (1.0 + total))
    return chances


def named_from(sizes: Float64, chance: Float64) -> float:
    """
    Return the least size that is named: the first whose chance is enough.

    Parameters
    ----------
    sizes : (g,)
        From the least of the effect to the most.
    chance : (g,)
        From `chances_of_names`.

    Returns
    -------
    float
        The first of all where that is named; infinite where none is.
    """
    first = int(np.argmax(chance >= CERTAIN))
    if chance[first] < CERTAIN:
        return np.inf
    around = slice(max(first - 1, 0), first + 1)
    return float(np.interp(CERTAIN, chance[around], sizes[around]))
