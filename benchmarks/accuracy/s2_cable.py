# SPDX-License-Identifier: Apache-2.0
"""
The towed cable of S2: the paper's figures drawn again, its numbers beside ours.

`python -m benchmarks.accuracy.s2_cable` prints the numbers; with `--write` they go into
docs/s2_cable.md and the pictures beside it. No random numbers; some seconds.
"""

from __future__ import annotations

from collections.abc import Callable

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import put, table
from shipdrag_ros.report.drawing import BLUE, GREEN, STYLE, VERMILION, save
from shipdrag_ros.ship.model import QuadraticDrag
from shipdrag_ros.studies.cable import drag
from shipdrag_ros.studies.cable.face.verb import LINES, RANGE_COLOR, SURFACES

DOCS = ROOT / 'docs'
ROUNDED = {
    drag.CableSurface.SMOOTH: (0.777, 0.008),
    drag.CableSurface.ROUGH: (0.769, 0.031),
}  # the paper's (12)
LIMITS = {drag.CableSurface.SMOOTH: 0.01, drag.CableSurface.ROUGH: 0.03}  # the paper's text
UNIT = QuadraticDrag(0.02, 1.0)  # C0 = 0.02, as ropes have, on l d = 1 m^2, of unit density
COLORS = (BLUE, VERMILION, GREEN)
STYLES = ('-', '--', '-.')


def coefficients() -> Figure:
    """
    Draw the coefficients against l/d, figure 2.
    """
    figure, axes = _figure(1, 2, 3.0)
    slenderness = np.linspace(drag.SHORTEST, 300.0, 300)
    for axis, name, of in (
        (axes[0, 0], 'zeta0, on the base', drag.base_coefficient),
        (axes[0, 1], 'C0, on length times diameter', drag.drag_coefficient),
    ):
        for surface, style in SURFACES.items():
            axis.plot(slenderness, of(slenderness, surface), label=surface, **style)
        axis.set_ylabel(f'{name} [-]')
        axis.set_xlabel('length over diameter [-]')
        axis.set_ylim(0.0)
    for surface, (base, side) in ROUNDED.items():
        label = 'rounded, (12)' if surface is drag.CableSurface.SMOOTH else ''
        axes[0, 1].plot(
            slenderness, base / slenderness + side, color='#1a1a1a', linestyle=':', label=label
        )
    for axis, number in zip(axes[0], ('2a', '2b')):
        axis.legend()
        _title(axis, number)
    return figure


def naive() -> Figure:
    """
    Draw C V beside C V^2, and its error, figures 3 and 4.
    """
    figure, axes = _figure(2, 2, 4.6)
    for column, (number, speed) in enumerate(
        (('3', np.linspace(0.02, 3.0, 300)), ('4', np.linspace(0.005, 0.1, 300)))
    ):
        top, bottom = axes[:, column]
        top.plot(speed, UNIT.force_n(speed), label='f2 = 0.5 C0 V²', **LINES['C V²'])
        top.plot(speed, UNIT.force_n(np.ones(1)) * speed, label='f1 = 0.5 C0 V', **LINES['C V'])
        top.set_ylabel('f, C0 = 0.02')
        top.legend()
        bottom.plot(speed, 100.0 * drag.naive_error(speed), **LINES['C V'])
        bottom.set_ylabel('error of f1 [%]')
        bottom.set_xlabel('speed [m/s]')
        _title(top, number)
    axes[1, 0].set_ylim(-110.0, 400.0)
    axes[1, 0].axhline(0.0, color=BLUE, linewidth=1.0)
    axes[1, 1].set_ylim(0.0)
    return figure


def tangents() -> Figure:
    """
    Draw tangents and their errors, figures 5, 6 and 7.
    """
    figure, axes = _figure(1, 3, 2.8)
    left, middle, right = axes[0]
    speed = np.linspace(0.0, 4.5, 451)
    left.plot(speed, UNIT.force_n(speed), label='f2', **LINES['C V²'])
    for v0, color, style in zip((1.5, 3.0), COLORS[1:], STYLES[1:]):
        line = drag.Tangent(UNIT, v0).force_n(speed)
        left.plot(speed, line, color=color, linestyle=style, label=f'V0 = {v0:g} m/s')
    left.set_ylabel('f, C0 = 0.02')
    left.set_ylim(-0.03)
    moving = speed[1:]
    for v0, color, style in zip((0.5, 1.5, 3.0), COLORS, STYLES):
        error = 100.0 * drag.tangent_error(moving / v0)
        middle.plot(moving, error, color=color, linestyle=style, label=f'V0 = {v0:g} m/s')
    u = np.linspace(0.4, 3.5, 400)
    right.plot(u, 100.0 * drag.tangent_error(u), **LINES['tangent'])
    right.axvspan(*drag.tangent_range(0.1), color=RANGE_COLOR, zorder=0, label='10 %, solved')
    for end, label in zip(drag.PUBLISHED_RANGE, ('10 %, as published', '')):
        right.axvline(end, color='#1a1a1a', linestyle=':', linewidth=1.0, label=label)
    for axis, low in ((middle, -150.0), (right, -60.0)):
        axis.set_ylim(low, 5.0)
        axis.set_ylabel('error of the tangent [%]')
    for axis, number, name in (
        (left, '5', 'speed [m/s]'),
        (middle, '6', 'speed [m/s]'),
        (right, '7', 'u = V/V0 [-]'),
    ):
        axis.set_xlabel(name)
        axis.legend(loc='upper left' if axis is left else 'lower right')
        _title(axis, number)
    return figure


