# SPDX-License-Identifier: Apache-2.0
"""The page of a residual-resistance regression: its words, its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shipdrag_ros.display import Section, Table
from shipdrag_ros.regression import Prediction
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import picture
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.residual.fit import ResidualFit, leave_hulls_out
from shipdrag_ros.studies.surface.face import cells as fit_cells
from shipdrag_ros.studies.surface.face import pictures as fit_pictures

_NOTES = 'What these data can and cannot show'


def sentence(found: ResidualFit, target: str, predictions: Sequence[Prediction]) -> str:
    """
    Say in words what was found.
    """
    said = (
        f'{target} after {found.form.name.capitalize()}, {found.count} hulls, '
        f'{len(found.hulls)} rows: F = {found.criterion:.4g}, rank {found.fit.rank} of '
        f'{len(found.fit.coefficients)}, condition {found.fit.condition:.2g}.'
    )
    if np.isfinite(found.left_out):
        said += f' Hulls that are left out are missed by {np.sqrt(found.left_out):.2g} (rms).'
    if predictions:
        used = sum(each.inside for each in predictions)
        said += f' Of {len(predictions)} predictions {used} may be used.'
    return said


def coefficients(found: ResidualFit) -> Table:
    """
    Show the coefficients of the form.
    """
    return Table(
        ('', 'value', 'sd'),
        tuple(
            (f'b{i}', f'{value:.5g}', f'{sd:.2g}' if np.isfinite(sd) else 'open')
            for i, (value, sd) in enumerate(zip(found.fit.coefficients, found.coefficient_sd))
        ),
    )


def domain(found: ResidualFit) -> Table:
    """
    Show the ranges of the data.
    """
    return Table(
        ('', 'from', 'to'),
        tuple(
            (name, f'{low:.4g}', f'{high:.4g}')
            for name, (low, high) in found.domain.ranges.items()
        ),
    )


def write_residual(
    path: Path,
    found: ResidualFit,
    *,
    source: str,
    target: str,
    values: Float64,
    predictions: Sequence[Prediction],
) -> None:
    """
    Write a regression as one HTML file.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    found
        The fit.
    source, target
        Where the data come from, and what was measured.
    values : (n,)
        Measured.
    predictions
        Asked for besides; may be empty.
    """
    tables = [
        ('Coefficients of the form', coefficients(found)),
        ('Ranges of the data; outside their convex hull nothing is to be used', domain(found)),
    ]
    if predictions:
        tables.insert(0, ('Predictions', fit_cells.predictions(predictions)))
    fitted = values - found.fit.residuals
    pictures = [
        picture(
            fit_pictures.residual_picture(fitted, values, target),
            'What the form leaves of its own data.',
        )
    ]
    error, _, leverage = leave_hulls_out(found.form, found.hulls, values)
    if np.any(np.isfinite(error)):
        pictures.append(
            picture(
                fit_pictures.left_out_picture(error, leverage, target),
                'Each hull foretold from the others: the error to expect of a new one, within '
                'the leverages of the data and beyond.',
            )
        )
    shown = [
        Section(_NOTES if found.notes else '', lines=found.notes),
        Section(pictures=pictures, tables=tables),
    ]
    write_page(
        path,
        f'{target} by ratios of the hull',
        shown,
        source=source,
        sentence=sentence(found, target, predictions),
    )
