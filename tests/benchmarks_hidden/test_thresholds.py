# SPDX-License-Identifier: Apache-2.0
"""Thresholds chosen on answers: what counts as named, and how many answers are too few."""

from __future__ import annotations

from typing import Any

import pytest


def trial(verdict: str, truth: str, *candidates: tuple[str, float]) -> Any:
    """Return a case with its answer."""
    from hidden import cases, scoring

    names = (truth,) if truth else ()
    kind = 'one' if truth else 'none'
    listed = tuple(((name,), p) for name, p in candidates)
    named = listed[0][0] if verdict == 'named' else ()
    return scoring.Trial(
        cases.Truth(kind, 1, names, {}, cases.CONDITIONS[0]),
        scoring.Answer(verdict, named, listed, {}, (), None),
        1.0,
    )


def test_the_lowest_threshold_that_is_safe_is_chosen() -> None:
    import thresholds

    right = [trial('named', 'wind', ('wind', 0.97)) for _ in range(120)]
    wrong = [trial('one_of', 'current', ('wind', 0.65), ('current', 0.34)) for _ in range(30)]
    assert thresholds.name_threshold([*right, *wrong], risk=0.02) == 0.7
    assert thresholds.name_threshold(right, risk=0.02) == 0.5
    # 40 right ones do not show that 98 % are
    assert thresholds.name_threshold(right[:40], risk=0.02) is None
    assert thresholds.named_from(wrong, 0.6).count == 0
    assert thresholds.named_from(wrong, 0.6).of == 30


def test_confounders_that_nothing_tells_apart_are_never_named() -> None:
    import thresholds

    one = trial('one_of', 'displacement', ('added_mass', 0.95), ('displacement', 0.05))
    assert thresholds.named_from([one], 0.5).of == 0


def test_a_set_must_hold_as_much_as_the_truth_needs() -> None:
    import thresholds

    first = [trial('one_of', 'wind', ('wind', 0.6), ('current', 0.39)) for _ in range(90)]
    second = [trial('one_of', 'current', ('wind', 0.6), ('current', 0.39)) for _ in range(10)]
    never = [trial('one_of', 'waves', ('wind', 0.6), ('current', 0.39)) for _ in range(10)]
    assert thresholds.set_share(first, part=0.95) == 0.0
    assert thresholds.set_share([*first, *second], part=0.95) == pytest.approx(0.6, abs=0.01)
    assert thresholds.set_share([*first, *never], part=0.95) == 1.0
    assert thresholds.set_share(first[:10], part=0.95) is None
    assert thresholds.held([*first, *never]).count == 90


def test_a_limit_is_sure_where_the_binomial_bound_is_below_the_risk() -> None:
    import thresholds
    from hidden.scoring import Share

    # 0.98^114 is the first power below 0.1
    assert thresholds.needed(0, risk=0.02, confidence=0.9) == 114
    assert thresholds.needed(2, risk=0.02, confidence=0.9) == 265
    for count, of in ((114, 114), (263, 265)):
        assert thresholds.wrong_at_most(Share(count, of), confidence=0.9) <= 0.02
        assert thresholds.wrong_at_most(Share(count - 1, of - 1), confidence=0.9) > 0.02
    assert thresholds.wrong_at_most(Share(0, 3), confidence=0.9) == 1.0


def test_the_loosest_limit_is_taken_before_the_first_that_fails() -> None:
    import thresholds
    from hidden.scoring import Share

    sure, unsure = Share(120, 120), Share(150, 160)
    limits = {0.8: sure, 0.9: unsure, 0.95: sure, 0.99: sure}
    assert thresholds.sure_limit(limits, risk=0.02, confidence=0.9) == 0.95
    assert thresholds.sure_limit({**limits, 0.999: unsure}, risk=0.02, confidence=0.9) is None


def test_what_is_sure_is_printed_with_what_would_be_needed(capsys) -> None:
    import thresholds

    right = [trial('named', 'wind', ('wind', 0.97)) for _ in range(47)]
    done = right + [trial('one_of', 'current', ('wind', 0.6), ('current', 0.39))] * 45
    thresholds.print_sure(done, risk=0.02, part=0.95, confidence=0.9)
    assert capsys.readouterr().out.splitlines() == [
        'with 90% confidence on a: names from nowhere (too few answers, or too many wrong)',
        '  names from 0.9, in use: wrong 0 of 47, at most 4.8%',
        '  2% needs 114 without a wrong one, 114 with 0',
        'with 90% confidence on a: sets of 0.700',
        '  sets of 0.99, in use: wrong 0 of 45, at most 5.0%',
        '  5% needs 45 without a wrong one, 45 with 0',
    ]
