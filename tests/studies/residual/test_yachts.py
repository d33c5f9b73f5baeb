# SPDX-License-Identifier: Apache-2.0
"""The Delft yacht series: hulls left out, and what the guard makes of them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.studies.residual.fit import FORMS, Hulls, fit_form

FOLDER = os.environ.get('SHIPDRAG_DATA')


@pytest.mark.skipif(FOLDER is None, reason='SHIPDRAG_DATA is not set')
@pytest.mark.parametrize('form', list(FORMS))
def test_what_passes_is_better_than_what_is_refused(form: str) -> None:
    """
    22 hulls up to Fr 0.3, each predicted from the others: the worst errors are refused, and what
    passes lies within 3 sd.
    """
    data = np.loadtxt(Path(str(FOLDER)) / 'yacht_hydrodynamics.data', delimiter='\t', skiprows=1)
    lcb, _, slenderness, b_t, l_b, froude, measured = data[data[:, 5] < 0.301].T
    columns = np.column_stack([l_b, b_t, slenderness, froude, lcb / 100.0])
    hulls = Hulls.of('yachts', ('L_B', 'B_T', 'slenderness', 'Fr', 'lcb'), columns)
    groups = hulls.groups()
    assert groups.max() == 21
    error, sd = np.zeros(len(measured)), np.zeros(len(measured))
    passed = np.zeros(len(measured), bool)
    for group in range(22):
        out = groups == group
        said = fit_form(FORMS[form], hulls.take(~out), measured[~out]).predict(hulls.take(out))
        error[out] = [each.value for each in said] - measured[out]
        sd[out] = [each.sd for each in said]
        passed[out] = [each.inside for each in said]
    assert 10 < passed.sum() < 100
    assert np.sqrt(np.mean(error[passed] ** 2)) < np.sqrt(np.mean(error[~passed] ** 2))
    assert np.abs(error[passed]).max() < 0.5 * np.abs(error[~passed]).max()
    assert np.all(np.abs(error[passed]) < 3.0 * sd[passed])
