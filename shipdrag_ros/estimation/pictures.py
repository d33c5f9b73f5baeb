# SPDX-License-Identifier: Apache-2.0
"""
Pictures of an estimate, for the report, the README and the docs.

Each function draws one `matplotlib` figure of data that are already computed;
none of them touches pyplot, so nothing is kept and no display is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from shipdrag_ros.display import force_unit, power_unit, speed_unit, track_label
from shipdrag_ros.estimation.force import Force, clean_hull
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.estimation.result import Estimate, ForceCurve, ResistanceCurve, Track
from shipdrag_ros.estimation.words import speed_name
from shipdrag_ros.report.drawing import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SIZE,
    SKY,
    VERMILION,
    new_figure,
    one_axis,
    styled,
)
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

LINES = (
    (BLUE, '-'),
    (VERMILION, '--'),
    (GREEN, '-.'),
    (ORANGE, ':'),
    (PURPLE, (0, (5, 1, 1, 1, 1, 1))),
    (SKY, (0, (1, 1))),
)

_CLEAN: dict[str, Any] = {'color': VERMILION, 'linestyle': '--'}
_DATED = LINES[2:]  # not those of the clean hull and of all together
_BAND_LABEL = '±2 standard deviations'
_SHADES = matplotlib.colormaps['plasma']
_LIGHTEST = 0.85  # of the shades; beyond it a line is lost on white
_NAMED = 12  # curves that a legend has room for
_MANY_POINTS = 500  # above this dots are drawn as pixels, or the page grows by megabytes


def track_pictures(estimate: Estimate, mass_kg: float) -> tuple[Figure, ...]:
    """
    Draw each input as measured and as fitted, over its residuals, a picture each.

    Parameters
    ----------
    estimate
        Time counts from the first stamp of its window.
    mass_kg
        Of the ship: speeds are in knots, those of a model in m/s.
    """
    figures = []
    for name, track in estimate.tracks.items():
        with styled():
            figure = new_figure(*SIZE)
            top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
            _draw_track(top, bottom, name, track, (estimate.start_ns, mass_kg))
        figures.append(figure)
    return tuple(figures)


def _draw_track(
    top: Axes, bottom: Axes, name: str, track: Track, given: tuple[int, float]
) -> None:
    start_ns, mass_kg = given
    label, unit = track_label(name)
    scale, unit = speed_unit(mass_kg) if unit == 'm/s' else (1.0, unit)
    time_min = (track.time_ns - start_ns) * 1e-9 / 60.0
    measured, fitted = track.measured / scale, track.fitted / scale
    dots: dict[str, Any] = {
        'linestyle': 'none',
        'marker': '.',
        'markersize': 3,
        'color': '#888888',
        'rasterized': len(time_min) > _MANY_POINTS,
    }
    top.plot(time_min, measured, label='measured', **dots)
    order = np.argsort(time_min, kind='stable')
    top.plot(time_min[order], fitted[order], color=BLUE, label='fitted')
    top.set_title(label, loc='left', fontsize=10)
    top.set_ylabel(f'[{unit}]')
    top.legend()
    residual = measured - fitted
    bottom.plot(time_min, residual, **dots)
    bottom.axhline(0.0, color=BLUE, linewidth=1.0)
    spread = float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0
    bottom.set_title(f'measured - fitted, rms {spread:.3g} {unit}', loc='left', fontsize=9)
    bottom.set_ylabel(f'[{unit}]')
    bottom.set_xlabel('time after the stop [min]')


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
    with styled():
        figure = new_figure(SIZE[0], 0.4 + 1.5 * len(panels))
        axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
        for axis, (label, variance) in zip(axes, panels):
            axis.semilogy(orders, variance, color=BLUE, marker='o', markersize=3)
            axis.set_title(label, loc='left', fontsize=9)
            axis.xaxis.get_major_locator().set_params(integer=True)
            if estimate.order is not None:
                axis.axvline(
                    estimate.order,
                    color=VERMILION,
                    linestyle='--',
                    label=f'chosen: {estimate.order}',
                )
                axis.legend()
        axes[-1].set_xlabel('number of coefficients')
    return figure


def resistance_picture(
    estimate: Estimate, ship: Ship, *, truth: tuple[Float64, Float64] | None = None
) -> Figure:
    """
    Draw resistance against speed with its band, over that of the clean hull.

    Parameters
    ----------
    estimate
        What was found.
    ship
        For force, for the clean hull, and for the units: a model is drawn in N and m/s.
    truth
        Speeds [m/s] and r [m/s²] of the simulation, where the record is simulated.
    """
    with one_axis(*SIZE) as (figure, axis):
        draw_resistance(axis, estimate, ship, truth=truth)
    return figure


def draw_resistance(
    axis: Axes, estimate: Estimate, ship: Ship, *, truth: tuple[Float64, Float64] | None = None
) -> None:
    """
    Draw on axes what `resistance_picture` shows.
    """
    scale = _PictureUnits.of(ship)
    valid, whole = estimate.valid_curve, estimate.curve
    if len(valid):
        axis.axvspan(
            valid.speed_m_s[0] / scale.speed,
            valid.speed_m_s[-1] / scale.speed,
            color='#eef3f7',
            zorder=0,
            label='valid range, Fr {:.3f} to {:.3f}'.format(*estimate.froude_valid),
        )
    if len(valid) < len(whole):
        axis.plot(
            whole.speed_m_s / scale.speed,
            ship.mass_kg * whole.resistance_m_s2 / scale.force,
            color='#777777',
            linestyle=':',
            label='outside: not to be used',
        )
    _draw_clean(axis, ship, scale, whole.speed_m_s)
    _draw_force(axis, Force.of(valid, ship), scale, label='today')
    if truth is not None:
        axis.plot(
            truth[0] / scale.speed,
            ship.mass_kg * truth[1] / scale.force,
            color=GREEN,
            linestyle=(0, (1, 1)),
            label='truth of the simulation',
        )
    _frame(axis, whole, valid, ship, scale)
    _label(axis, scale, ship, speed_name(estimate))
    axis.legend(loc='upper left')


def power_picture(curve: ForceCurve, ship: Ship) -> Figure:
    """
    Draw effective power against speed with its band, over that of the clean hull.
    """
    scale = _PictureUnits.of(ship)
    force = Force.of(curve, ship)
    with one_axis(*SIZE) as (figure, axis):
        watts = force.speed_m_s / scale.power
        speed = force.speed_m_s / scale.speed
        if np.isfinite(force.clean_n).any():
            axis.plot(speed, watts * force.clean_n, label='clean hull', **_CLEAN)
        axis.fill_between(
            speed,
            watts * (force.newtons - 2.0 * force.sigma_n),
            watts * (force.newtons + 2.0 * force.sigma_n),
            color=BLUE,
            alpha=0.25,
            linewidth=0,
            label=_BAND_LABEL,
        )
        axis.plot(speed, watts * force.newtons, color=BLUE, label='today')
        axis.set_xlabel(f'speed [{scale.speed_name}]')
        axis.set_ylabel(f'effective power [{scale.power_name}]')
        axis.set_ylim(bottom=0.0)
        axis.legend(loc='upper left')
    return figure


def curves_picture(
    dated: Sequence[tuple[str, ResistanceCurve]], ship: Ship, *, combined: Combined | None = None
) -> Figure:
    """
    Draw the resistance of several coastdowns, each named by its date, over the clean hull.

    Parameters
    ----------
    dated
        A label and a curve each, oldest first; many are shaded from dark to light.
    ship
        For force, and for the clean hull.
    combined
        The one curve of all; None where they are not combined.
    """
    with one_axis(*SIZE) as (figure, axis):
        draw_curves(axis, dated, ship, combined=combined)
    return figure


def is_shaded(count: int) -> bool:
    """
    Say whether so many curves can be separated by shades, in their order.

    Parameters
    ----------
    count
        Of the curves.
    """
    return count > len(_DATED)


def draw_curves(
    axis: Axes,
    dated: Sequence[tuple[str, ResistanceCurve]],
    ship: Ship,
    *,
    combined: Combined | None = None,
) -> None:
    """
    Draw on axes what `curves_picture` shows.
    """
    scale = _PictureUnits.of(ship)
    highest = max(float(curve.speed_m_s[-1]) for _, curve in dated)
    _draw_clean(axis, ship, scale, np.linspace(0.02 * highest, highest, 101))
    for number, (label, curve) in enumerate(dated):
        color, style = _DATED[number % len(_DATED)]
        if is_shaded(len(dated)):
            color, style = to_hex(_SHADES(_LIGHTEST * number / (len(dated) - 1))), '-'
        force = Force.of(curve, ship)
        if len(dated) == 1:
            _draw_force(axis, force, scale, label=label)
            continue
        axis.plot(
            force.speed_m_s / scale.speed,
            force.newtons / scale.force,
            color=color,
            linestyle=style,
            linewidth=0.9,
            label=label if len(dated) <= _NAMED or number in (0, len(dated) - 1) else '',
        )
    if combined is not None:
        _draw_force(axis, Force.of(combined, ship), scale, label='all together')
    _label(axis, scale, ship, 'speed through water')
    axis.set_ylim(bottom=0.0)
    axis.legend(loc='upper left', fontsize=7)


@dataclass(frozen=True)
class _PictureUnits:
    """What a ship is drawn in: SI units in each, and its name."""

    speed: float
    speed_name: str
    force: float
    force_name: str
    power: float
    power_name: str

    @classmethod
    def of(cls, ship: Ship) -> _PictureUnits:
        mass = ship.mass_kg
        return cls(*speed_unit(mass), *force_unit(mass), *power_unit(mass))


def _draw_clean(axis: Axes, ship: Ship, scale: _PictureUnits, speed_m_s: Float64) -> None:
    clean, sd = clean_hull(ship, speed_m_s)
    if not np.isfinite(clean).any():
        return
    speed = speed_m_s / scale.speed
    low, high = (clean - 2.0 * sd) / scale.force, (clean + 2.0 * sd) / scale.force
    axis.fill_between(speed, low, high, color=VERMILION, alpha=0.12, linewidth=0)
    axis.plot(speed, clean / scale.force, label='clean hull', **_CLEAN)


def _draw_force(axis: Axes, force: Force, scale: _PictureUnits, *, label: str) -> None:
    speed = force.speed_m_s / scale.speed
    low = (force.newtons - 2.0 * force.sigma_n) / scale.force
    high = (force.newtons + 2.0 * force.sigma_n) / scale.force
    axis.fill_between(speed, low, high, color=BLUE, alpha=0.25, linewidth=0, label=_BAND_LABEL)
    axis.plot(speed, force.newtons / scale.force, color=BLUE, label=label)


def _label(axis: Axes, scale: _PictureUnits, ship: Ship, speed: str) -> None:
    """Name the axes, with m/s and m/s² on the other sides."""
    axis.set_xlabel(f'{speed} [{scale.speed_name}]')
    axis.set_ylabel(f'resistance [{scale.force_name}]')
    if scale.speed != 1.0:
        axis.secondary_xaxis('top', functions=_scaled_by(scale.speed)).set_xlabel('[m/s]')
    right = axis.secondary_yaxis('right', functions=_scaled_by(scale.force / ship.mass_kg))
    right.set_ylabel('specific resistance r [m/s²]')


def _scaled_by(factor: float) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    return (lambda value: value * factor, lambda value: value / factor)


def _frame(
    axis: Axes, whole: ResistanceCurve, valid: ResistanceCurve, ship: Ship, scale: _PictureUnits
) -> None:
    """Scale by what may be used: the ends of a polynomial would flatten the rest."""
    if len(whole):
        first, last = float(whole.speed_m_s[0]), float(whole.speed_m_s[-1])
        axis.set_xlim(min(0.0, first) / scale.speed, last * 1.03 / scale.speed)
    shown = valid if len(valid) else whole
    if not len(shown):
        return
    highest = float(np.max(shown.resistance_m_s2 + 2.0 * shown.sigma_m_s2))
    axis.set_ylim(0.0, highest * 1.25 * ship.mass_kg / scale.force)
