# SPDX-License-Identifier: Apache-2.0
"""Pictures of a trend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shipdrag_ros.display import M_S_PER_KNOT, Picture, force_unit
from shipdrag_ros.report.drawing import BLUE, ORANGE, STYLE, VERMILION, picture
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.trend.ship_trend import ShipTrend

_SIZE = (9.0, 3.6)


def added_resistance(trend: ShipTrend) -> Picture:
    """
    Draw the added resistance of one ship against time.

    Parameters
    ----------
    trend
        With a curve.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=_SIZE, layout='constrained')
        draw_added_resistance(figure.add_subplot(), trend)
    return picture(
        figure,
        'Each point is a coastdown. Where the line rises, the hull fouls; where it drops at a '
        'vertical line, something was taken off it: solid, by the log book; dashed, found here.',
    )


def draw_added_resistance(axes: Axes, trend: ShipTrend) -> None:
    """
    Draw on axes what `added_resistance` shows.
    """
    assert trend.curve is not None
    days = _days(trend.curve.time_ns)
    value, sd = 100.0 * trend.curve.value, 100.0 * trend.curve.sd
    axes.fill_between(days, value - 2.0 * sd, value + 2.0 * sd, color=BLUE, alpha=0.2, lw=0)
    axes.plot(days, value, color=BLUE, label='hull, with its band of two sd')
    # the date of a wrong clock would stretch the axis over decades
    first, last = trend.curve.time_ns[[0, -1]]
    drawn = [each for each in trend.points if np.isfinite(each.value)]
    shown = [each for each in drawn if each.used or first <= each.time_ns <= last]
    for used, colour, marker, label in (
        (True, '#333333', 'o', 'a coastdown, one sd'),
        (False, VERMILION, 'x', 'outlier, or not used'),
    ):
        points = [each for each in shown if each.used is used]
        if points:
            axes.errorbar(
                _days(np.array([each.time_ns for each in points])),
                [100.0 * each.value for each in points],
                yerr=[100.0 * each.sd_repeatable for each in points],
                fmt=marker,
                ms=4,
                lw=0.8,
                color=colour,
                label=label,
            )
    for event in trend.events:
        day = float(_days(np.array([event.time_ns]))[0])
        axes.axvline(day, color=ORANGE, ls='-' if event.known else '--', lw=1.2)
        text = event.kind.replace('_', ' ') if event.known else 'step found'
        axes.annotate(
            text,
            (day, 1.0),
            xycoords=('data', 'axes fraction'),
            rotation=90,
            va='top',
            ha='right',
            fontsize=8,
        )
    axes.axhline(0.0, color='#333333', lw=0.8)
    axes.set_ylabel('resistance over the clean hull [%]')
    beyond = len(drawn) - len(shown)
    axes.set_xlabel(
        f'date (UTC); {beyond} run(s) of another time are in the list alone'
        if beyond
        else 'date (UTC)'
    )
    axes.xaxis_date()
    axes.legend(loc='upper left')


def coastdown_curve(row: Mapping[str, Any], known: Int64, mass_kg: float) -> Picture:
    """
    Draw the resistance of one coastdown over that of the clean hull.

    Parameters
    ----------
    row
        Of the store's `coastdowns`.
    known
        Places of its grid where r is known.
    mass_kg
        Of the ship.
    """
    unit, name = force_unit(mass_kg)
    with rc_context(STYLE):
        figure = Figure(figsize=_SIZE, layout='constrained')
        axes = figure.add_subplot()
        knots = np.asarray(row['speed_m_s'], dtype=float) / M_S_PER_KNOT
        force = mass_kg / unit * np.asarray(row['resistance_m_s2'], dtype=float)
        spread = 2.0 * mass_kg / unit * np.asarray(row['sigma_m_s2'], dtype=float)
        axes.fill_between(
            knots[known],
            (force - spread)[known],
            (force + spread)[known],
            color=BLUE,
            alpha=0.2,
            lw=0,
            label='±2 standard deviations',
        )
        axes.plot(knots[known], force[known], color=BLUE, label='this run')
        if row['clean_m_s2'] is not None:
            clean = mass_kg / unit * np.asarray(row['clean_m_s2'], dtype=float)
            axes.plot(knots[known], clean[known], color=VERMILION, ls='--', label='clean hull')
        axes.set_xlabel('speed through water [knots]')
        axes.set_ylabel(f'resistance [{name}]')
        axes.set_ylim(bottom=0.0)
        axes.legend(loc='upper left')
    return picture(
        figure,
        'Resistance of this run over that of the clean hull. Where the band lies above the dashed '
        'line, she needed more than clean.',
    )


def _days(time_ns: Int64) -> Float64:
    """Return days since 1970, in which matplotlib counts dates."""
    return np.asarray(time_ns / 86_400e9)
