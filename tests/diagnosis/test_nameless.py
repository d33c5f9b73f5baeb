# SPDX-License-Identifier: Apache-2.0
"""A drag that comes and goes is a turn where the course shows it, and else has no name."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.fitting import fit
from shipdrag_ros.diagnosis.model import start
from shipdrag_ros.diagnosis.nameless import with_nameless
from shipdrag_ros.diagnosis.search import SearchResult
from shipdrag_ros.simulation.effects import find

EFFECT = find('turning')


def found_in(model: CoastModel) -> SearchResult:
    """Return the fits of nothing, and of a turn from starts near the truth."""
    near = [
        one
        for one in model.with_effect(model.nothing, EFFECT)
        if 150.0 < one.terms[-1].unknowns[1].prior.at(one.terms[-1].starts[1]) < 350.0
        and one.terms[-1].starts[0] > 0.0
    ]
    tried = [model.nothing, *near]
    nothing, *turns = fit(model, tried, [start(model, one) for one in tried])
    return SearchResult(model, nothing, (nothing, *turns))


@pytest.mark.parametrize(('rate_rad_s', 'is_turn'), [(0.0, False), (0.002, True)])
def test_a_drag_for_a_while_is_a_turn_only_where_she_turns(
    model_of: Callable[..., CoastModel], rate_rad_s: float, is_turn: bool
) -> None:
    model = model_of(f'turning=20,start_s=250,duration_s=200,rate_rad_s={rate_rad_s}')
    found = found_in(model)
    assert found.best.hypothesis.names == (EFFECT.name,)
    posterior = with_nameless(found, model).posterior
    assert (posterior.probability[EFFECT.name,] > 0.99) is is_turn
    assert (posterior.unnamed > 0.1) is not is_turn


def test_nothing_missing_stays_as_it_is(model_of: Callable[..., CoastModel]) -> None:
    model = model_of()
    nothing = fit(model, [model.nothing], [start(model, model.nothing)])[0]
    found = SearchResult(model, nothing, (nothing,))
    assert with_nameless(found, model) is found


def test_what_may_be_at_any_time_is_looked_for_within_the_run(
    model_of: Callable[..., CoastModel],
) -> None:
    model = model_of()
    begun = {
        term.unknowns[1].prior.at(term.starts[1])
        for (*_, term) in (one.terms for one in model.with_effect(model.nothing, EFFECT))
    }
    (seen,) = model.seen
    assert len(begun) == 7
    assert 0.0 < min(begun) < 0.1 * seen.duration_s
    assert 0.7 * seen.duration_s < max(begun) < seen.duration_s
