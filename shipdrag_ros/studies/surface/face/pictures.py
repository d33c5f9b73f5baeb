# SPDX-License-Identifier: Apache-2.0
"""Pictures of fits to measured numbers."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter, ScalarFormatter

from shipdrag_ros.regression import Surface
from shipdrag_ros.report.drawing import BLUE, STYLE, VERMILION
from shipdrag_ros.samples import Float64


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


def left_out_picture(error: Float64, leverage: Float64, target: str) -> Figure:
    """
    Draw how far each hull is off when the others predict it.

    Parameters
    ----------
    error, leverage : (n,)
        Of hulls left out, the leverage over the largest of the others.
    target
        What is predicted.
    """
    inside = leverage <= 1.0
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.0), layout='constrained')
        axis = figure.subplots()
        axis.semilogx(leverage[inside], error[inside], '.', color=BLUE, label='within')
        axis.semilogx(
            leverage[~inside], error[~inside], 'x', color=VERMILION, label='beyond the data'
        )
        axis.axvline(1.0, color='#777777', linestyle='--')
        axis.axhline(0.0, color='#777777', linewidth=1.0)
        axis.set_xlabel('leverage over the largest of the other hulls [1]')
        axis.xaxis.set_major_formatter(ScalarFormatter())
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_ylabel(f'{target}, predicted - measured')
        axis.legend()
    return figure
