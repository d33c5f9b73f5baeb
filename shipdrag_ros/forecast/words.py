# SPDX-License-Identifier: Apache-2.0
"""A forecast in words and as a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from shipdrag_ros.display import LIGHT_KG, Table, ship_speed
from shipdrag_ros.forecast.followed import Passed
from shipdrag_ros.forecast.result import Band, Milestone

_MILE_M = 1852.0
_NOT_SHOWN = 'not shown'


def clock(seconds: float) -> str:
    """
    Return a length of time as minutes and seconds; below ten seconds with a tenth.

    Examples
    --------
    >>> clock(460.0), clock(8.31), clock(4000.0)
    ('7:40', '0:08.3', '66:40')
    """
    if seconds < 9.95:
        return f'0:{seconds:04.1f}'
    minutes, rest = divmod(round(seconds), 60)
    return f'{minutes}:{rest:02d}'


def way(metres: float, mass_kg: float, largest_m: float = 0.0) -> str:
    """
    Return a distance in nautical miles, of a light craft or beside no long way in metres.

    Examples
    --------
    >>> way(-1852.0, 2e7), way(-81.7, 2e7)
    ('-1.00 nm', '-81.7 m')
    """
    if mass_kg < LIGHT_KG or max(abs(metres), largest_m) < 0.1 * _MILE_M:
        return f'{metres:.3g} m'
    return f'{metres / _MILE_M:.2f} nm'


def sentence(milestone: Milestone, mass_kg: float, was_s: float | None = None) -> str:
    """
    Say when she has a speed and how far on: `3.9 knots in 7:40 (6:50 to 8:30), 0.71 nm`.
    """
    time = milestone.time_s
    text = (
        f'{ship_speed(milestone.speed_m_s, mass_kg)} in {clock(time.median)} '
        f'({clock(time.low)} to {clock(time.high)}), {way(milestone.distance_m.median, mass_kg)}'
    )
    if was_s is None:
        return text
    return f'{text}; was {clock(was_s)}' if was_s >= 0.0 else f'{text}; passed before'


def _was(value: float | None, was_s: float | None, show: Callable[[float], str]) -> str:
    """Return what was; a speed may have been passed before it was foretold."""
    if value is None or was_s is None:
        return _NOT_SHOWN
    return show(value) if was_s >= 0.0 else 'before'


def cells(band: Band, show: Callable[[float], str]) -> tuple[str, ...]:
    """
    Return a median, and its band.
    """
    return show(band.median), f'{show(band.low)} to {show(band.high)}'


def apart(compared: Sequence[Passed], mass_kg: float) -> list[Passed]:
    """
    Return milestones without those whose speed reads as that of one before.
    """
    first: dict[str, Passed] = {}
    for each in compared:
        first.setdefault(ship_speed(each.foretold.speed_m_s, mass_kg), each)
    return list(first.values())


def table(compared: Sequence[Passed], mass_kg: float, *, followed: bool = True) -> Table:
    """
    Show milestones, a line each; beside what followed, or alone.
    """
    rows = []
    for each in apart(compared, mass_kg):
        far = partial(way, mass_kg=mass_kg, largest_m=each.foretold.distance_m.high)
        time, distance = cells(each.foretold.time_s, clock), cells(each.foretold.distance_m, far)
        if followed:
            time += (_was(each.was_s, each.was_s, clock),)
            distance += (_was(each.was_m, each.was_s, far),)
        rows.append((ship_speed(each.foretold.speed_m_s, mass_kg), *time, *distance))
    was = ('was',) if followed else ()
    return Table(('down to', 'in [min:s]', '90 %', *was, 'after', '90 %', *was), tuple(rows))
