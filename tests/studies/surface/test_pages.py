# SPDX-License-Identifier: Apache-2.0
"""Pages and tables of fits to measured numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.cli.output import Output, show
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.residual.face import verb as words
from shipdrag_ros.studies.residual.fit import Hulls, ResidualFit, fit_residual
from shipdrag_ros.studies.surface.face import verb as surface_words
from shipdrag_ros.studies.surface.fit import Prediction, Surface, fit_surface

REFUSED = Prediction(1.5, float('inf'), ('x 9 is outside <0..1> of the data',))


def points(variables: int) -> Float64:
    axis = np.linspace(0.0, 1.0, 5)
    return np.stack(np.meshgrid(*[axis] * variables), axis=-1).reshape(-1, variables)


def surface(variables: int) -> tuple[Surface, Float64]:
    at = points(variables)
    values = at.sum(axis=1) ** 3 + 0.01 * np.random.default_rng(1).normal(size=len(at))
    return fit_surface(at, values, inputs=[f'x{i}' for i in range(variables)]), values


@pytest.fixture(scope='module')
def residual() -> tuple[ResidualFit, Float64]:
    rng = np.random.default_rng(2)
    shapes = rng.uniform([6.0, 3.0, 0.8], [9.0, 5.0, 0.87], (20, 3)).repeat(6, axis=0)
    rows = np.column_stack([shapes, np.tile(np.linspace(0.1, 0.2, 6), 20)])
    hulls = Hulls.of('q', ('L_B', 'B_T', 'C_B', 'Fr'), rows)
    values = 10.0 / hulls.slenderness + 30.0 * hulls.Fr**2 + 0.02 * rng.normal(size=120)
    return fit_residual(hulls, values, form='sirotina'), values


def test_cells_of_a_surface() -> None:
    found, _ = surface(2)
    degrees = surface_words.degrees_table(found)
    assert degrees.rows[0][4:] == ('-', '-', '')
    assert [row[0] for row in degrees.rows if row[-1] == 'chosen'] == ['3']
    terms = [row[0] for row in surface_words.coefficients_table(found).rows]
    assert terms[:6] == ['1', 'x0', 'x1', 'x0^2', 'x0 x1', 'x1^2']


def test_cells_of_predictions() -> None:
    rows = surface_words.predictions_table([Prediction(0.25, 0.013, ()), REFUSED]).rows
    assert rows[0] == ('1', '0.25', '0.013', 'yes')
    assert rows[1] == ('2', '1.5', 'open', 'NO: x 9 is outside <0..1> of the data')


@pytest.mark.parametrize('variables', [1, 2, 3])
def test_page_of_a_surface(variables: int, tmp_path: Path) -> None:
    found, values = surface(variables)
    page = tmp_path / 'page.html'
    shown = surface_words.shown(
        found, points(variables), values, [REFUSED], target='c<x>', source='forces.csv'
    )
    show(Output(), shown, page)
    text = page.read_text()
    # a map can be drawn over two inputs alone
    assert text.count('data:image/svg+xml') == (3 if variables == 2 else 2)
    assert f'c&lt;x&gt; is a polynomial of degree {found.degree}' in text
    assert 'outside &lt;0..1&gt; of the data' in text
    assert all(note in text for note in found.notes)


def test_hulls_that_others_leave_open_have_no_picture(residual, tmp_path):
    found, values = residual
    few = np.arange(len(values)) < 36
    nine = fit_residual(found.hulls.take(few), values[few], form='sirotina')
    page = tmp_path / 'page.html'
    shown = words.shown(nine, [], values[few], target='c_R', source='models.csv')
    show(Output(), shown, page)
    text = page.read_text()
    assert text.count('data:image/svg+xml') == 1
    assert 'open' in [row[2] for row in words.coefficients(nine).rows]


def test_pictures_show_the_data() -> None:
    found, values = surface(2)
    degree = surface_words.degree_picture(found).axes[0]
    np.testing.assert_allclose(degree.lines[0].get_ydata(), np.sqrt(found.table.variance))
    rest = surface_words.residual_picture(found.polynomial(points(2)), values, 'c').axes[0]
    np.testing.assert_allclose(rest.lines[0].get_ydata(), found.fit.residuals, atol=1e-12)
    error, leverage = np.array([0.1, -0.2, 0.3]), np.array([0.5, 0.9, 2.0])
    left = surface_words.left_out_picture(error, leverage, 'c').axes[0]
    np.testing.assert_array_equal(left.lines[0].get_ydata(), [0.1, -0.2])
    np.testing.assert_array_equal(left.lines[1].get_ydata(), [0.3])
    contour = surface_words.contour_picture(found, points(2), 'c').axes[0]
    assert contour.get_xlabel() == 'x0'
