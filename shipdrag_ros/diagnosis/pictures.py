# SPDX-License-Identifier: Apache-2.0
"""Pictures of a diagnosis: measured against simulated, what is left, how probable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shipdrag_ros.diagnosis.result import Compared, RunTrace
from shipdrag_ros.diagnosis.words import Answer, probability
from shipdrag_ros.display import TRACK_LABELS, speed_unit
from shipdrag_ros.report.drawing import BLUE, SIZE, STYLE, VERMILION

ALONG = ('speed_through_water', 'speed_over_ground', 'position')
_MEASURED: dict[str, Any] = {
    'linestyle': 'none',
    'marker': '.',
    'markersize': 4,
    'color': '#444444',
}
_BEFORE: dict[str, Any] = {'color': VERMILION, 'linestyle': '--'}
_AFTER: dict[str, Any] = {'color': BLUE, 'linestyle': '-'}
_BAND = '#d9e4ee'
_BAND_LABEL = '±2 sd of the noise'
_STEADY_SHOWN_S = 300.0  # before the stop, where the ship only sails on


def motion_pictures(trace: RunTrace, *, after: str, mass_kg: float) -> tuple[Figure, ...]:
    """
    Draw a run as measured and as simulated, over the difference; a picture each quantity.

    Parameters
    ----------
    trace
        The run.
    after
        What the better model has, for the legend.
    mass_kg
        Of the ship: speeds are in knots, those of a model in m/s.
    """
    figures = []
    for compared in trace.compared:
        if compared.quantity not in ALONG:
            continue
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(SIZE[0], 4.6), layout='constrained')
            top, bottom = figure.subplots(2, 1, sharex=False, height_ratios=(3, 2))
            label, unit = TRACK_LABELS[compared.quantity]
            scale = speed_unit(mass_kg) if unit == 'm/s' else (1.0, unit)
            _draw_motion(top, compared, after, scale)
            draw_difference(bottom, compared, scale)
            top.set_title(label, loc='left', fontsize=10)
            _legend(figure, top, bottom)
        figures.append(figure)
    return tuple(figures)


def _draw_motion(axis: Axes, compared: Compared, after: str, scale: tuple[float, str]) -> None:
    part = compared.time_s >= -_STEADY_SHOWN_S
    minutes = compared.time_s[part] / 60.0
    start = 0.0
    if compared.quantity == 'position':  # distances count from where the engine stopped
        start = float(np.interp(0.0, compared.time_s, compared.measured))
    for values, label, style in (
        (compared.measured, 'measured', _MEASURED),
        (compared.before, 'model as stated', _BEFORE),
        (compared.after, after, _AFTER),
    ):
        axis.plot(minutes, (values[part] - start) / scale[0], label=label, **style)
    axis.set_ylabel(f'[{scale[1]}]')
    axis.axvline(0.0, color='#777777', linewidth=0.8)


def draw_difference(
    axis: Axes,
    compared: Compared,
    scale: tuple[float, str],
    *,
    labels: tuple[str, str] = ('', ''),
) -> None:
    """
    Draw measured less model on axes, over the band of the noise.

    Parameters
    ----------
    axis
    compared
        What was measured, and both models.
    scale
        SI units in what is shown, and its name.
    labels
        Of the model before and after; empty ones stand in no legend.
    """
    minutes = compared.time_s / 60.0
    spread = 2.0 * compared.sd / scale[0]
    axis.fill_between(minutes, -spread, spread, color=_BAND, linewidth=0, label=_BAND_LABEL)
    for values, label, style in (
        (compared.before, labels[0], _BEFORE),
        (compared.after, labels[1], _AFTER),
    ):
        axis.plot(minutes, (compared.measured - values) / scale[0], label=label or None, **style)
    axis.axvline(0.0, color='#777777', linewidth=0.8)
    axis.set_title('measured - model', loc='left', fontsize=9)
    axis.set_ylabel(f'[{scale[1]}]')
    axis.set_xlabel('minutes after the engine stop')


def _legend(figure: Figure, *axes: Axes) -> None:
    """Explain all panels at once, above them."""
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= {label: handle for handle, label in zip(*axis.get_legend_handles_labels())}
    figure.legend(list(handles.values()), list(handles), loc='outside upper left', ncols=2)


def residual_pictures(
    traces: Sequence[RunTrace], *, after: str, mass_kg: float
) -> tuple[Figure, ...]:
    """
    Draw what each model leaves, in units of the noise, by time and by speed.

    Parameters
    ----------
    traces
        All runs together; a picture each quantity.
    after
        What the better model has, for the legend.
    mass_kg
        Of the ship: speeds are in knots, those of a model in m/s.
    """
    unit, unit_name = speed_unit(mass_kg)
    quantities = dict.fromkeys(each.quantity for trace in traces for each in trace.compared)
    figures = []
    for quantity in quantities:
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(SIZE[0], 4.6), layout='constrained')
            axes = figure.subplots(2, 1, sharey=True)
            parts = [
                each for trace in traces for each in trace.compared if each.quantity == quantity
            ]
            _draw_residuals(axes, parts, after, unit)
            for axis, of in zip(axes, ('by time', 'by speed, after the stop')):
                axis.axhspan(-2.0, 2.0, color=_BAND, linewidth=0, zorder=0, label=_BAND_LABEL)
                axis.set_title(f'{TRACK_LABELS[quantity][0]}, {of}', loc='left', fontsize=9)
                axis.set_ylabel('sd of the noise')
            axes[0].set_xlabel('minutes after the engine stop')
            axes[1].set_xlabel(f'speed through water [{unit_name}]')
            _legend(figure, axes[0])
        figures.append(figure)
    return tuple(figures)


def _draw_residuals(
    axes: Sequence[Axes], parts: Sequence[Compared], after: str, unit: float
) -> None:
    by_time, by_speed = axes
    time_s = np.concatenate([part.time_s for part in parts])
    speed = np.concatenate([part.speed_m_s for part in parts]) / unit
    dots: dict[str, Any] = {'linestyle': 'none', 'markersize': 3}
    for label, color, marker, values in (
        ('model as stated', VERMILION, 'x', [part.white_before for part in parts]),
        (after, BLUE, 'o', [part.white_after for part in parts]),
    ):
        white = np.concatenate(values)
        by_time.plot(time_s / 60.0, white, color=color, marker=marker, label=label, **dots)
        coasting = time_s >= 0.0
        by_speed.plot(speed[coasting], white[coasting], color=color, marker=marker, **dots)


def probability_picture(answers: Sequence[Answer]) -> Figure:
    """
    Draw how probable each answer is, as bars, the first on top.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 0.5 + 0.32 * len(answers)), layout='constrained')
        axis = figure.subplots()
        places = np.arange(len(answers))[::-1]
        shares = [each.probability for each in answers]
        colors = [BLUE if share == max(shares) else '#9db8cc' for share in shares]
        axis.barh(places, shares, color=colors, height=0.65)
        for place, share in zip(places, shares):
            axis.text(share + 0.01, place, probability(share), va='center')
        axis.set_yticks(places, [each.words for each in answers])
        axis.set_xlim(0.0, 1.15)
        axis.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0], ['0', '25 %', '50 %', '75 %', '100 %'])
        axis.grid(visible=False, axis='y')
        axis.spines['left'].set_visible(False)
        axis.tick_params(axis='y', length=0)
    return figure
