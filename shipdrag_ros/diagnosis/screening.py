# SPDX-License-Identifier: Apache-2.0
"""
Which hypotheses are worth a fit, judged by the trace that one effect more would leave.

The trace is that of a likely size; how much of it there is, and how far the
rest of the hypothesis gives way, is linear. So a column a hypothesis is enough,
where a fit takes hundreds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.linear import Hypothesis, Problem
from shipdrag_ros.diagnosis.terms import EffectTerm, Term
from shipdrag_ros.diagnosis.unknowns import Tail, Unknown
from shipdrag_ros.samples import Float64

_TRIAL_Z = 0.5  # of a size that may have either sign, or be 0
_AMOUNT_SD = 0.6  # of a size that is not 0, in parts of the one that is tried


def screening_score(problem: Problem, base: Fit, hypotheses: Sequence[Hypothesis]) -> Float64:
    """
    Return about what log evidence hypotheses with one effect more will reach.

    Parameters
    ----------
    base
        What they add to.
    hypotheses
        Their last term is the effect, from where its fit begins.
    """
    terms: list[tuple[Term, list[float]]] = []
    mean, precision = np.empty(len(hypotheses)), np.empty(len(hypotheses))
    for i, hypothesis in enumerate(hypotheses):
        term = hypothesis.terms[-1]
        assert isinstance(term, EffectTerm)
        first, *others = term.unknowns
        z = first.start or _TRIAL_Z
        mean[i], precision[i] = _amount(first, z)
        terms.append((term, [first.value(z), *(u.value(u.start) for u in others)]))
    traces = np.hstack(problem.responses(base.best, terms))
    tables = np.hstack(base.best.tables)
    matrix, _ = base.best.normal
    across = tables[1:] @ traces.T
    given_way = np.linalg.lstsq(matrix, across, rcond=1e-13)[0]
    own = np.einsum('ai,ai->a', traces, traces) - np.einsum('ia,ia->a', across, given_way)
    own = np.maximum(own, 0.0) + precision
    # at the best fit of the base the residual is as good as square to all that it has
    fall = traces @ tables[0] + precision * mean
    gain = 0.5 * (fall**2 / own - precision * mean**2) - 0.5 * np.log(own / precision)
    weights = np.array([hypothesis.weight for hypothesis in hypotheses])
    found: Float64 = base.log_likelihood + gain + weights
    return found


def _amount(first: Unknown, z: float) -> tuple[float, float]:
    """Return mean and precision of the size, in parts of that at z."""
    if first.tail is Tail.HALF or first.start == 0.0:
        return 0.0, z * z
    return 1.0, 1.0 / _AMOUNT_SD**2
