# SPDX-License-Identifier: Apache-2.0
"""The probability that a measurement decides, against cases that are solved on paper."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtr

from shipdrag_ros.diagnosis.advice import PredictedOutcome, probability_of_naming
from shipdrag_ros.inference.decision import CERTAIN
from shipdrag_ros.inference.decision import WeighedHypothesis as Rival

DRAWN = 0.06  # twice the sd of a share of 300 draws
NOTHING = Rival((), -60.0, 0.0)
HULL, WIND, CABLE = ('fouling',), ('wind',), ('towed_cable',)


def prospect(mean: list[float], *, sd: float = 0.0) -> PredictedOutcome:
    """Rows with a mean that is uncertain in the first of them."""
    slope = np.zeros((1, len(mean)))
    slope[0, 0] = sd
    return PredictedOutcome(np.array(mean), slope, np.eye(1), np.eye(1))


def rivals(share: dict[tuple[str, ...], float]) -> list[Rival]:
    return [*(Rival(names, math.log(p), 0.0) for names, p in share.items()), NOTHING]


def resolved(prospects: list[PredictedOutcome], found: list[Rival]) -> float:
    """With one way in which the measurement is read; nothing predicts what the first does."""
    outcomes = [*prospects, prospects[0]]
    return probability_of_naming([outcomes], [0] * len(outcomes), found, inseparable=())


@pytest.mark.parametrize('apart', [0.0, 1.0, 3.0, 6.0])
@pytest.mark.parametrize('first', [0.5, 0.8])
def test_two_known_means(apart: float, first: float) -> None:
    both = [prospect([0.0, 0.0]), prospect([0.0, apart])]
    found = resolved(both, rivals({HULL: first, WIND: 1.0 - first}))
    expected = 0.0
    for share in (first, 1.0 - first) if apart > 0.0 else ():
        # ln of the odds of what is true is normal, mean D/2 and variance D about what it was
        mean = 0.5 * apart**2 + math.log(share / (1.0 - share))
        needed = math.log(CERTAIN / (1.0 - CERTAIN))
        right, wrong = ndtr((mean - needed) / apart), ndtr((-mean - needed) / apart)
        expected += share * float(right + wrong)
    assert found == pytest.approx(expected, abs=DRAWN)


def test_what_is_open_in_both_tells_nothing_apart() -> None:
    alike = rivals({HULL: 0.5, WIND: 0.5})
    assert resolved([prospect([0.0]), prospect([6.0])], alike) > 0.95
    assert resolved([prospect([0.0], sd=50.0), prospect([6.0], sd=50.0)], alike) == 0.0


def test_each_truth_is_read_in_its_own_way() -> None:
    alike = [prospect([0.0]), prospect([0.0]), prospect([0.0])]
    apart = [prospect([0.0]), prospect([9.0]), prospect([0.0])]
    found = probability_of_naming(
        [alike, apart], [0, 1, 0], rivals({HULL: 0.5, WIND: 0.5}), inseparable=()
    )
    assert found == pytest.approx(0.5, abs=0.01)


def test_third_rival_that_is_not_told_apart_keeps_a_set() -> None:
    three = [prospect([0.0]), prospect([8.0]), prospect([8.0])]
    found = resolved(three, rivals({HULL: 0.4, WIND: 0.3, CABLE: 0.3}))
    assert found == pytest.approx(0.4, abs=0.02)


def test_what_no_record_tells_apart_is_never_named() -> None:
    both = [prospect([0.0]), prospect([9.0]), prospect([0.0])]
    inseparable = [frozenset((WIND[0], 'waves'))]
    share = rivals({HULL: 0.3, WIND: 0.7})
    found = probability_of_naming([both], [0, 0, 0], share, inseparable=inseparable)
    assert found == pytest.approx(0.3, abs=0.02)


def test_a_name_that_every_rival_holds_is_named_already() -> None:
    alone, pair = Rival(HULL, math.log(0.6), 0.0), Rival(('fouling', 'wind'), math.log(0.4), 0.0)
    same = [prospect([0.0]), prospect([0.0]), prospect([0.0])]
    assert probability_of_naming([same], [0, 0, 0], [alone, pair, NOTHING], inseparable=()) == 1.0
