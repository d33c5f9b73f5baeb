# SPDX-License-Identifier: Apache-2.0
"""The published forms, term by term."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.studies.residual.fit import FORMS, Hulls, RegressionForm


def hull() -> Hulls:
    names = ('L_B', 'B_T', 'C_B', 'lcb', 'Fr')
    return Hulls.of('one', names, np.array([[8.0, 4.5, 0.85, 0.01, 0.13]]))


def test_sakhnovsky() -> None:
    x1, x2, x3, x4, x5 = 8.0, 4.5, 0.85, 0.13, 0.01
    x6 = (8.0**2 * 4.5 / 0.85) ** (1 / 3)
    expected = [
        1.0, x1, x2 * x3, x3, x4, x5, x1 * x1, x2**2 * x3**2 * x5**2, x3**2 * x6**2,
        x4**2, x5**2, x6, x6**2, x3 * x4, x2**2 * x6**2,
    ]  # fmt: skip
    form = FORMS['sakhnovsky']
    np.testing.assert_allclose(form.columns(hull())[0], expected, rtol=1e-13)
    assert form.needs_lcb
    assert form.froude_max == 0.14


def test_sirotina() -> None:
    # Fr_V = v / sqrt(g V^(1/3)), here of a ship of 100 m
    slenderness = (8.0**2 * 4.5 / 0.85) ** (1 / 3)
    speed = 0.13 * np.sqrt(9.81 * 100.0)
    x1 = speed / np.sqrt(9.81 * 100.0 / slenderness)
    x2, x3, x4 = 8.0 - 7.88, 2.0 * (4.5 - 4.21), 10.0 * (0.85 - 0.819)
    expected = [
        1.0, x1, x2, x3, x4, x1 * x1, x1 * x2, x1 * x3, x1 * x4, x2 * x2, x2 * x3, x2 * x4,
        x3 * x3, x3 * x4, x4 * x4,
    ]  # fmt: skip
    form = FORMS['sirotina']
    np.testing.assert_allclose(form.columns(hull())[0], expected, rtol=1e-12)
    assert not form.needs_lcb
    np.testing.assert_array_equal(form.place(hull()), [[8.0, 4.5, 0.85, 0.13]])


@pytest.mark.parametrize('form', FORMS.values(), ids=lambda form: form.name)
def test_terms_in_words_are_the_columns(form: RegressionForm) -> None:
    values = {'L_B': 6.5, 'B_T': 3.1, 'C_B': 0.7, 'Fr': 0.13, 'lcb': 0.02, 'psi': 5.6}
    one = {name: np.array([value]) for name, value in values.items()}
    hulls = Hulls(one['L_B'], one['B_T'], one['C_B'], one['psi'], one['Fr'], one['lcb'])
    known = {**values, 'Fr_V': values['Fr'] * values['psi'] ** 0.5}

    def worth(term: str) -> float:
        text = term.replace('L/B', 'L_B').replace('B/T', 'B_T').replace(' - ', '-')
        return float(eval(text.replace(' ', '*').replace('²', '**2'), {}, known))

    np.testing.assert_allclose([worth(term) for term in form.terms], form.columns(hulls)[0])
