# SPDX-License-Identifier: Apache-2.0
"""
An estimate in sentences and tables, the same in the terminal and on the page.

Written for a chief engineer: what was found, what it can be used for, what
this record cannot show.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from shipdrag_ros import display
from shipdrag_ros.display import (
    Table,
    dated,
    force_unit,
    plus_minus,
    power_unit,
    ship_speed,
    speed_text,
    speed_unit,
    track_label,
)
from shipdrag_ros.estimation.estimators import named
from shipdrag_ros.estimation.force import Force, no_clean_text, usual_speed_m_s
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.estimation.result import Estimate, ForceCurve, FroudeMax, ResistanceCurve
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship

_AROUND = 5  # readings, of which two may be bad

FROUDE_MAX_BY = {
    FroudeMax.INFLECTION: 'the steepest rise of r, beyond which it falls significantly',
    FroudeMax.BRANCH_TOP: 'the highest speed of the fit; no steepest rise was found',
}
NOTHING_VALID = 'No speed of this record lies inside the range where r(v) may be used.'
_COUNT = 10
FORCE = 'Resistance and effective power; ± is two standard deviations'
SPECIFIC = 'Specific resistance r in SI; sigma is one standard deviation'


def speed_name(estimate: Estimate) -> str:
    """
    Name the speed that a curve is given against.
    """
    return f'speed {"through water" if estimate.by_log else "over ground"}'


def estimator(name: str) -> str:
    """
    Name an estimator, with what it is.
    """
    return f'{name}: {named(name).meaning}'


def summary(estimate: Estimate, ship: Ship | None = None) -> tuple[str, ...]:
    """
    Say what an estimate gave: in the engineer's units, then in m/s and m/s².

    Parameters
    ----------
    estimate
    ship
        For force, power and the clean hull; None: without them.
    """
    curve = estimate.valid_curve
    if not len(curve):
        return (NOTHING_VALID,)
    engineer = () if ship is None else in_service([estimate], ship)
    return (*engineer, specific(estimate))


def in_service(estimates: Sequence[Estimate], ship: Ship) -> tuple[str, ...]:
    """
    Say what the ship needs at her usual speed, a line each coastdown.

    Parameters
    ----------
    estimates
        Of one ship; those without a speed in their valid range are passed over.
    ship
        For force, power and the clean hull.

    Returns
    -------
    tuple of str
        Dated where there are several; at the end why nothing is said of the
        clean hull, where that is so.
    """
    usable = [each for each in estimates if len(each.valid_curve)]
    if not usable:
        return ()
    usual = usual_speed_m_s(usable, ship)
    lines, missing = [], ''
    for date, each in dated((each.start_ns, each) for each in usable):
        curve = each.valid_curve
        force = Force.of(curve, ship)
        low, high = (ship_speed(float(curve.speed_m_s[end]), ship.mass_kg) for end in (0, -1))
        low = low.partition(' ')[0]  # the unit stands behind the other end
        date = f'{date}: ' if len(usable) > 1 else ''
        lines.append(
            f'{date}{force.at(force.near(usual))} Known from {low} to {high}, '
            f'{conditions(each)}; ± is two standard deviations.{_force_in_calm(each, ship, usual)}'
        )
        missing = missing or no_clean_text(ship, force)
    return (*lines, missing) if missing else tuple(lines)


def conditions(estimate: Estimate) -> str:
    """
    Say of which conditions the figures are that are shown: each force that is left in them.
    """
    known = estimate.reference
    if not known.unknown:
        return 'of the ship in calm deep water'
    if not known.measured:
        return (
            f'of the ship in the {" and ".join(known.unknown)} of the run, which '
            f'{"are" if len(known.unknown) > 1 else "is"} not known'
        )
    (read,), (unknown,) = known.measured, known.unknown
    return (
        f'of the ship in the wind and depth of the run, with the {read}, which was measured, left '
        f'in as well as the {unknown}, which is not known'
    )


def _force_in_calm(estimate: Estimate, ship: Ship, speed_m_s: float) -> str:
    """
    Say what she needs in calm deep water; '' where that is what is shown.
    """
    known, curve = estimate.reference, estimate.valid_calm
    if not (known.unknown and estimate.sigma_parts and len(curve)):
        return ''
    force = Force.of(curve, ship)
    said = force.at(force.near(speed_m_s))
    how = 'whatever the weather was'
    if known.measured:
        how = f'with the {known.measured[0]} taken out'
    return f' In calm deep water, {how}: {said[0].lower()}{said[1:]}'


def in_calm(estimate: Estimate, speed_m_s: float) -> str:
    """
    Say what r is in calm deep water next to some speed [m/s]; '' where it is what is shown.
    """
    curve = estimate.valid_calm
    if not estimate.reference.unknown or not estimate.sigma_parts or not len(curve):
        return ''
    near = int(np.argmin(np.abs(curve.speed_m_s - speed_m_s)))
    r, sigma = float(curve.resistance_m_s2[near]), float(curve.sigma_m_s2[near])
    return (
        f' In calm deep water, whatever the weather was, it is {plus_minus(r, 2.0 * sigma)} m/s² '
        f'at {speed_text(float(curve.speed_m_s[near]), highest_m_s=float(curve.speed_m_s[-1]))} '
        'm/s.'
    )


def specific(estimate: Estimate) -> str:
    """
    Say where r(v) is known, and its value where it is known best.
    """
    curve = estimate.valid_curve
    low, high = float(curve.speed_m_s[0]), float(curve.speed_m_s[-1])
    # where it is known best: the ends of the range are the weakest part of any fit
    best = int(np.argmin(curve.sigma_m_s2 / np.abs(curve.resistance_m_s2)))
    speed = float(curve.speed_m_s[best])
    r, sigma = float(curve.resistance_m_s2[best]), float(curve.sigma_m_s2[best])

    def shown(speed_m_s: float) -> str:
        return speed_text(speed_m_s, highest_m_s=high)

    return (
        f'In SI: r(v) is known from {shown(low)} to {shown(high)} m/s, best at {shown(speed)} '
        f'm/s: there the specific resistance is {plus_minus(r, 2.0 * sigma)} m/s² (two standard '
        f'deviations), {conditions(estimate)}.{in_calm(estimate, speed)}'
    )


def notes(estimate: Estimate) -> tuple[str, ...]:
    """
    Say what a record can and cannot show, a sentence each; the estimator's own come first.
    """
    return (
        *estimate.notes,
        *_range_notes(estimate),
        *_residual_notes(estimate),
        *_astern_notes(estimate),
        *_method_notes(estimate),
    )


def _range_notes(estimate: Estimate) -> list[str]:
    curve = estimate.valid_curve
    found = []
    if len(curve):
        fastest = float(estimate.curve.speed_m_s[-1])
        low, high, top = (
            speed_text(float(speed), highest_m_s=fastest)
            for speed in (curve.speed_m_s[0], curve.speed_m_s[-1], fastest)
        )
        found.append(
            f'Nothing is said outside {low} to {high} m/s; the fit ends at {top} m/s'
            f'{_fastest_reading(estimate, fastest)}.'
        )
        told = np.flatnonzero(curve.resistance_m_s2 > 2.0 * curve.sigma_m_s2)
        if not len(told) or told[0] > 0:
            up_to = curve.speed_m_s[told[0] if len(told) else -1]
            found.append(
                f'Up to {speed_text(float(up_to), highest_m_s=fastest)} m/s r(v) is not told '
                'from zero: too little is read, or an engine or the wind keeps her speed.'
            )
    found.append(
        f'The upper end, Fr {estimate.froude_valid[1]:.3f}, is '
        f'{FROUDE_MAX_BY[estimate.froude_max_by]}.'
    )
    if estimate.froude_max_by is FroudeMax.BRANCH_TOP:
        found.append(
            'So it depends on the starting speed; hulls compared, it is only a lower bound.'
        )
    return found


def _fastest_reading(estimate: Estimate, fastest_m_s: float) -> str:
    """Return the largest speed that was read, but for single bad readings."""
    for name, track in estimate.tracks_of('speed_through_water', 'speed_over_ground').items():
        if len(track.measured) >= _AROUND:
            around = np.lib.stride_tricks.sliding_window_view(track.measured, _AROUND)
            read = float(np.median(around, axis=1).max())
            text = speed_text(read, highest_m_s=fastest_m_s)
            return f', {name} (medians of {_AROUND} readings) at {text} m/s'
    return ''


def _residual_notes(estimate: Estimate) -> list[str]:
    """Say of residuals that are not the independent scatter that the band counts on."""
    if named(estimate.estimator).learns_noise:
        return []  # slow disturbances are learnt, or a note says that they are not
    found = []
    for name, track in estimate.tracks.items():
        residual = track.measured - track.fitted
        energy = float(np.sum(residual**2))
        if energy == 0.0:
            continue
        correlation = float(np.sum(residual[1:] * residual[:-1])) / energy
        # of independent ones 1 / sqrt(n) is the standard deviation of this
        if correlation > max(0.1, 4.0 / math.sqrt(len(residual))):
            found.append(
                f'What the fit leaves of {name} does not scatter: the correlation of neighbours '
                f'is {correlation:.2f}. The sensor, the sea or the fit errs slowly, and the band '
                'is too narrow for that.'
            )
    speed = next(iter(estimate.tracks_of('speed_through_water').values()), None)
    if speed is not None and estimate.by_position and estimate.current_m_s is None:
        residual = speed.measured - speed.fitted
        mean, spread = float(np.mean(residual)), float(np.std(residual))
        if abs(mean) > max(0.2 * spread, 4.0 * spread / math.sqrt(len(residual))):
            found.append(
                f'The log reads {abs(mean):.2g} m/s {"more" if mean > 0.0 else "less"} on average '
                'than the position moves: a current, or a log that reads wrong.'
            )
    return found


def _astern_notes(estimate: Estimate) -> list[str]:
    """Say of a ship that drag alone would have left at rest."""
    name, speed = next(iter(estimate.tracks_of('speed_through_water').items()), ('', None))
    if speed is None:
        return []
    lowest = float(np.min(speed.fitted))
    if lowest >= -2.0 * estimate.noise_sd[name]:
        return []
    return [
        f'The speed goes through zero, to {lowest:.2g} m/s: no drag does that. A constant force '
        '(wind, a propeller) or a current acts in this record and is part of r, most of it at '
        'the lowest speeds; one run cannot show which it is.'
    ]


def _method_notes(estimate: Estimate) -> list[str]:
    found = []
    if not estimate.by_log and estimate.current_m_s is None:
        found.append(
            'Only the motion over ground was measured, on one run: a current along the track is '
            'not separated and shifts the speed scale; a run on the opposite heading would '
            'show it.'
        )
    elif estimate.by_position and estimate.current_m_s is None:
        found.append(
            'The joint fit takes log and position to show the same speed: a current, or a log '
            'that reads wrong by a factor, bends r(v).'
        )
    method = named(estimate.estimator)
    if estimate.order is not None and estimate.order == method.constant_order:
        found.append(
            f'{estimate.order} coefficients make r the same at every speed: these samples show '
            'its mean, not its shape, and the band holds for the mean alone.'
        )
    if method.caveat:
        found.append(method.caveat)
    return found


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
                *(f'{column[i]:.{decimals}f}'.replace('nan', '-') for column in figures),
            )
        )
    heads = ('speed [m/s]', 'Fr', 'r [m/s²]', 'sigma [m/s²]', 'run to run [m/s²]')
    return Table(heads, tuple(rows))


def facts_table(estimate: Estimate) -> Table:
    """
    Show what an estimate rests on.
    """
    low, high = estimate.froude_valid
    rows = [
        ('estimator', estimator(estimate.estimator)),
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
        ('upper end is', FROUDE_MAX_BY[estimate.froude_max_by]),
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
