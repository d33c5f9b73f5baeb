# SPDX-License-Identifier: Apache-2.0
"""What is answered and how large an effect may be follow from probabilities."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.special import logsumexp
from scipy.stats import halfnorm, norm

from shipdrag_ros.inference.decision import (
    CERTAIN,
    LISTED,
    NONE,
    UNKNOWN,
    Rival,
    SizePosterior,
    Verdict,
    Weighed,
    chances_of_names,
    decide,
    marginals,
    mixture,
    named_from,
    names_one,
    probabilities,
    quantile,
    smallest_set,
)
from shipdrag_ros.parameter import Prior, Shape, half_normal, log_normal, normal
from shipdrag_ros.samples import Float64

A, B, BOTH = ('a',), ('b',), ('a', 'b')
LOGS = st.floats(-40.0, 40.0)
WAYS = st.lists(
    st.tuples(st.sampled_from([NONE, UNKNOWN, A, B, BOTH]), LOGS),
    min_size=1,
)


def test_probabilities_are_bayes_rule_to_the_digit() -> None:
    evidence = {NONE: -4.0, A: -1.5, BOTH: -1.0, UNKNOWN: -6.0}
    odds = {NONE: 0.0, A: -3.0, BOTH: -6.0, UNKNOWN: -4.0}
    found = probabilities([(n, evidence[n] + odds[n]) for n in evidence])
    weight = {n: math.exp(evidence[n] + odds[n]) for n in evidence}
    for names, p in found.items():
        assert p == pytest.approx(weight[names] / sum(weight.values()), rel=1e-12)


def test_a_weak_effect_keeps_its_probability() -> None:
    # a Bayes factor of 4 is no strong evidence, and is evidence all the same
    found = probabilities([(NONE, 0.0), (A, math.log(4.0))])
    assert found[A] == pytest.approx(0.8)


def test_ways_of_the_same_names_add_up() -> None:
    found = probabilities([(NONE, 0.0), *[(A, 0.0)] * 3])
    assert found[A] == pytest.approx(0.75)


def test_no_evidence_at_all_is_an_error() -> None:
    with pytest.raises(ValueError, match='nothing can be compared'):
        probabilities([(NONE, -math.inf)])


@given(WAYS)
def test_every_decision_follows_from_the_probabilities(ways: list[Weighed]) -> None:
    probability = probabilities(ways)
    assert math.fsum(probability.values()) == pytest.approx(1.0)
    found = decide(probability)
    sure = {name for name, p in marginals(probability).items() if p >= CERTAIN}
    assert set(found.effects) == sure
    assert (found.verdict is Verdict.NAMED) == bool(sure)
    assert (found.verdict is Verdict.NONE) == (probability.get(NONE, 0.0) >= CERTAIN)
    listed = [p for _, p in found.candidates]
    assert listed == sorted(listed, reverse=True)
    assert sum(listed) >= LISTED - 1e-9 > sum(listed[:-1]) - 1e-9


@given(st.lists(WAYS, min_size=1, max_size=5), st.sampled_from([(), [frozenset('ab')]]))
def test_many_probabilities_at_once_name_where_one_decision_does(several, inseparable):
    each = [probabilities(ways) for ways in several]
    sums = [p for one in each for p in marginals(one).values()]
    assume(all(abs(p - CERTAIN) > 1e-9 for p in sums))
    names = [NONE, UNKNOWN, A, B, BOTH]
    columns = np.array([[one.get(name, 0.0) for one in each] for name in names])
    named = [decide(one, inseparable).verdict is Verdict.NAMED for one in each]
    assert names_one(names, columns, inseparable).tolist() == named


@pytest.mark.parametrize(
    ('probability', 'verdict', 'named'),
    [
        ({NONE: 0.91, A: 0.09}, Verdict.NONE, []),
        ({NONE: 0.89, A: 0.11}, Verdict.ONE_OF, []),
        ({A: 0.91, NONE: 0.09}, Verdict.NAMED, ['a']),
        ({A: 0.89, NONE: 0.11}, Verdict.ONE_OF, []),
        ({A: 0.55, BOTH: 0.40, B: 0.05}, Verdict.NAMED, ['a']),
        ({BOTH: 0.95, A: 0.05}, Verdict.NAMED, ['a', 'b']),
        ({UNKNOWN: 0.51, A: 0.49}, Verdict.UNKNOWN, []),
        ({UNKNOWN: 0.49, A: 0.51}, Verdict.ONE_OF, []),
    ],
)
def test_where_the_line_is(probability, verdict, named):
    found = decide(probability)
    assert (found.verdict, sorted(found.effects)) == (verdict, named)


def test_what_no_record_separates_is_never_named() -> None:
    found = decide({A: 0.95, NONE: 0.05}, [frozenset('ab')])
    assert found.verdict is Verdict.ONE_OF
    assert not found.effects


def test_the_smallest_set_may_hold_nothing_and_something_without_a_name() -> None:
    probability = {NONE: 0.55, A: 0.3, UNKNOWN: 0.1, B: 0.05}
    assert [names for names, _ in smallest_set(probability, 0.9)] == [NONE, A, UNKNOWN]


def test_a_mixture_holds_the_spread_between_its_parts() -> None:
    assert mixture([(1.0, 0.0, 1.0), (1.0, 2.0, 1.0), (0.0, 9.0, 9.0)]) == (1.0, math.sqrt(2.0))


def test_the_last_digit_of_a_weight_moves_no_limit() -> None:
    sizes = [
        SizePosterior(w, z, 0.7, normal(0.1)) for w, z in ((0.4, -1.0), (0.3, 0.5), (0.3, 2.0))
    ]
    moved = [each._replace(weight=each.weight * (1.0 + 1e-13 * k)) for k, each in enumerate(sizes)]
    for share in (0.05, 0.5, 0.95):
        assert quantile(moved, share) == pytest.approx(quantile(sizes, share), rel=1e-9)
    # one hypothesis: a share that falls between two of its points
    for factor in (1.0 - 1e-12, 1.0 + 1e-12):
        alone = quantile([SizePosterior(0.3 * factor, 0.0, 1.0, half_normal(1.0))], 0.95)
        assert alone == pytest.approx(1.95996, rel=1e-4)


def test_the_limit_of_a_size_is_the_quantile_of_its_distribution() -> None:
    alone = quantile([SizePosterior(0.3, 0.0, 1.0, normal(0.1))], 0.95)
    assert alone == pytest.approx(0.1 * norm.ppf(0.975), rel=0.02)
    # one-sided: what is beyond the end is none of it
    one_sided = quantile([SizePosterior(1.0, 0.0, 1.0, half_normal(0.1))], 0.95)
    assert one_sided == pytest.approx(0.1 * halfnorm.ppf(0.95), rel=0.02)
    # given that it is there: how improbable that is does not matter
    improbable = quantile([SizePosterior(3e-312, 0.0, 1.0, half_normal(0.1))], 0.95)
    assert improbable == pytest.approx(one_sided, rel=1e-6)
    # of a mean far beyond the end an exponential tail is left
    beyond = quantile([SizePosterior(1.0, -40.0, 1.0, half_normal(0.1))], 0.95)
    assert beyond == pytest.approx(-0.1 * math.log(0.05) / 40.0, rel=0.02)
    deep = quantile([SizePosterior(1.0, 0.0, 1.0, log_normal(20.0, 0.35))], 0.05)
    assert deep == pytest.approx(20.0 * math.exp(0.35 * norm.ppf(0.05)), rel=0.02)
    both = [SizePosterior(0.9, 1.0, 1e-6, normal(1.0)), SizePosterior(0.1, 3.0, 1e-6, normal(1.0))]
    assert quantile(both, 0.85) == pytest.approx(1.0, abs=1e-4)
    assert quantile(both, 0.95) == pytest.approx(3.0, abs=1e-4)
    with pytest.raises(ValueError, match='no distribution'):
        quantile([], 0.95)


@pytest.mark.parametrize('power', [1.0, -1.8])
@pytest.mark.parametrize('reading', [0.02, 0.1, 0.4])
def test_the_limit_of_a_log_normal_size_is_that_of_its_posterior_on_a_grid(power, reading):
    # the reading of a trace that is the size to a power, with noise of 0.1
    prior, noise = log_normal(0.25, 0.6), 0.1
    z = np.linspace(-8.0, 8.0, 200_001)
    amount = prior.at(0.0) ** power * np.exp(power * prior.second * z)
    scaled = reading * prior.at(0.0) ** (power - 1.0)
    sd = noise * prior.at(0.0) ** (power - 1.0)
    log = -0.5 * z**2 - 0.5 * ((scaled - amount) / sd) ** 2
    best = int(np.argmax(log))
    slope = power * prior.second * amount[best]
    fitted = SizePosterior(1.0, float(z[best]), (1.0 + (slope / sd) ** 2) ** -0.5, prior, power)
    below = np.cumsum(np.exp(log - log[best]))
    for share in (0.05, 0.5, 0.95):
        exact = prior.at(float(np.interp(share, below / below[-1], z)))
        assert quantile([fitted], share) == pytest.approx(exact, rel=0.01)


_CELL = 0.1  # in z: Gaussians that far apart, and of that sd, are a prior


def _named(
    traces: Float64,
    priors: list[Prior],
    still: Float64 | None = None,
    more: Float64 | None = None,
) -> list[float]:
    """
    Return amounts from which traces (e, n), beside those of no size, are named.

    What the first leaves open is `more` (k, n).
    """
    z = np.arange(-4.0, 4.01, _CELL)
    lines, effects, sizes = [np.zeros((1, traces.shape[1]))], [], []
    opened = np.zeros((0, traces.shape[1])) if more is None else more
    lines.append(opened)
    count = 1 + len(opened)
    for e, (prior, trace) in enumerate(zip(priors, traces, strict=True)):
        kept = z[z >= 0.0] if prior.shape is Shape.HALF_NORMAL else z
        size = np.append(0.0, [prior.at(one) for one in kept.tolist()])
        slope = np.append(0.0, [_CELL * prior.slope(one) for one in kept.tolist()])
        lines += [(0.0 if still is None else still[e]) + np.outer(size, trace)]
        lines += [np.outer(slope, trace)]
        chance = np.append(-np.inf, -0.5 * kept**2 / (1.0 - _CELL**2))
        places = count + np.arange(2 * len(size)).reshape(2, -1)
        mine = np.arange(1, 1 if e else 1 + len(opened))
        effects.append(
            Rival(
                math.log(0.05),
                chance - logsumexp(chance),
                *places,
                np.tile(mine, (len(size), 1)),
                np.ones(len(size)),
            )
        )
        count += 2 * len(size)
        sizes.append(size)
    joined = np.concatenate(lines)
    found = []
    for size, chance in zip(sizes, chances_of_names(joined @ joined.T, effects), strict=True):
        order = np.argsort(size)
        order = order[size[order] >= 0.0]
        found.append(named_from(size[order], chance[order]))
    return found


def test_nine_of_ten_records_of_that_size_name_it() -> None:
    # N = 4000 records of 40 rows, seed 0; binomial sd 0.5 %, to first order within 4 %
    rng = np.random.default_rng(0)
    rows = np.linspace(0.0, 1.0, 40)
    traces = 1.5 * np.array([np.ones(40), rows, rows**2 * 1.2])
    amounts = _named(traces, [normal(1.0)] * 3)
    assert np.isfinite(amounts).all()
    own = np.diag(traces @ traces.T)
    for e, amount in enumerate(amounts):
        named = 0
        for _ in range(4000):
            score = traces @ (amount * traces[e] + rng.standard_normal(40))
            gain = 0.5 * score**2 / (own + 1.0) - 0.5 * np.log(own + 1.0)
            ways = [((f'e{f}',), gain[f] + math.log(0.05)) for f in range(3)]
            found = decide(probabilities([(NONE, 0.0), *ways]))
            named += list(found.effects) == [f'e{e}']
        assert named / 4000 == pytest.approx(0.9, abs=0.04)


@pytest.mark.parametrize('sd_of_log', [0.3, 0.6, 1.0])
def test_nine_of_ten_name_a_size_that_is_never_0(sd_of_log: float) -> None:
    # N = 20 000 scores, seed 1; evidence by the integral over the prior; as above
    rng = np.random.default_rng(1)
    prior, information = log_normal(1.0, sd_of_log), 12.0
    trace = np.full((1, 1), math.sqrt(information))
    (amount,) = _named(trace, [prior])
    size = np.exp(sd_of_log * np.linspace(-8.0, 8.0, 4001))
    log_chance = norm.logpdf(np.linspace(-8.0, 8.0, 4001)) + math.log(16.0 / 4000.0)
    score = information * amount + math.sqrt(information) * rng.standard_normal((20_000, 1))
    steps = np.exp(score * size - 0.5 * information * size**2 + log_chance)
    odds = 0.05 * steps.sum(axis=1)
    assert np.mean(odds / (1.0 + odds) >= 0.9) == pytest.approx(0.9, abs=0.04)


def test_a_size_that_is_always_there_has_a_trace_that_is_named_however_small_it_is() -> None:
    traces, still = np.array([[0.1, 0.0], [0.0, 3.0]]), np.array([[8.0, 0.0], [0.0, 0.0]])
    first, second = _named(traces, [log_normal(1.0, 0.6)] * 2, still)
    assert first == 0.0
    assert 0.5 < second < 3.0


def test_what_a_record_says_sharply_is_named_no_sooner_beside_a_look_alike() -> None:
    # of sizes known to a hundredth of their priors, and traces alike but for three sd of noise
    traces = 100.0 * np.array([[1.0, 0.0], [1.0, 0.03]])
    priors = [normal(1.0), normal(1.0)]
    alone, beside = _named(traces[:1], priors[:1])[0], _named(traces, priors)
    assert alone < 0.1
    # apart by 3 A sd: named from about 5 sd
    assert all(1.0 < amount < 3.0 for amount in beside)


def test_no_size_is_named_where_another_has_the_same_trace() -> None:
    traces = 3.0 * np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    first, second, third = _named(traces, [normal(1.0)] * 3)
    assert first == second == math.inf
    assert math.isfinite(third)


def test_a_size_that_is_too_large_for_one_prior_is_the_other() -> None:
    # as fouling beside a locked propeller: one alone reaches where the odds allow its name
    traces = np.array([[12.0], [12.0]])
    seldom, often = _named(traces, [log_normal(0.5, 0.3), log_normal(2.0, 0.3)])
    assert 0.3 < seldom < 1.0
    assert 1.0 < often < 2.5


def test_nine_of_ten_name_a_size_beside_one_that_leaves_a_shape_open() -> None:
    # N = 4000 records of 40 rows, seed 2: the first may have any share of a bend besides
    rng = np.random.default_rng(2)
    rows = np.linspace(0.0, 1.0, 40)
    bend = 3.0 * (rows - 0.5)[None]
    traces = 2.0 * np.array([np.ones(40), 1.0 + 2.0 * rows**2])
    amounts = _named(traces, [normal(1.0)] * 2, more=bend)
    plain = _named(traces, [normal(1.0)] * 2)
    # a rival that can bend leaves the other no name before it is much larger
    assert amounts[1] > 1.3 * plain[1]
    covariances = [np.outer(traces[0], traces[0]) + bend.T @ bend, np.outer(traces[1], traces[1])]
    for e, amount in enumerate(amounts):
        if not math.isfinite(amount):
            continue
        named = 0
        records = amount * traces[e] + rng.standard_normal((4000, 40))
        gain = []
        for covariance in covariances:
            whole = np.eye(40) + covariance
            explained = records @ (np.eye(40) - np.linalg.inv(whole))
            gain.append(0.5 * (np.sum(explained * records, 1) - np.linalg.slogdet(whole)[1]))
        for first, second in zip(*gain, strict=True):
            ways = [
                (('e0',), float(first) + math.log(0.05)),
                (('e1',), float(second) + math.log(0.05)),
            ]
            found = decide(probabilities([(NONE, 0.0), *ways]))
            named += list(found.effects) == [f'e{e}']
        # to first order in the noise
        assert named / 4000 == pytest.approx(0.9, abs=0.07)
