# SPDX-License-Identifier: Apache-2.0
"""
Pictures of an estimate, for the report, the README and the docs.

Each function draws one `matplotlib` figure of data that are already computed;
none of them touches pyplot, so nothing is kept and no display is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shipdrag_ros.display import M_S_PER_KNOT, TRACK_LABELS, force_unit
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve, Track
from shipdrag_ros.replay.hulls import Hull
from shipdrag_ros.replay.truth import TrueCurve
from shipdrag_ros.replay.words import speed_name
from shipdrag_ros.report.drawing import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    STYLE,
    VERMILION,
)

_HULLS = (
    (BLUE, '-'),
    (VERMILION, '--'),
    (GREEN, '-.'),
    (ORANGE, ':'),
    (PURPLE, (0, (5, 1, 1, 1, 1, 1))),
    (SKY, (0, (1, 1))),
)

_MANY_POINTS = 500  # above this dots are drawn as pixels, or the page grows by megabytes


def track_picture(estimate: Estimate) -> Figure:
    """
    Draw each input as measured and as fitted, over its residuals.

    Time counts from the first stamp of the window.
    """
    columns = len(estimate.tracks)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.2), layout='constrained')
        axes = figure.subplots(2, columns, sharex=True, squeeze=False, height_ratios=(2, 1))
        for column, (name, track) in enumerate(estimate.tracks.items()):
            _draw_track(axes[0, column], axes[1, column], name, track, estimate.start_ns)
    return figure


def _draw_track(top: Axes, bottom: Axes, name: str, track: Track, start_ns: int) -> None:
    label, unit = TRACK_LABELS.get(name, (name, ''))
    time_s = (track.time_ns - start_ns) * 1e-9
    dots: dict[str, Any] = {
        'linestyle': 'none',
        'marker': '.',
        'markersize': 3,
        'color': '#888888',
        'rasterized': len(time_s) > _MANY_POINTS,
    }
    top.plot(time_s, track.measured, label='measured', **dots)
    order = np.argsort(time_s, kind='stable')
    top.plot(time_s[order], track.fitted[order], color=BLUE, label='fitted')
    top.set_title(label, loc='left', fontsize=10)
    top.set_ylabel(unit)
    top.legend()
    residual = track.measured - track.fitted
    bottom.plot(time_s, residual, **dots)
    bottom.axhline(0.0, color=BLUE, linewidth=1.0)
    spread = float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0
    bottom.set_title(f'measured - fitted, rms {spread:.3g} {unit}', loc='left', fontsize=9)
    bottom.set_ylabel(unit)
    bottom.set_xlabel('time [s]')


def order_picture(estimate: Estimate) -> Figure:
    """
    Draw the residual variance against the number of coefficients.

    One panel for each input used, and one for the joint problem.

    Parameters
    ----------
    estimate
        With a table of orders, as an estimator of one order has.
    """
    orders = np.array([trial.order for trial in estimate.orders])
    panels = [
        (label, np.array([getattr(trial, name) for trial in estimate.orders]))
        for label, name in (
            ('joint problem, s² [-]', 'variance'),
            ('speed, s² [(m/s)²]', 'variance_speed'),
            ('position, s² [m²]', 'variance_position'),
        )
    ]
    panels = [panel for panel in panels if np.any(np.isfinite(panel[1]))]
    if len(panels) == 2:  # one input: its variance is that of the problem
        panels = panels[1:]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 2.6), layout='constrained')
        axes = figure.subplots(1, len(panels), squeeze=False)[0]
        for axis, (label, variance) in zip(axes, panels):
            axis.semilogy(orders, variance, color=BLUE, marker='o', markersize=3)
            axis.set_title(label, loc='left', fontsize=9)
            axis.set_xlabel('number of coefficients')
            axis.xaxis.get_major_locator().set_params(integer=True)
            if estimate.order is not None:
                axis.axvline(
                    estimate.order,
                    color=VERMILION,
                    linestyle='--',
                    label=f'chosen: {estimate.order}',
                )
                axis.legend()
    return figure


def resistance_picture(
    estimate: Estimate, *, mass_kg: float | None = None, truth: TrueCurve | None = None
) -> Figure:
    """
    Draw r(v) with its band of two standard deviations.

    Parameters
    ----------
    estimate
        What was found.
    mass_kg
        Mass of the ship, for a second scale of force.
    truth
        The curve of the simulation, where the record is simulated.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.6), layout='constrained')
        axis = figure.subplots()
        valid = estimate.valid_curve
        if len(valid):
            axis.axvspan(
                valid.speed_m_s[0],
                valid.speed_m_s[-1],
                color='#eef3f7',
                zorder=0,
                label='valid range, Fr {:.3f} to {:.3f}'.format(*estimate.froude_valid),
            )
        whole = estimate.curve
        if len(valid) < len(whole):
            axis.plot(
                whole.speed_m_s,
                whole.resistance_m_s2,
                color='#777777',
                linestyle=':',
                label='outside: not to be used',
            )
        _draw_band(axis, valid, color=BLUE, style='-', label='estimated r')
        if truth is not None:
            axis.plot(
                truth.speed_m_s,
                truth.resistance_m_s2,
                color=VERMILION,
                linestyle='--',
                label='true r of the simulation',
            )
        _frame_resistance(axis, whole, valid, truth)
        knots = axis.secondary_xaxis('top', functions=_scaled_by(1.0 / M_S_PER_KNOT))
        knots.set_xlabel(f'{speed_name(estimate)} [knots]')
        if mass_kg is not None:
            newtons, unit = force_unit(mass_kg)
            force = axis.secondary_yaxis('right', functions=_scaled_by(mass_kg / newtons))
            force.set_ylabel(f'resistance [{unit}]')
        axis.set_xlabel(f'{speed_name(estimate)} [m/s]')
        axis.set_ylabel('specific resistance r [m/s² = N/kg]')
        axis.legend(loc='upper left')
    return figure


