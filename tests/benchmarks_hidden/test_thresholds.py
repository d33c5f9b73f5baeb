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
