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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, ndtri

from shipdrag_ros.parameter import Prior, Shape
from shipdrag_ros.samples import Float64

Names = tuple[str, ...]
"""Of the effects that a hypothesis holds, sorted."""

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
class WeighedHypothesis:
    """
    One way in which something may be missing; ways exclude each other.

    Attributes
    ----------
    names
        `NONE`, `UNKNOWN`, or the effects; several hypotheses may have the same.
    log_evidence
        Logarithm of the marginal likelihood, less a constant of the data.
    log_odds
        Logarithm of the prior odds, less a constant of all hypotheses.
    """

    names: Names
    log_evidence: float
    log_odds: float


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


def probabilities(hypotheses: Iterable[WeighedHypothesis]) -> dict[Names, float]:
    """
    Return the posterior probability of each set of names.

    Parameters
    ----------
    hypotheses
        All that were compared; an evidence of -inf is none.

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
    >>> nothing = WeighedHypothesis(NONE, -3.0, 0.0)
    >>> fouled = WeighedHypothesis(('fouling',), 0.0, -2.0)
    >>> {names: round(p, 2) for names, p in probabilities([nothing, fouled]).items()}
    {('fouling',): 0.73, (): 0.27}
    """
    logs = [(each.names, each.log_evidence + each.log_odds) for each in hypotheses]
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


_UNLUCKY_SD = float(ndtri(CERTAIN))  # noise is kinder in so many of all runs
_APART = 0.1  # in z, of Gaussians of that sd whose sum is a prior
_POINTS = np.linspace(-4.0, 4.0, round(8.0 / _APART) + 1)


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


def amounts(prior: Prior, power: float, z: Float64) -> tuple[Float64, Float64]:
    """
    Return how much there is of a trace at some z, to which it is in proportion.

    Parameters
    ----------
    prior
        Of the size.
    power
        Of the size in its trace.
    z : (m,)

    Returns
    -------
    amount, slope : (m,)
        The slope is its derivative by z.
    """
    value, slope = np.array([(prior.at(one), prior.slope(one)) for one in z.tolist()]).T
    size = np.abs(value)
    return np.sign(value) * size**power, power * size ** (power - 1.0) * slope


def prior_amounts(prior: Prior, power: float, unit: float = 1.0) -> Float64:
    """
    Return Gaussians whose sum is a prior of amounts over some unit.

    Returns
    -------
    (3, k)
        Their means, standard deviations and the logarithms of their weights.
    """
    z = np.abs(_POINTS) if prior.shape is Shape.HALF_NORMAL else _POINTS
    amount, slope = amounts(prior, power, z)
    log_chance = -0.5 * z**2 / (1.0 - _APART**2)
    sd = np.abs(_APART * slope / unit)
    return np.array([amount / unit, sd, log_chance - logsumexp(log_chance)])


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
    values, weights = [], []
    for each in known:
        sd = max(each.sd, 1e-12)
        edge = np.union1d(each.z + sd * np.linspace(-8.0, 8.0, 400), np.linspace(-5.0, 5.0, 400))
        if each.prior.shape is Shape.HALF_NORMAL:
            edge = np.union1d(edge[edge >= 0.0], np.geomspace(1e-6, 10.0, 400))
        z = 0.5 * (edge[1:] + edge[:-1])
        middle, slope = amounts(each.prior, each.power, np.array([each.z]))
        apart = (amounts(each.prior, each.power, z)[0] - middle) / slope
        information = max(sd**-2.0 - 1.0, 0.0)
        log = -0.5 * z**2 + each.z * apart - 0.5 * information * apart**2
        weight = np.exp(log - log.max()) * np.diff(edge)
        values.append(np.abs([each.prior.at(one) for one in z.tolist()]))
        weights.append(each.weight / weight.sum() * weight)
    value, weight = np.concatenate(values), np.concatenate(weights)
    order = np.argsort(value)
    value, weight = value[order], weight[order]
    # between points: a step of the distribution at the last digit of a weight is none of the limit
    weight /= weight.sum()  # it may be as small as a number can be
    return float(np.interp(share, np.cumsum(weight) - 0.5 * weight, value))


class _Rival(NamedTuple):
    """
    What an explanation makes of records with each effect (e) at each size (s).

    Attributes
    ----------
    gain : (e, s)
        Log of its probability over that of nothing, without noise.
    lines : (j,)
        Of which what it expects is made.
    expected : (j, e, s)
        How much of each line.
    square : (e, s)
        Of what it expects.
    """

    gain: Float64
    lines: NDArray[np.intp]
    expected: Float64
    square: Float64


