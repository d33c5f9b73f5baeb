# SPDX-License-Identifier: Apache-2.0
"""
Drag of a cable that is towed along the flow, 0.5 rho C0 l d V^2, and the range of speeds in which
its tangent at V0 may replace it. C0 is that of a smooth cylinder of the same length over
diameter, unless --rough or --c0 is given.

Options
-------
--report FILE.html
    write the result with its pictures to one HTML file
--rough
    C0 of a very rough cylinder (a log) in place of a smooth one
--c0 X
    C0 on length times diameter [-]; ropes have 0.01 to 0.04
--tolerance X
    relative error that the tangent may have [-]
--density RHO
    density of the water [kg/m^3]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from shipdrag_ros.cli.arguments import add, number
from shipdrag_ros.cli.output import Output, Presentation, by_columns, show
from shipdrag_ros.display import Section, Table
from shipdrag_ros.report.drawing import BLUE, GREEN, VERMILION, new_figure, one_axis, styled
from shipdrag_ros.studies.cable import drag

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINES: dict[str, dict[str, Any]] = {
    'C V²': {'color': BLUE, 'linestyle': '-'},
    'C V': {'color': GREEN, 'linestyle': ':'},
    'tangent': {'color': VERMILION, 'linestyle': '--'},
}
SURFACES: dict[drag.CableSurface, dict[str, Any]] = {
    drag.CableSurface.SMOOTH: LINES['C V²'],
    drag.CableSurface.ROUGH: LINES['tangent'],
}
RANGE_COLOR = '#eef3f7'


def coefficient_picture(cable: drag.Cable) -> Figure:
    """
    Draw C0 against l/d, with the place of a cable in it.
    """
    with one_axis(9.0, 3.4) as (figure, axis):
        slenderness = np.geomspace(drag.SHORTEST, drag.LONGEST, 200)
        for surface, style in SURFACES.items():
            c0 = drag.drag_coefficient(slenderness, surface)
            axis.semilogx(slenderness, c0, label=f'{surface} cylinder', **style)
        axis.semilogx([cable.slenderness], [cable.c0], 'o', color='#1a1a1a', label='this cable')
        axis.set(xlabel='length over diameter [-]', ylabel='C0, on length times diameter [-]')
        axis.legend()
    return figure


def tangent_picture(tangent: drag.Tangent, tolerance: float) -> Figure:
    """
    Draw drag and lines over the speed, and below it what the lines err.
    """
    v0 = tangent.speed_m_s
    low, high = drag.tangent_range(tolerance)
    u = np.linspace(0.0, 2.5, 251)
    speed = u * v0
    with styled():
        figure = new_figure(9.0, 6.0)
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        force = tangent.drag.force_n(speed)
        per_unit = tangent.drag.force_n(np.ones(1))  # C of C V: its force at 1 m/s
        top.plot(speed, force, label='drag, C V²', **LINES['C V²'])
        top.plot(speed, tangent.force_n(speed), label='tangent at V0', **LINES['tangent'])
        top.plot(speed, per_unit * speed, label='C V', **LINES['C V'])
        top.plot([v0], [tangent.drag_n], 'o', color='#1a1a1a', label=f'V0 = {v0:g} m/s')
        top.set(ylim=(-1.1 * tangent.drag_n, 1.05 * float(force[-1])), ylabel='force [N]')
        moving, its_u = speed[1:], u[1:]
        bottom.plot(moving, 100.0 * drag.tangent_error(its_u), **LINES['tangent'])
        bottom.plot(moving, 100.0 * drag.naive_error(moving), **LINES['C V'])
        bottom.axhline(0.0, color=BLUE, linewidth=1.0)
        bottom.set(ylim=(-105.0, 105.0), ylabel='error of the lines [%]')
        bottom.set(xlim=(0.0, speed[-1]), xlabel='speed [m/s]')
        for axis in (top, bottom):
            span = low * v0, min(high * v0, speed[-1])
            axis.axvspan(*span, color=RANGE_COLOR, zorder=0, label='where the tangent may be used')
        top.legend(loc='upper left')
    return figure


_FORMULAS = (
    'Formulas: Akhmedov, Naumov, Linearization of the dependence of the cable hydrodynamic drag '
    'force from the speed. C V is the force with the same figure C and the speed in m/s, as it is '
    'met in textbooks.'
)
_LINES, _COEFFICIENT = 'The drag, and a line in place of it', 'The coefficient'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    for name, meaning, unit, most in (
        ('--length', 'length of the cable', 'm', 1e6),
        ('--diameter', 'diameter of the cable', 'm', 10.0),
        ('--speed', 'V0, the speed of towing', 'm/s', 40.0),
    ):
        parser.add_argument(
            name,
            required=True,
            type=number(0.0, most, unit=unit, above=True),
            metavar='V0' if name == '--speed' else 'M',
            help=f'{meaning} [{unit}]',
        )
    surface = parser.add_mutually_exclusive_group()
    surface.add_argument(
        '--rough',
        action='store_const',
        const=drag.CableSurface.ROUGH,
        default=drag.CableSurface.SMOOTH,
        dest='drag',
    )
    surface.add_argument('--c0', type=number(0.0, 10.0, above=True), metavar='X', dest='drag')
    parser.add_argument(
        '--tolerance', type=number(0.0, 10.0, above=True), default=0.1, metavar='X'
    )
    parser.add_argument(
        '--density', type=number(900.0, 1100.0, unit='kg/m^3'), default=1025.0, metavar='RHO'
    )
    add(parser, '--report', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Compute and show it.
    """
    output = Output(options.json)
    cable = drag.Cable(options.length, options.diameter, options.drag)
    tangent = drag.Tangent(cable.in_water(options.density), options.speed)
    show(output, shown(cable, tangent, options.tolerance), options.report)
    output.json(
        {  # ranges and rows are in u = V/V0
            'c0': cable.c0,
            'drag_n': tangent.drag_n,
            'linear_gain_n_per_m_s': tangent.gain_n_per_m_s,
            'linear_range': drag.tangent_range(options.tolerance),
            'errors': drag.compare_errors(tangent.speed_m_s, options.tolerance),
        }
    )
    return 0


