# SPDX-License-Identifier: Apache-2.0
"""The page of a residual-resistance regression: its words, its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shipdrag_ros.display import Section
from shipdrag_ros.regression import Prediction
from shipdrag_ros.regression import words as fit_words
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import picture
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.residual.fit import ResidualFit, leave_hulls_out
from shipdrag_ros.studies.residual.words import (
    coefficients,
    domain,
    sentence,
    technical,
    what_it_is,
)
from shipdrag_ros.studies.surface.face import pictures as fit_pictures

_NOTES = 'What these data can and cannot show'


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
        tables.insert(0, ('Predictions', fit_words.predictions(predictions)))
    fitted = values - found.fit.residuals
    pictures = [
        picture(
            fit_pictures.residual_picture(fitted, values, target),
            'What the form leaves of its own data, a dot a row. Good: dots on both sides of the '
            'line everywhere; a bow or a slope shows a term that the form lacks.',
        )
    ]
    error, _, leverage = leave_hulls_out(found.form, found.hulls, values)
    if np.any(np.isfinite(error)):
        pictures.append(
            picture(
                fit_pictures.left_out_picture(error, leverage, target),
                'Each hull predicted from the others, so the error to expect of a new one. To the '
                'right of 1 a hull is more unusual (leverage) than any of the others: there the '
                'form goes beyond its data, and its predictions are marked as not to be used.',
            )
        )
    shown = [
        Section(text=(technical(found), what_it_is(target))),
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
