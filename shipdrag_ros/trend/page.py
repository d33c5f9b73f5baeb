# SPDX-License-Identifier: Apache-2.0
"""The page of a fleet: which hull first, then each ship."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np
from matplotlib.axes import Axes

from shipdrag_ros import display
from shipdrag_ros.diagnosis.words import quantity_text
from shipdrag_ros.diagnosis.words import size as size_text
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.report.document import page_text
from shipdrag_ros.report.drawing import BLUE, ORANGE, VERMILION, one_axis, picture
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.simulation.effects import find
from shipdrag_ros.trend import words
from shipdrag_ros.trend.series import CoastdownRow
from shipdrag_ros.trend.ship_trend import ShipTrend

_RANKED = 'Each ship at her reference speed, the one to be cleaned first on top.'
_RUNS = 'Coastdowns, the latest first; ± is two standard deviations'
Links = Mapping[tuple[str, int], str]
_HOW = display.Section(
    'How to read it',
    lines=(
        'Added resistance is the resistance of the hull in calm deep water over that of the clean '
        'hull, at the speed stated. It is what coastdowns show, without the propeller.',
        'The band holds what is known of the hull, not of a single run: weather and draught make '
        'runs scatter about it.',
        'Speed lost is at equal effective power, where power goes as the cube of the speed: a '
        'hull whose resistance grew by 10 % is about 3 % slower. It is not the speed loss of ISO '
        '19030, which compares shaft power and so counts the propeller too.',
    ),
)


def fleet_text(
    trends: Sequence[ShipTrend], skipped: Sequence[tuple[str, str]], *, links: Links | None = None
) -> str:
    """
    Return the trends of a fleet as one page (HTML).

    Parameters
    ----------
    trends
        In the order of their rank.
    skipped
        Bag and reason of what the fleet could not use.
    links
        Where the page of each coastdown is, by bag and start; None where there are none.
    """
    ranked = (f'{_RANKED} {words.ranked_by(trends)}', words.ranking(trends))
    sections = [display.Section('Which hull first', tables=(ranked,))]
    for trend in trends:
        steps = (('Steps in the state of the hull', words.event_table(trend)),)
        name, lines = trend.series.name or 'a ship without a name', words.lines(trend)
        sections.append(
            display.Section(
                name,
                entry=name,
                lead=lines[:1],
                lines=lines[1:],
                pictures=() if trend.curve is None else (added_resistance(trend),),
                tables=(*(steps if trend.events else ()), (_RUNS, _runs(trend, links or {}))),
            )
        )
    if skipped:
        table = display.Table(('bag', 'reason'), tuple(skipped))
        tables = (('What the fleet could not use, and why', table),)
        sections.append(display.Section('Bags that could not be used', tables=tables))
    sections.append(_HOW)
    return page_text('Trend of the fleet', sections, sentence=_sentence(trends))


def _runs(trend: ShipTrend, links: Links) -> display.Table:
    """Return a line a coastdown; its date leads to its page, where there is one."""
    rows = []
    for point in reversed(trend.points):
        date, href = display.utc(point.time_ns), links.get((point.bag, point.time_ns))
        added = display.plus_minus(100.0 * point.value, 200.0 * point.sd)
        rows.append(
            (
                date if href is None else display.Link(date, href),
                point.bag,
                added if np.isfinite(point.value) else '-',
                words.speed_lost_percent(point.value),
                point.reason or 'used',
            )
        )
    head = ('start', 'bag', 'added [%]', 'speed lost [%]', 'used, or why not')
    return display.Table(head, tuple(rows))


def _sentence(trends: Sequence[ShipTrend]) -> str:
    """Return the first line: which hull, and how sure."""
    if not trends or trends[0].now is None:
        return 'No ship has runs enough for a trend.'
    first = trends[0]
    cost = f'; it costs {words.amount(first.costs.usd_per_year)} USD a year' if first.costs else ''
    return (
        f'{first.series.name} first: {words.percent(first.now)} % over the clean hull '
        f'in calm deep water{words.speed_loss(first)}{cost}.'
    )


_SIZE = (9.0, 3.6)


def added_resistance(trend: ShipTrend) -> display.Picture:
    """
    Draw the added resistance of one ship against time.

    Parameters
    ----------
    trend
        With a curve.
    """
    with one_axis(*_SIZE) as (figure, axes):
        draw_added_resistance(axes, trend)
    return picture(
        figure,
        'Each point is a coastdown. Where the line rises, the hull fouls; where it drops at a '
        'vertical line, something was taken off it: solid, by the log book; dashed, found here.',
    )


def draw_added_resistance(axes: Axes, trend: ShipTrend) -> None:
    """
    Draw on axes what `added_resistance` shows.
    """
    assert trend.curve is not None
    days = _days(trend.curve.time_ns)
    value, sd = 100.0 * trend.curve.value, 100.0 * trend.curve.sd
    axes.fill_between(days, value - 2.0 * sd, value + 2.0 * sd, color=BLUE, alpha=0.2, lw=0)
    axes.plot(days, value, color=BLUE, label='hull, with its band of two sd')
    # the date of a wrong clock would stretch the axis over decades
    first, last = trend.curve.time_ns[[0, -1]]
    drawn = [each for each in trend.points if np.isfinite(each.value)]
    shown = [each for each in drawn if each.used or first <= each.time_ns <= last]
    for used, colour, marker, label in (
        (True, '#333333', 'o', 'a coastdown, one sd'),
        (False, VERMILION, 'x', 'outlier, or not used'),
    ):
        points = [each for each in shown if each.used is used]
        if points:
            axes.errorbar(
                _days(np.array([each.time_ns for each in points])),
                [100.0 * each.value for each in points],
                yerr=[100.0 * each.sd_repeatable for each in points],
                fmt=marker,
                ms=4,
                lw=0.8,
                color=colour,
                label=label,
            )
    for event in trend.events:
        day = float(_days(np.array([event.time_ns]))[0])
        axes.axvline(day, color=ORANGE, ls='-' if event.known else '--', lw=1.2)
        text = event.kind.replace('_', ' ') if event.known else 'step found'
        at, place = (day, 1.0), ('data', 'axes fraction')
        axes.annotate(text, at, xycoords=place, rotation=90, va='top', ha='right', fontsize=8)
    axes.axhline(0.0, color='#333333', lw=0.8)
    axes.set_ylabel('resistance over the clean hull [%]')
    beyond = len(drawn) - len(shown)
    others = f'; {beyond} run(s) of another time are in the list alone' if beyond else ''
    axes.set_xlabel(f'date (UTC){others}')
    axes.xaxis_date()
    axes.legend(loc='upper left')


def _coastdown_curve(row: CoastdownRow) -> display.Picture:
    """Draw the resistance of one coastdown over that of the clean hull."""
    known, mass_kg = _known(row), _mass_kg(row)
    unit, name = display.force_unit(mass_kg)

    def at_known(column: str) -> Float64:
        return np.asarray(row[column], dtype=float)[known]

    with one_axis(*_SIZE) as (figure, axes):
        knots = at_known('speed_m_s') / display.M_S_PER_KNOT
        force = mass_kg / unit * at_known('resistance_m_s2')
        spread = 2.0 * mass_kg / unit * at_known('sigma_m_s2')
        band = force - spread, force + spread
        label = '±2 standard deviations'
        axes.fill_between(knots, *band, color=BLUE, alpha=0.2, lw=0, label=label)
        axes.plot(knots, force, color=BLUE, label='this run')
        if row['clean_m_s2'] is not None:
            clean = mass_kg / unit * at_known('clean_m_s2')
            axes.plot(knots, clean, color=VERMILION, ls='--', label='clean hull')
        axes.set(xlabel='speed through water [knots]', ylabel=f'resistance [{name}]')
        axes.set_ylim(bottom=0.0)
        axes.legend(loc='upper left')
    return picture(
        figure,
        'Resistance of this run over that of the clean hull. Where the band lies above the dashed '
        'line, she needed more than clean.',
    )


def _days(time_ns: Int64) -> Float64:
    """Return days since 1970, in which matplotlib counts dates."""
    return np.asarray(time_ns / 86_400e9)


_LINES = 12
_VERDICTS = {
    'none': 'Model and data agree: no effect is missing.',
    'unknown': 'Something is missing that has no name in the library of effects.',
}
_FLAGS = {
    'cut': 'part of the record was cut',
    'short': 'the run is short',
    'turned': 'the ship turned',
    'engine': 'the engine drove again',
    'braked': 'something but the water stopped her',
    'data_stop': 'the data stopped',
    'withdrawn': 'it turned out to be no coastdown',
    'no_estimate': 'no estimate was possible',
    'no_diagnosis': 'it was not diagnosed',
    'clocks_apart': 'the clocks of the sensors differ',
    'damaged': 'the recording is damaged',
}


def page_name(row: CoastdownRow) -> str:
    """
    Return the file name of a coastdown's page: the same for the same content.
    """
    return f'{row["content_hash"][:20]}-{row["time_ns"]}.html'


def links(rows: list[CoastdownRow], folder: str) -> dict[tuple[str, int], str]:
    """
    Return where each coastdown's page is, by bag and start.

    Parameters
    ----------
    rows
        Of the store's `coastdowns`.
    folder
        That holds the pages, as it is reached from the page of the fleet; ends with '/'.
    """
    return {(row['bag'], row['time_ns']): f'{folder}{page_name(row)}' for row in rows}


def coastdown_page(row: CoastdownRow, *, fleet: str) -> str:
    """
    Return the page of a coastdown (HTML).

    Parameters
    ----------
    row
        Of the store's `coastdowns`.
    fleet
        Where the page of the fleet is.
    """
    ship = row['ship'] or 'a ship without a name'
    bag = shlex.quote(row['bag'].rpartition('/')[2])
    more = (
        f'The motion, the residuals and what would decide: shipdrag diagnose {bag} '
        '--report page.html, in the folder of the bag.'
    )
    sections = [
        display.Section('The run', tables=(('What is known of it', _facts(row)),)),
        *_curve(row),
        display.Section('What differs', lead=(_verdict(row),), tables=_candidates(row)),
        display.Section('More', text=(more,)),
    ]
    return page_text(
        f'{ship}: coastdown of {display.utc(row["time_ns"])}',
        sections,
        sentence=_of_run(row),
        above=display.Link('The fleet', fleet),
    )


def _mass_kg(row: CoastdownRow) -> float:
    return float(row['displaced_volume_m3'] * row['water_density_kg_m3'])


def _known(row: CoastdownRow) -> Int64:
    """Return the places of the grid where r is known."""
    r = np.asarray(row['resistance_m_s2'], dtype=float)
    return np.flatnonzero(np.isfinite(r) & (r > 0.0))


def _of_run(row: CoastdownRow) -> str:
    known = _known(row)
    if len(known) == 0:
        return f'No estimate: {row["error"] or "none was possible"}.'
    wished = 0.75 * (row['speed_at_stop_m_s'] or row['speed_m_s'][known[-1]])
    place = int(known[np.abs(np.asarray(row['speed_m_s'])[known] - wished).argmin()])
    speed, force, power, over = _cells(row, place)
    said = f'At {speed} knots: resistance {force}, effective power {power}'
    return f'{said}, {over} % over the clean hull; ± is two standard deviations.' if over else said


def _cells(row: CoastdownRow, place: int) -> tuple[str, str, str, str]:
    """Return speed, resistance, effective power and percent over the clean hull as text."""
    mass, speed = _mass_kg(row), float(row['speed_m_s'][place])
    newtons = mass * float(row['resistance_m_s2'][place])
    spread = 2.0 * mass * float(row['sigma_m_s2'][place])
    force, force_name = display.force_unit(mass)
    power, power_name = display.power_unit(mass)
    over, clean = '', row['clean_m_s2']
    if clean is not None and clean[place] is not None and np.isfinite(clean[place]):
        clean_n = mass * float(clean[place])
        over = display.plus_minus(100.0 * (newtons / clean_n - 1.0), 100.0 * spread / clean_n)
    return (
        f'{speed / display.M_S_PER_KNOT:.1f}',
        f'{display.plus_minus(newtons / force, spread / force)} {force_name}',
        f'{display.plus_minus(newtons * speed / power, spread * speed / power)} {power_name}',
        over,
    )


def _facts(row: CoastdownRow) -> display.Table:
    heading, end_ns = row['heading_rad'], row['end_ns']
    compass = None if heading is None else (90.0 - np.degrees(heading)) % 360.0
    flags = [_FLAGS.get(flag, flag.replace('_', ' ')) for flag in row['flags'] or ()]
    found = {
        'bag': row['bag'],
        'start': display.utc(row['time_ns']),
        'length': end_ns and display.duration((end_ns - row['time_ns']) / 1e9),
        'ended by': row['ended_by'] and row['ended_by'].replace('_', ' '),
        'compass heading': None if compass is None else f'{compass:03.0f}',
        'speed at the stop': row['speed_at_stop_m_s']
        and display.ship_speed(row['speed_at_stop_m_s'], _mass_kg(row)),
        'draught': row['draught_m'] and f'{row["draught_m"]:.2f} m',
        'displaced volume': f'{row["displaced_volume_m3"]:.0f} m³',
        'noted in the log book': ', '.join(row['facts'] or ()),
        'to be weighed': ', '.join(flags),
        'no estimate, because': row['error'],
        'software': f'shipdrag_ros {row["software_version"]}',
    }
    stated = tuple((name, str(text)) for name, text in found.items() if text)
    return display.Table(('', ''), stated)


def _curve(row: CoastdownRow) -> list[display.Section]:
    known = _known(row)
    if len(known) < 2:
        return []
    places = np.unique(known[np.linspace(0, len(known) - 1, _LINES).round().astype(int)])
    head = ('speed [knots]', 'resistance', 'effective power', 'over the clean hull [%]')
    table = display.Table(head, tuple(_cells(row, int(place)) for place in places))
    caption = 'Resistance and effective power; ± is two standard deviations, of the run alone'
    drawn, tables = (_coastdown_curve(row),), ((caption, table),)
    return [display.Section('What she needed', pictures=drawn, tables=tables)]


def _verdict(row: CoastdownRow) -> str:
    if row['verdict'] is None:
        return 'It was not diagnosed.'
    if row['verdict'] in _VERDICTS:
        return _VERDICTS[row['verdict']]
    if row['verdict'] == 'named':
        names = ' and '.join(each['name'].replace('_', ' ') for each in json.loads(row['effects']))
        return f'Missing in the model of the clean hull: {names}.'
    return 'Missing is one of those below; this run alone cannot separate them.'


def _candidates(row: CoastdownRow) -> tuple[tuple[str, display.Table], ...]:
    rows = []
    for each in json.loads(row['candidates'] or '[]'):
        sizes = [
            _size(effect['name'], name, Parameter(size['value'], size['sd']))
            for effect in each['effects']
            for name, size in effect['parameters'].items()
        ]
        names = ' and '.join(name.replace('_', ' ') for name in each['names'])
        rows.append((names, f'{each["probability"]:.1%}', '; '.join(sizes)))
    if not rows:
        return ()
    head = ('effect', 'probability', 'how large; ± is two standard deviations')
    return (('How probable, and how large', display.Table(head, tuple(rows))),)


def _size(effect: str, name: str, size: Parameter) -> str:
    """Return the size of an effect in words; of one that this version does not know, as it is."""
    with suppress(SimulationError):
        for quantity in find(effect).parameters:
            if quantity.name == name:
                return f'{quantity_text(quantity)} {size_text(quantity, size)}'
    return f'{name} {display.plus_minus(size.value, 2.0 * size.sd)}'