def shown(cable: drag.Cable, tangent: drag.Tangent, tolerance: float) -> Presentation:
    """
    Return what is printed, and shown on a page.

    Parameters
    ----------
    cable
    tangent
        Of its drag.
    tolerance
        Relative error that a line may have.
    """

    def pictures() -> Iterator[tuple[str, Figure, str]]:
        lines = (
            'The drag and two lines in place of it, and by how much these err; shaded: where the '
            f'tangent errs by {100.0 * tolerance:.3g} % at most.'
        )
        yield _LINES, tangent_picture(tangent, tolerance), lines
        measured = 'Drag coefficient of cylinders along the flow, where it was measured.'
        yield _COEFFICIENT, coefficient_picture(cable), measured

    tables = (
        ('Figures of the cable', _facts(cable, tangent, tolerance)),
        ('Errors of the lines: each over the drag, less one', _errors(tangent, tolerance)),
    )
    area = tangent.drag.drag_area_m2
    on_a_ship = f'On a ship: shipdrag simulate --effect towed_cable={area:.6g} ...'
    return Presentation(
        'Drag of a towed cable, and a line in place of it',
        _sentence(cable, tangent, tolerance),
        [
            Section(_LINES, tables=tables),
            Section('Before it is used', lines=(*_notes(cable), on_a_ship)),
            Section(_COEFFICIENT),
        ],
        pictures(),
        foot=_FORMULAS,
    )


def _sentence(cable: drag.Cable, tangent: drag.Tangent, tolerance: float) -> str:
    """Say what the drag is, which line may replace it, and where."""
    is_known = isinstance(cable.drag, drag.CableSurface)
    kind = f'{cable.drag} cable' if is_known else 'cable with a stated C0'
    low, high = drag.tangent_range(tolerance)
    upward = f'to {high * tangent.speed_m_s:.4g} m/s (u = V/V0 from {low:.4f} to {high:.4f})'
    if not math.isfinite(high):
        upward = f'on (u = V/V0 from {low:.4f}, without upper end)'
    return (
        f'A {kind}, {cable.length_m:g} m by {cable.diameter_m:g} m, towed along the flow at '
        f'{tangent.speed_m_s:g} m/s: {tangent.drag_n:.4g} N. '
        f'The tangent R = {tangent.gain_n_per_m_s:.4g} N/(m/s) V - {tangent.drag_n:.4g} N is '
        f'within {100.0 * tolerance:.3g} % of it from {low * tangent.speed_m_s:.4g} m/s {upward}; '
        'it is never above it.'
    )


def _facts(cable: drag.Cable, tangent: drag.Tangent, tolerance: float) -> Table:
    """Show the figures of a cable."""
    low, high = drag.tangent_range(tolerance)
    v0, percent = tangent.speed_m_s, f'{100.0 * tolerance:.3g} %'
    return Table(
        ('', ''),
        (
            ('length over diameter', f'{cable.slenderness:.5g}'),
            ('C0, on length times diameter', f'{cable.c0:.5g}'),
            ('drag area C0 l d', f'{tangent.drag.drag_area_m2:.5g} m²'),
            ('density of the water', f'{tangent.drag.density_kg_m3:g} kg/m³'),
            ('drag at V0', f'{tangent.drag_n:.5g} N'),
            ('slope of the tangent', f'{tangent.gain_n_per_m_s:.5g} N/(m/s)'),
            (f'tangent within {percent}, u = V/V0', _between(low, high)),
            (f'tangent within {percent}, V', f'{_between(low * v0, high * v0)} m/s'),
            (f'C V within {percent}, V', f'{_between(*drag.naive_range_m_s(tolerance))} m/s'),
        ),
    )


def _errors(tangent: drag.Tangent, tolerance: float) -> Table:
    """Show what the lines err at speeds about V0."""
    u, naive, touching = drag.compare_errors(tangent.speed_m_s, tolerance).T
    return by_columns(
        {
            'u = V/V0': (f'{each:.4f}' for each in u),
            'V [m/s]': (f'{each:.3f}' for each in u * tangent.speed_m_s),
            'C V: error [%]': (f'{each:+.1f}' for each in 100.0 * naive),
            'tangent: error [%]': (f'{each:.1f}' for each in 100.0 * touching),
        }
    )


def _notes(cable: drag.Cable) -> tuple[str, ...]:
    """Say what has to be known before the figures are used."""
    low, high = drag.PUBLISHED_RANGE
    at_low, at_high = (f'{100.0 * each:.1f} %' for each in drag.tangent_error((low, high)))
    return (
        *(f'WARNING: {warning}' for warning in cable.warnings),
        f'The source states 10 % for u from {low:g} to {high:g}; by its own formula the tangent '
        f'errs by {at_low} at {low:g} and by {at_high} at {high:g}.',
        'The drag holds along the flow at large Reynolds numbers, without waves.',
    )


def _between(low: float, high: float) -> str:
    return f'{low:.5g} to {high:.5g}' if math.isfinite(high) else f'above {low:.5g}'
