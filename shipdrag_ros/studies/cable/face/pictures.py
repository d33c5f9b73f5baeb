# SPDX-License-Identifier: Apache-2.0
"""Pictures of a towed cable: its coefficient, and the lines in place of its drag."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shipdrag_ros.report.drawing import BLUE, GREEN, STYLE, VERMILION
from shipdrag_ros.studies.cable.drag import (
    LONGEST,
    SHORTEST,
    Cable,
    CableSurface,
    Tangent,
    drag_coefficient,
    naive_error,
    tangent_error,
    tangent_range,
)

LINES: dict[str, dict[str, Any]] = {
    'C V²': {'color': BLUE, 'linestyle': '-'},
    'C V': {'color': GREEN, 'linestyle': ':'},
    'tangent': {'color': VERMILION, 'linestyle': '--'},
}
SURFACES: dict[CableSurface, dict[str, Any]] = {
    CableSurface.SMOOTH: {'color': BLUE, 'linestyle': '-'},
    CableSurface.ROUGH: {'color': VERMILION, 'linestyle': '--'},
}
RANGE_COLOR = '#eef3f7'
_HIGHEST_U = 2.5


def coefficient_picture(cable: Cable) -> Figure:
    """
    Draw C0 against l/d, with the place of a cable in it.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.4), layout='constrained')
        axis = figure.subplots()
        slenderness = np.geomspace(SHORTEST, LONGEST, 200)
        for surface, style in SURFACES.items():
            axis.semilogx(
                slenderness,
                drag_coefficient(slenderness, surface),
                label=f'{surface} cylinder',
                **style,
            )
        axis.semilogx([cable.slenderness], [cable.c0], 'o', color='#1a1a1a', label='this cable')
        axis.set_xlabel('length over diameter [-]')
        axis.set_ylabel('C0, on length times diameter [-]')
        axis.legend()
    return figure


def tangent_picture(tangent: Tangent, tolerance: float) -> Figure:
    """
    Draw drag and lines over the speed, and below it what the lines err.
    """
    v0 = tangent.speed_m_s
    low, high = tangent_range(tolerance)
    u = np.linspace(0.0, _HIGHEST_U, 251)
    speed = u * v0
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 6.0), layout='constrained')
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        drag = tangent.drag.force_n(speed)
        per_unit = tangent.drag.force_n(np.ones(1))  # C of C V: its force at 1 m/s
        top.plot(speed, drag, label='drag, C V²', **LINES['C V²'])
        top.plot(speed, tangent.force_n(speed), label='tangent at V0', **LINES['tangent'])
        top.plot(speed, per_unit * speed, label='C V', **LINES['C V'])
        top.plot([v0], [tangent.drag_n], 'o', color='#1a1a1a', label=f'V0 = {v0:g} m/s')
        top.set_ylim(-1.1 * tangent.drag_n, 1.05 * float(drag[-1]))
        top.set_ylabel('force [N]')
        moving, its_u = speed[1:], u[1:]
        bottom.plot(moving, 100.0 * tangent_error(its_u), **LINES['tangent'])
        bottom.plot(moving, 100.0 * naive_error(moving), **LINES['C V'])
        bottom.axhline(0.0, color=BLUE, linewidth=1.0)
        bottom.set_ylim(-105.0, 105.0)
        bottom.set_ylabel('error of the lines [%]')
        bottom.set_xlabel('speed [m/s]')
        bottom.set_xlim(0.0, speed[-1])
        for axis in (top, bottom):
            _shade(axis, low * v0, min(high * v0, speed[-1]))
        top.legend(loc='upper left')
    return figure


def _shade(axis: Axes, low: float, high: float) -> None:
    axis.axvspan(low, high, color=RANGE_COLOR, zorder=0, label='where the tangent may be used')