PICTURES: dict[str, Callable[[], Figure]] = {
    's2_coefficients.png': coefficients,
    's2_naive.png': naive,
    's2_tangents.png': tangents,
}


def best_line(low: float, high: float) -> tuple[float, float]:
    """
    Return where a line of least error over a range touches it from above, and that error.

    It lies as much above the parabola, at most, as below it at both ends: the
    tangent at 2/(1/low + 1/high), times one and the error.
    """
    place = 2.0 / (1.0 / low + 1.0 / high)
    square = (place / low - 1.0) ** 2
    return place, square / (2.0 - square)


def _check_best(low: float, high: float) -> None:
    """Hold the closed form against the error of the line itself and of lines beside it."""
    place, least = best_line(low, high)
    u = np.linspace(low, high, 20_001)

    def largest(place: float, factor: float) -> float:
        return float(np.max(np.abs(factor * (drag.tangent_error(u / place) + 1.0) - 1.0)))

    assert abs(largest(place, 1.0 + least) - least) < 1e-6
    for other in (0.99, 1.01):
        assert largest(other * place, 1.0 + least) > least
        assert largest(place, other * (1.0 + least)) > least


def numbers() -> str:
    """
    Return the table of the paper's numbers beside ours.
    """
    rows: list[tuple[str, str, str]] = []
    for surface, (base, side) in ROUNDED.items():
        # C0 = base / lambda + side, from two of its values
        ends = np.array([drag.SHORTEST, drag.LONGEST])
        found = drag.drag_coefficient(ends, surface)
        exact = (found[0] - found[1]) / (1.0 / ends[0] - 1.0 / ends[1])
        limit = f'{found[1] - exact / ends[1]:.5f}'
        rows += [
            (f'C0 = a d/l + b, {surface}: a', f'{base:g}', f'{exact:.4f}'),
            ('b', f'{side:g}', limit),
            ('C0 of an endless one', f'{LIMITS[surface]:g}, and {side:g} by (12)', limit),
        ]
        for at, rounded, ours in zip(ends, base / ends + side, found):
            rows.append((f'C0 at l/d = {at:g}', f'{rounded:.5f} by (12)', f'{ours:.5f}'))
    low, high = drag.PUBLISHED_RANGE
    ours = '{:.4f} to {:.4f}'.format(*drag.tangent_range(0.1))
    rows.append(('u for 10 %, tangent', f'{low:g} to {high:g}', ours))
    for u in drag.PUBLISHED_RANGE:
        error = f'{_percent(u, drag.tangent_error)} %'
        rows.append((f'error of the tangent at u = {u:g}', '10 % at most', error))
    place, least = best_line(low, high)
    line = f'{place:.4f} V0, times {1.0 + least:.4f}: {100.0 * least:.1f} %'
    rows.append((f'least error of a line over {low:g} to {high:g}, tangent at', '', line))
    ours = '{:.3f} to {:.3f} m/s'.format(*drag.naive_range_m_s(0.1))
    rows.append(('V for 10 %, C V', '1 m/s alone has 0 %', ours))
    said = {0.05: '"larger, the smaller the speed"', 2.0: 'the same'}
    for v in (0.05, 0.5, 2.0, 3.0):
        error = f'{_percent(v, drag.naive_error)} %'
        rows.append((f'error of C V at {v:g} m/s', said.get(v, ''), error))
    _check_best(low, high)
    return '\n'.join(table(('', 'paper', 'here'), rows))


def main() -> None:
    """
    Print the numbers; write them and the pictures into the docs if asked.
    """
    options = asked(__doc__, write=False)
    print(numbers())
    if options.write:
        put(DOCS / 's2_cable.md', {'numbers': numbers()})
        for name, draw in PICTURES.items():
            with mpl.rc_context(STYLE):
                save(draw(), DOCS / 'pictures' / name)


def _figure(rows: int, columns: int, height: float) -> tuple[Figure, np.ndarray]:
    figure = Figure(figsize=(8.0, height), layout='constrained')
    return figure, figure.subplots(rows, columns, squeeze=False)


def _title(axis: Axes, number: str) -> None:
    axis.set_title(f'figure {number}', loc='left')


def _percent(place: float, error: Callable[[float], np.ndarray]) -> str:
    return f'{100.0 * float(error(place)):+.1f}'


if __name__ == '__main__':
    main()
