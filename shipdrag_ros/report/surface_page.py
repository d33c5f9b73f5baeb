# SPDX-License-Identifier: Apache-2.0
"""The page of a fitted surface: its words, its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from shipdrag_ros.regression import Prediction, Surface
from shipdrag_ros.report import fit_cells
from shipdrag_ros.report.document import Picture, write_page
from shipdrag_ros.report.pictures import BLUE, STYLE, VERMILION
from shipdrag_ros.samples import Float64


def sentence(surface: Surface, target: str) -> str:
    """
    Say in words what was found.
    """
    rmse = float(np.sqrt(surface.fit.variance))
    return (
        f'{target} is a polynomial of degree {surface.degree} in '
        f'{", ".join(surface.inputs)}: {len(surface.polynomial.powers)} terms, RMSE {rmse:.4g}.'
    )


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
        ('Degrees tried; F and p of the step from the degree before', fit_cells.degrees(surface)),
        ('Coefficients of raw powers', fit_cells.coefficients(surface)),
    ]
    if predictions:
        tables.append(('Predictions', fit_cells.predictions(predictions)))
    pictures = [
        Picture.of(
            degree_picture(surface),
            'Residual standard deviation against the degree; the lowest degree on the plateau '
            'is chosen.',
        ),
        Picture.of(
            residual_picture(surface.polynomial(points), values, target),
            'What the surface leaves of the data.',
        ),
    ]
    if len(surface.inputs) == 2:
        pictures.append(
            Picture.of(contour_picture(surface, points, target), 'The surface; dots are the data.')
        )
    write_page(
        path,
        'fit.html',
        title=f'Surface of {target} over {", ".join(surface.inputs)}',
        source=source,
        sentence=sentence(surface, target),
        notes=surface.notes,
        pictures=pictures,
        tables=tables,
    )


def degree_picture(surface: Surface) -> Figure:
    """
    Draw the residual standard deviation against the degree.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 2.8), layout='constrained')
        axis = figure.subplots()
        axis.plot(surface.degrees, np.sqrt(surface.table.variance), color=BLUE, marker='o')
        if np.all(surface.table.variance > 0.0):
            axis.set_yscale('log')
        axis.axvline(
            surface.degree, color=VERMILION, linestyle='--', label=f'chosen: {surface.degree}'
        )
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        axis.set_xlabel('degree')
        axis.set_ylabel('RMSE')
        axis.legend()
    return figure


def residual_picture(fitted: Float64, measured: Float64, target: str) -> Figure:
    """
    Draw what a fit leaves, against what it says.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 2.8), layout='constrained')
        axis = figure.subplots()
        axis.plot(fitted, measured - fitted, '.', color='#888888', markersize=4, rasterized=True)
        axis.axhline(0.0, color=BLUE, linewidth=1.0)
        axis.set_xlabel(f'{target}, fitted')
        axis.set_ylabel('measured - fitted')
    return figure


def contour_picture(surface: Surface, points: Float64, target: str) -> Figure:
    """
    Draw a surface over two inputs.
    """
    low, high = surface.domain.lower, surface.domain.upper
    x, y = np.meshgrid(np.linspace(low[0], high[0], 61), np.linspace(low[1], high[1], 61))
    value = surface.polynomial(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 4.6), layout='constrained')
        axis = figure.subplots()
        drawn = axis.contourf(x, y, value, levels=16, cmap='cividis')
        figure.colorbar(drawn, label=target)
        axis.plot(points[:, 0], points[:, 1], '.', color='white', markersize=2, rasterized=True)
        axis.set_xlabel(surface.inputs[0])
        axis.set_ylabel(surface.inputs[1])
    return figure