def comparison_picture(hulls: Sequence[Hull]) -> Figure:
    """
    Draw r(Fr) of several hulls, each inside its valid range.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.6), layout='constrained')
        axis = figure.subplots()
        for number, hull in enumerate(hulls):
            color, style = _HULLS[number % len(_HULLS)]
            curve = hull.curve
            axis.fill_between(curve.froude, *_band(curve), color=color, alpha=0.15, linewidth=0)
            axis.plot(
                curve.froude, curve.resistance_m_s2, color=color, linestyle=style, label=hull.label
            )
            at_top = np.interp(hull.froude_max, curve.froude, curve.resistance_m_s2)
            axis.plot([hull.froude_max], [at_top], 'o', color=color)
        axis.set_xlabel('Froude number [-]; the dot is Fr_max')
        axis.set_ylabel('specific resistance r [m/s² = N/kg]')
        axis.legend(loc='upper left')
    return figure


def combined_picture(combined: Combined, runs: Sequence[ResistanceCurve]) -> Figure:
    """
    Draw the one r(v) of several coastdowns over what each gave by itself.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.2), layout='constrained')
        axis = figure.subplots()
        for number, curve in enumerate(runs):
            axis.plot(
                curve.speed_m_s,
                curve.resistance_m_s2,
                color='#888888',
                linewidth=0.8,
                label='' if number else 'each coastdown by itself',
            )
        _draw_band(axis, combined, color=BLUE, style='-', label='all together')
        axis.set_xlabel('speed through water [m/s]')
        axis.set_ylabel('specific resistance r [m/s² = N/kg]')
        axis.set_ylim(0.0, 1.25 * float(np.max(_band(combined)[1])))
        axis.legend(loc='upper left')
    return figure


def _draw_band(
    axis: Axes, curve: ResistanceCurve | Combined, *, color: str, style: Any, label: str
) -> None:
    axis.fill_between(
        curve.speed_m_s,
        *_band(curve),
        color=color,
        alpha=0.25,
        linewidth=0,
        label='±2 standard deviations',
    )
    axis.plot(curve.speed_m_s, curve.resistance_m_s2, color=color, linestyle=style, label=label)


def _scaled_by(factor: float) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    return (lambda value: value * factor, lambda value: value / factor)


def _band(curve: ResistanceCurve | Combined) -> tuple[Any, Any]:
    return (
        curve.resistance_m_s2 - 2.0 * curve.sigma_m_s2,
        curve.resistance_m_s2 + 2.0 * curve.sigma_m_s2,
    )


def _frame_resistance(
    axis: Axes, whole: ResistanceCurve, valid: ResistanceCurve, truth: TrueCurve | None
) -> None:
    """Scale by what may be used: the ends of a polynomial would flatten the rest."""
    if len(whole):
        axis.set_xlim(min(0.0, float(whole.speed_m_s[0])), float(whole.speed_m_s[-1]) * 1.03)
    shown = valid if len(valid) else whole
    if not len(shown):
        return
    highest = float(np.max(shown.resistance_m_s2 + 2.0 * shown.sigma_m_s2))
    if truth is not None:
        inside = truth.speed_m_s <= shown.speed_m_s[-1]
        highest = max(highest, float(np.max(truth.resistance_m_s2[inside], initial=0.0)))
    axis.set_ylim(0.0, highest * 1.25)