def _rival(
    f: int, information: Float64, prior: Float64, sizes: Float64, mine: NDArray[np.intp]
) -> _Rival:
    """Return what explanation f makes of the records; `mine` are the lines of its unknowns."""
    count = len(sizes)
    traces = np.array([f, count + f] if f < count else [], np.intp)
    block = information[np.ix_(mine, mine)] + np.eye(len(mine))
    taken = np.linalg.solve(block, information[mine])
    left = information[traces] - information[np.ix_(traces, mine)] @ taken

    def with_records(products: Float64) -> Float64:
        still, more = products[:, :count, None], products[:, count : 2 * count, None]
        return np.asarray(still + more * sizes)

    found = with_records(taken)
    gain = 0.5 * np.sum(found * with_records(information[mine]), axis=0)
    gain -= 0.5 * np.linalg.slogdet(block)[1]
    amounts_of = np.ones((len(traces), count, len(sizes[0])))
    if len(traces):
        still, both, own = left[0, f], left[1, f], left[1, count + f]
        amount, sd, log_chance = prior[:, f]
        held = sd**-2.0
        total = own + held
        constant = log_chance - 0.5 * (held * amount**2 + np.log(total / held) + still)
        as_is, added = with_records(left)[:, :, :, None]
        right = added - both + held * amount
        logs = as_is + 0.5 * right**2 / total + constant
        top = logs.max(axis=2)
        likely = np.exp(logs - top[:, :, None])
        share = likely.sum(axis=2)
        gain += top + np.log(share)
        amounts_of[1] = (likely * right / total).sum(axis=2) / share
        found -= np.einsum('kt,tes->kes', taken[:, traces], amounts_of)
    lines, expected = np.concatenate([traces, mine]), np.concatenate([amounts_of, found])
    each = np.tensordot(information[np.ix_(lines, lines)], expected, 1)
    return _Rival(gain, lines, expected, np.sum(expected * each, axis=0))


def named_from(
    information: Float64, prior: Float64, log_odds: Float64, owner: NDArray[np.intp]
) -> Float64:
    """
    Return the least amount of each effect that nine of ten such records name.

    Parameters
    ----------
    information : (2 e + k, 2 e + k)
        Products of whitened traces about nothing missing, less what the nuisances take up: first
        of those that effects leave however small they are, then of what a unit amount adds, then
        of what explanations leave open: unknowns that are standard normal.
    prior : (3, e, m)
        Gaussians whose sum is the prior of each amount, from `prior_amounts`.
    log_odds : (h,)
        Prior log odds over nothing, of the effects, then of what has no trace but its unknowns.
    owner : (k,)
        Which explanation leaves each unknown open, 0 .. h - 1.

    Returns
    -------
    (e,)
        0 where it is named however small it is; infinite where no amount within the prior is:
        something else has about the same trace, or amounts are seldom as large as that.

    Notes
    -----
    With the traces c_f + a d_f of each effect f and the covariance C_f of what its unknowns add,
    its log evidence over nothing where the truth is t = c_e + A d_e is the logarithm of the mean,
    over the prior of a, of N(t; c_f + a d_f, 1 + C_f) / N(t; 0, 1), of each Gaussian in closed
    form, and noise adds its product with what f then expects. Over each rival that is taken which
    one record of ten falls below, to first order in the noise.
    """
    count = prior.shape[1]
    sizes = np.sort(np.abs(np.append(prior[0], np.zeros((count, 1)), axis=1)), axis=1)
    rivals = [
        _rival(f, information, prior, sizes, 2 * count + np.flatnonzero(owner == f))
        for f in range(len(log_odds))
    ]
    gain = np.array([each.gain for each in rivals]) + log_odds[:, None, None]
    found = np.full(count, np.inf)
    for e, right in enumerate(rivals[:count]):
        with_all = right.expected[:, e].T @ information[right.lines]
        ahead, square = gain[e, e] - gain[:, e], right.square[e]
        noise = np.array(
            [
                square
                + each.square[e]
                - 2.0 * np.sum(with_all.T[each.lines] * each.expected[:, e], 0)
                for each in rivals
            ]
        )
        ahead[e], noise[e] = gain[e, e], square  # nothing in its own place
        least = ahead - _UNLUCKY_SD * np.sqrt(np.maximum(noise, 0.0))
        chance = 1.0 / (1.0 + np.exp(-np.clip(least, -700.0, 700.0)).sum(axis=0))
        first = int(np.argmax(chance >= CERTAIN))
        if chance[first] >= CERTAIN:
            around = slice(max(first - 1, 0), first + 1)
            found[e] = np.interp(CERTAIN, chance[around], sizes[e, around])
    return found
