# SPDX-License-Identifier: Apache-2.0
"""
Results in sentences, the same in the terminal and on the page.

Written for a chief engineer: what was found, what it can be used for, what
this record cannot show.
"""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.coastdown.events import Coastdown, EndedBy
from shipdrag_ros.display import (
    LIGHT_KG,
    M_S_PER_KNOT,
    duration,
    force_unit,
    plus_minus,
    speed_text,
)
from shipdrag_ros.estimation.estimators import named
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.estimation.result import Estimate, FroudeMax
from shipdrag_ros.replay import Recorded
from shipdrag_ros.ship import Ship

_ROUNDING = 1e-6  # of a figure; what is larger has another cause
_AROUND = 5  # readings, of which two may be bad

ENDED_BY = {
    EndedBy.SPEED: 'the minimum speed was reached',
    EndedBy.TURN: 'the ship turned',
    EndedBy.ENGINE: 'the engine drove the ship again',
    EndedBy.BRAKE: 'something but the water stopped the ship',
    EndedBy.ASTERN: 'the propeller was reversed',
    EndedBy.DATA_STOP: 'the data stopped',
    EndedBy.SILENCE: 'all sources of speed fell silent',
    EndedBy.RESET: 'the memory was reset',
    EndedBy.RECORD_END: 'the record ended',
    EndedBy.GIVEN: 'the window was given by hand',
}
FROUDE_MAX_BY = {
    FroudeMax.INFLECTION: 'the steepest rise of r, beyond which it falls significantly',
    FroudeMax.BRANCH_TOP: 'the highest speed of the fit; no steepest rise was found',
}


def speed_name(estimate: Estimate) -> str:
    """
    Name the speed that a curve is given against.
    """
    through_water = 'speed_through_water' in estimate.samples
    return f'speed {"through water" if through_water else "over ground"}'


def estimator(name: str) -> str:
    """
    Name an estimator, with what it is.
    """
    return f'{name}: {named(name).meaning}'


def ship_line(ship: Ship) -> str:
    """
    Return the ship in one line.
    """
    name = ship.name or 'a ship without a name'
    light = ship.mass_kg < LIGHT_KG
    mass = f'{ship.mass_kg:.4g} kg' if light else f'{ship.mass_kg * 1e-3:,.0f} t'
    return (
        f'{name}: length {ship.length_m:g} m, displacement {ship.displaced_volume_m3:g} m³ '
        f'({mass})'
    )


def recorded_sentence(recorded: Recorded) -> str:
    """
    Say whether the replayed outputs are those in the bag.
    """
    if not recorded.compared:
        return 'The bag holds no outputs of its own to compare with.'
    if recorded.identical == recorded.compared:
        return f'All {recorded.compared} outputs in the bag are identical to the replayed ones.'
    if recorded.largest_difference < _ROUNDING:
        size = (
            f'no figure differs by more than {recorded.largest_difference:.1g} of its value, '
            'which is the rounding of another machine or library'
        )
    else:
        size = f'first difference: {recorded.first_difference}'
    return (
        f'{recorded.identical} of {recorded.compared} outputs in the bag are identical to the '
        f'replayed ones; {size}.'
    )


def no_coastdown_sentence(steady_lead_s: float | None, dismissed: int, why: str = '') -> str:
    """
    Say that no coastdown was found, and what was looked at.

    Parameters
    ----------
    steady_lead_s
        The longest that the ship was steady [s]; None where that was not looked for.
    dismissed
        How many stretches were looked at and dismissed.
    why
        What the speed did instead, where nothing was dismissed.
    """
    known = [] if steady_lead_s is None else [f'longest steady sailing {duration(steady_lead_s)}']
    if dismissed:
        stretches = 'one stretch was' if dismissed == 1 else f'{dismissed} stretches were'
        known.append(f'{stretches} looked at and dismissed, see below')
    else:
        known.append(why or 'nothing in it looked like one')
    return f'No coastdown found: {"; ".join(known)}.'


