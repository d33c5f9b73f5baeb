# SPDX-License-Identifier: Apache-2.0
"""Tables of an estimate as text, the same in the terminal and on the page."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shipdrag_ros import display
from shipdrag_ros.display import Table, force_unit, power_unit, speed_unit, track_label
from shipdrag_ros.estimation import words
from shipdrag_ros.estimation.force import Force
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.estimation.result import Estimate, ForceCurve, ResistanceCurve
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship

_COUNT = 10
FORCE = 'Resistance and effective power; ± is two standard deviations'
SPECIFIC = 'Specific resistance r in SI; sigma is one standard deviation'


def force_table(curve: ForceCurve, ship: Ship) -> Table:
    """
    Show about ten points of a curve in knots, kN and kW (m/s, N and W of a model).

    Parameters
    ----------
    curve
        Specific resistance.
    ship
        For the mass, and for the clean hull, of which nothing is shown where it is not stated.
    """
    force = Force.of(curve, ship)
    (knot, knots), (newton, newtons), (watt, watts) = (
        unit(ship.mass_kg) for unit in (speed_unit, force_unit, power_unit)
    )
    columns: tuple[str, ...] = (f'speed [{knots}]', f'resistance [{newtons}]', '±')
    columns = (*columns, f'effective power [{watts}]', '±')
    clean = bool(np.isfinite(force.over).any())
    if clean:
        columns = (*columns, f'clean hull [{newtons}]', 'over the clean hull [%]', '±')
    rows = []
    for i in dict.fromkeys(map(force.shown, _chosen(force.speed_m_s).tolist())):
        speed = float(force.speed_m_s[i])
        cells: tuple[str, ...] = (
            f'{speed / knot:.{1 if knot != 1.0 else 3}f}',
            *_pair(force.newtons[i] / newton, 2.0 * force.sigma_n[i] / newton),
            *_pair(speed * force.newtons[i] / watt, 2.0 * speed * force.sigma_n[i] / watt),
        )
        if clean and force.has_clean(i):
            over, sd = force.over_at(i)
            text, spread = _pair(100.0 * over, 200.0 * sd)
            text = text if over < 0.0 else f'+{text}'
            cells = (*cells, f'{force.clean_n[i] / newton:.4g}', text, spread)
        elif clean:
            cells = (*cells, '-', '-', '-')
        rows.append(cells)
    return Table(columns, tuple(rows))


def curve_table(
    curve: ResistanceCurve, *, truth: Callable[[Float64], Float64] | None = None
) -> Table:
    """
    Show about ten points of a curve, evenly over its speeds, in m/s and m/s².

    Parameters
    ----------
    curve
        Its own points are shown; only the truth is interpolated.
    truth
        From speeds [m/s] to the true r [m/s²], NaN where it is not known; its two
        columns are there only if it is given.
    """
    columns: tuple[str, ...] = ('speed [m/s]', 'Fr', 'r [m/s²]', 'sigma [m/s²]')
    if truth is not None:
        columns = (*columns, 'true r [m/s²]', 'error [%]')
    chosen = _chosen(curve.speed_m_s)
    if not len(chosen):
        return Table(columns, ())
    # as many decimals in every row as the best of them deserves
    least = float(np.min(curve.sigma_m_s2[chosen]))
    decimals = max(display.decimals_of(least), 0) if least > 0.0 else 6
    highest = float(curve.speed_m_s[-1])
    known = None if truth is None else truth(curve.speed_m_s)
    rows = []
    for i in chosen:
        speed, r = float(curve.speed_m_s[i]), float(curve.resistance_m_s2[i])
        cells: tuple[str, ...] = (
            display.speed_text(speed, highest_m_s=highest),
            f'{curve.froude[i]:.3f}',
            f'{r:.{decimals}f}',
            f'{curve.sigma_m_s2[i]:.{decimals}f}',
        )
        if known is not None:
            true = float(known[i])
            there = np.isfinite(true)  # the truth of a simulation ends at its highest speed
            cells = (
                *cells,
                f'{true:.{decimals}f}' if there else '-',
                f'{100.0 * (r / true - 1.0):+.1f}' if there else '-',
            )
        rows.append(cells)
    return Table(columns, tuple(rows))


def combined_table(combined: Combined) -> Table:
    """
    Show about ten points of the r(v) of several coastdowns, in m/s and m/s².
    """
    decimals = max(display.decimals_of(float(np.min(combined.sigma_m_s2))), 0)
    rows = []
    for i in _chosen(combined.speed_m_s):
        speed = float(combined.speed_m_s[i])
        figures = (combined.resistance_m_s2, combined.sigma_m_s2, combined.scatter_m_s2)
        rows.append(
            (
                display.speed_text(speed, highest_m_s=float(combined.speed_m_s[-1])),
                f'{combined.froude[i]:.3f}',
                *(f'{column[i]:.{decimals}f}' for column in figures),
            )
        )
    heads = ('speed [m/s]', 'Fr', 'r [m/s²]', 'sigma [m/s²]', 'run to run [m/s²]')
    return Table(heads, tuple(rows))


def facts(estimate: Estimate) -> Table:
    """
    Show what an estimate rests on.
    """
    low, high = estimate.froude_valid
    rows = [
        ('estimator', words.estimator(estimate.estimator)),
        (
            'coefficients',
            'averaged over models' if estimate.order is None else f'{estimate.order}',
        ),
        ('samples used', ', '.join(f'{n} {name}' for name, n in estimate.samples.items())),
        (
            'noise found',
            ', '.join(
                f'{sd:.3g} {track_label(name)[1]} {name}' for name, sd in estimate.noise_sd.items()
            ),
        ),
        ('valid range', f'Fr {low:.3f} to {high:.3f}'),
        ('upper end is', words.FROUDE_MAX_BY[estimate.froude_max_by]),
        ('argmax dr/dFr, as S1 has it', f'Fr {estimate.froude_max_argmax:.3f}'),
        ('largest sigma / largest r', f'{100.0 * estimate.max_relative_sigma:.2g} %'),
    ]
    if estimate.current_m_s is not None:
        sd = float('nan') if estimate.current_sigma_m_s is None else estimate.current_sigma_m_s
        current = display.plus_minus(estimate.current_m_s, 2.0 * sd)
        rows.append(('current along the track', f'{current} m/s (two standard deviations)'))
    return Table(('', ''), tuple(rows))


def _chosen(speed_m_s: Float64) -> Int64:
    """Return the places of about ten points, evenly over the speeds."""
    if not len(speed_m_s):
        return np.empty(0, np.int64)
    wanted = np.linspace(speed_m_s[0], speed_m_s[-1], _COUNT)
    return np.unique(np.abs(speed_m_s[:, None] - wanted).argmin(axis=0))


def _pair(value: float, spread: float) -> tuple[str, str]:
    """Return a value and its spread, both to the digits that the spread allows."""
    text, _, other = display.plus_minus(float(value), float(spread)).partition(' ± ')
    return text, other
