# SPDX-License-Identifier: Apache-2.0
"""What is fitted, and what is not."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.search import search, with_pairs
from shipdrag_ros.simulation.effects import find


def test_pairs_are_of_what_can_be_there_together(model_of: Callable[..., CoastModel]) -> None:
    found = with_pairs(search(model_of('locked_propeller=0.4')))
    pairs = {one.hypothesis.names for one in found.fits if len(one.hypothesis.names) == 2}
    assert len(pairs) >= 3
    assert all(find(a).goes_with(find(b)) for pair in pairs for a, b in combinations(pair, 2))
    assert not any(set(pair) in found.model.inseparable for pair in pairs)


def test_where_nothing_is_missing_no_pair_is_fitted(model_of: Callable[..., CoastModel]) -> None:
    found = search(model_of())
    assert with_pairs(found) is found
    assert found.best is found.nothing