def result_sentence(coastdown: Coastdown, *, mass_kg: float | None = None) -> str:
    """
    Say in one sentence what a coastdown gave.
    """
    if coastdown.estimate is None:
        return f'No resistance could be estimated: {coastdown.failure or "no reason given"}.'
    curve = coastdown.estimate.valid_curve
    if not len(curve):
        return 'No speed of this record lies inside the range where r(v) may be used.'
    low, high = float(curve.speed_m_s[0]), float(curve.speed_m_s[-1])
    # where it is known best: the ends of the range are the weakest part of any fit
    best = int(np.argmin(curve.sigma_m_s2 / np.abs(curve.resistance_m_s2)))
    speed = float(curve.speed_m_s[best])
    r, sigma = float(curve.resistance_m_s2[best]), float(curve.sigma_m_s2[best])
    force = ''
    if mass_kg is not None:
        newtons, unit = force_unit(mass_kg)
        scale = mass_kg / newtons
        force = f', that is {plus_minus(r * scale, 2.0 * sigma * scale)} {unit}'

    def shown(speed_m_s: float) -> str:
        return speed_text(speed_m_s, highest_m_s=high)

    return (
        f'The resistance is known from {shown(low)} to {shown(high)} m/s '
        f'({low / M_S_PER_KNOT:.1f} to {high / M_S_PER_KNOT:.1f} knots), best at '
        f'{shown(speed)} m/s: there the '
        f'specific resistance is {plus_minus(r, 2.0 * sigma)} m/s² (two standard deviations)'
        f'{force}.'
    )


def notes(coastdown: Coastdown) -> tuple[str, ...]:
    """
    Say what this record can and cannot show, a sentence each.

    The estimator's own notes come first.
    """
    estimate = coastdown.estimate
    if estimate is None:
        return ()
    return (
        *estimate.notes,
        *_range_notes(estimate),
        *_residual_notes(estimate),
        *_astern_notes(estimate),
        *_method_notes(estimate),
    )


def combined_notes(combined: Combined) -> tuple[str, ...]:
    """
    Say what several coastdowns together can and cannot show, a sentence each.
    """
    if combined.current_m_s is None or combined.current_sigma_m_s is None:
        current = (
            'These runs do not tell a current: none is taken out. Runs on opposite headings would.'
        )
    else:
        value = plus_minus(combined.current_m_s, 2.0 * combined.current_sigma_m_s)
        current = (
            f'The current along the heading of the first run is {value} m/s (two standard '
            'deviations); it is taken out.'
        )
    return (
        current,
        'Run to run is the standard deviation of one run about the mean of all; where it is '
        'larger than the runs themselves state, sigma is widened.',
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
    """Tell the largest speed that was read, but for single bad readings."""
    for name in ('speed_through_water', 'speed_over_ground'):
        track = estimate.tracks.get(name)
        if track is not None and len(track.measured) >= _AROUND:
            around = np.lib.stride_tricks.sliding_window_view(track.measured, _AROUND)
            read = float(np.median(around, axis=1).max())
            text = speed_text(read, highest_m_s=fastest_m_s)
            return f', {name} (medians of {_AROUND} readings) at {text} m/s'
    return ''


def _residual_notes(estimate: Estimate) -> list[str]:
    """Tell of residuals that are not the independent scatter that the band counts on."""
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
    speed = estimate.tracks.get('speed_through_water')
    if speed is not None and 'position' in estimate.tracks and estimate.current_m_s is None:
        residual = speed.measured - speed.fitted
        mean, spread = float(np.mean(residual)), float(np.std(residual))
        if abs(mean) > max(0.2 * spread, 4.0 * spread / math.sqrt(len(residual))):
            found.append(
                f'The log reads {abs(mean):.2g} m/s {"more" if mean > 0.0 else "less"} on average '
                'than the position moves: a current, or a log that reads wrong.'
            )
    return found


def _astern_notes(estimate: Estimate) -> list[str]:
    """Tell of a ship that drag alone would have left at rest."""
    speed = estimate.tracks.get('speed_through_water')
    if speed is None:
        return []
    lowest = float(np.min(speed.fitted))
    if lowest >= -2.0 * estimate.noise_sd['speed_through_water']:
        return []
    return [
        f'The speed goes through zero, to {lowest:.2g} m/s: no drag does that. A constant force '
        '(wind, a propeller) or a current acts in this record and is part of r, most of it at '
        'the lowest speeds; one run cannot tell which it is.'
    ]


def _method_notes(estimate: Estimate) -> list[str]:
    found = []
    if 'speed_through_water' not in estimate.samples and estimate.current_m_s is None:
        found.append(
            'Only the motion over ground was measured, on one run: a current along the track is '
            'not separated and shifts the speed scale; a run on the opposite heading would tell.'
        )
    elif 'position' in estimate.samples and estimate.current_m_s is None:
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
