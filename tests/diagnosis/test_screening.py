# SPDX-License-Identifier: Apache-2.0
"""What a column promises is about what a fit finds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.fitting import fit
from shipdrag_ros.diagnosis.model import start
from shipdrag_ros.diagnosis.search import screening_score


@pytest.mark.parametrize('hidden', ['current=0.3', 'fouling=0.3', 'turning=25', 'log_lag=20'])
def test_what_is_hidden_promises_most_and_keeps_it(
    hidden: str, model_of: Callable[..., CoastModel]
) -> None:
    model = model_of(hidden)
    nothing = fit(model, [model.nothing], [start(model, model.nothing)])[0]
    hypotheses = [h for e in model.effects for h in model.with_effect(model.nothing, e)]
    promised = screening_score(model, nothing, hypotheses)
    order = np.argsort(-promised)
    best = list(dict.fromkeys(hypotheses[i].names for i in order))
    # look-alikes may promise as much
    assert (hidden.partition('=')[0],) in best[:6]
    first = hypotheses[order[0]]
    found = fit(model, [first], [start(model, first, nothing.best)])[0]
    gained = found.log_evidence - nothing.log_evidence
    assert 0.3 * gained < promised[order[0]] - nothing.log_evidence < 3.0 * gained


def test_where_nothing_is_hidden_nothing_is_promised(
    model_of: Callable[..., CoastModel],
) -> None:
    model = model_of()
    nothing = fit(model, [model.nothing], [start(model, model.nothing)])[0]
    hypotheses = [h for e in model.effects for h in model.with_effect(model.nothing, e)]
    promised = screening_score(model, nothing, hypotheses)
    assert np.all(promised < nothing.log_evidence)
