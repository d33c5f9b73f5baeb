# SPDX-License-Identifier: Apache-2.0
"""Pictures of a diagnosis: measured against simulated, what is left, how probable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shipdrag_ros.diagnosis import Compared, Trace
from shipdrag_ros.diagnosis.words import Answer, probability
from shipdrag_ros.display import TRACK_LABELS
from shipdrag_ros.report.drawing import BLUE, STYLE, VERMILION

_ALONG = ('speed_through_water', 'speed_over_ground', 'position')
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


def motion_picture(trace: Trace, *, after: str) -> Figure:
    """
    Draw a run as measured and as simulated, over the difference.

    Parameters
    ----------
    trace
        The run.
    after
        What the better model has, for the legend.
    """
    shown = [each for each in trace.compared if each.quantity in _ALONG]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 5.0), layout='constrained')
        axes = figure.subplots(2, len(shown), squeeze=False, height_ratios=(3, 2))
        for column, compared in enumerate(shown):
            _draw_motion(axes[0, column], compared, after)
            _draw_difference(axes[1, column], compared)
        _legend(figure, axes[0, 0], axes[1, 0])
    return figure


def _draw_motion(axis: Axes, compared: Compared, after: str) -> None:
    label, unit = TRACK_LABELS[compared.quantity]
    part = compared.time_s >= -_STEADY_SHOWN_S
    minutes = compared.time_s[part] / 60.0
    start = 0.0
    if compared.quantity == 'position':  # distances count from where the engine stopped
        start = float(np.interp(0.0, compared.time_s, compared.measured))
    axis.plot(minutes, compared.measured[part] - start, label='measured', **_MEASURED)
    axis.plot(minutes, compared.before[part] - start, label='model as stated', **_BEFORE)
    axis.plot(minutes, compared.after[part] - start, label=after, **_AFTER)
    axis.set_title(label, loc='left', fontsize=10)
    axis.set_ylabel(unit)
    axis.axvline(0.0, color='#777777', linewidth=0.8)


def _draw_difference(axis: Axes, compared: Compared) -> None:
    minutes = compared.time_s / 60.0
    spread = 2.0 * compared.sd
    axis.fill_between(minutes, -spread, spread, color=_BAND, linewidth=0, label=_BAND_LABEL)
    axis.plot(minutes, compared.measured - compared.before, **_BEFORE)
    axis.plot(minutes, compared.measured - compared.after, **_AFTER)
    axis.axvline(0.0, color='#777777', linewidth=0.8)
    axis.set_title('measured - model', loc='left', fontsize=9)
    axis.set_ylabel(TRACK_LABELS[compared.quantity][1])
    axis.set_xlabel('minutes after the engine stop')


def _legend(figure: Figure, *axes: Axes) -> None:
    """Explain all panels at once, above them."""
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= {label: handle for handle, label in zip(*axis.get_legend_handles_labels())}
    figure.legend(
        list(handles.values()), list(handles), loc='outside upper center', ncols=len(handles)
    )


def residual_picture(traces: Sequence[Trace], *, after: str) -> Figure:
    """
    Draw what each model leaves, in units of the noise, by time and by speed.

    All runs together, one row a quantity.
    """
    quantities = list(dict.fromkeys(each.quantity for trace in traces for each in trace.compared))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 0.6 + 1.7 * len(quantities)), layout='constrained')
        axes = figure.subplots(len(quantities), 2, squeeze=False, sharey='row')
        for row, quantity in zip(axes, quantities):
            parts = [
                each for trace in traces for each in trace.compared if each.quantity == quantity
            ]
            _draw_residuals(row[0], row[1], parts, after)
            row[0].set_ylabel('sd of the noise')
            for axis, of in zip(row, ('by time', 'by speed, after the stop')):
                axis.axhspan(-2.0, 2.0, color=_BAND, linewidth=0, zorder=0, label=_BAND_LABEL)
                axis.set_title(f'{TRACK_LABELS[quantity][0]}, {of}', loc='left', fontsize=9)
        axes[-1, 0].set_xlabel('minutes after the engine stop')
        axes[-1, 1].set_xlabel('speed through water [m/s]')
        _legend(figure, axes[0, 0])
    return figure


def _draw_residuals(by_time: Axes, by_speed: Axes, parts: Sequence[Compared], after: str) -> None:
    time_s = np.concatenate([part.time_s for part in parts])
    speed = np.concatenate([part.speed_m_s for part in parts])
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
        figure = Figure(figsize=(9.0, 0.5 + 0.32 * len(answers)), layout='constrained')
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
