# SPDX-License-Identifier: Apache-2.0
"""The page of a fitted surface."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shipdrag_ros.display import Section
from shipdrag_ros.regression import Prediction, Surface
from shipdrag_ros.regression import words as fit_words
from shipdrag_ros.report.document import write_page
from shipdrag_ros.report.drawing import picture
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.surface.face import pictures as fit_pictures

_NOTES = 'What these data can and cannot show'


def write_surface(
    path: Path,
    surface: Surface,
    *,
    source: str,
    target: str,
    points: Float64,
    values: Float64,
    predictions: Sequence[Prediction],
) -> None:
    """
    Write a surface as one HTML file.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    surface
        The fit.
    source, target
        Where the data come from, and what was measured.
    points : (n, d)
        Data.
    values : (n,)
        Data.
    predictions
        Asked for besides; may be empty.
    """
    tables = [
        ('Degrees tried; F and p of the step from the degree before', fit_words.degrees(surface)),
        ('Coefficients of raw powers', fit_words.coefficients(surface)),
    ]
    if predictions:
        tables.append(('Predictions', fit_words.predictions(predictions)))
    pictures = [
        picture(
            fit_pictures.degree_picture(surface),
            'Residual standard deviation against the degree; the lowest degree on the plateau '
            'is chosen.',
        ),
        picture(
            fit_pictures.residual_picture(surface.polynomial(points), values, target),
            'What the surface leaves of the data.',
        ),
    ]
    if len(surface.inputs) == 2:
        pictures.append(
            picture(
                fit_pictures.contour_picture(surface, points, target),
                'The surface; dots are the data.',
            )
        )
    shown = [
        Section(
            'What these data can and cannot show' if surface.notes else '', lines=surface.notes
        ),
        Section(pictures=pictures, tables=tables),
    ]
    write_page(
        path,
        f'Surface of {target} over {", ".join(surface.inputs)}',
        shown,
        source=source,
        sentence=fit_words.sentence(surface, target),
    )
