# SPDX-License-Identifier: Apache-2.0
"""The page of one coastdown, by its row of the store: no bag is needed, none is read."""

from __future__ import annotations

import json
import shlex
from contextlib import suppress
from typing import Any

import numpy as np

from shipdrag_ros.diagnosis import words
from shipdrag_ros.display import (
    M_S_PER_KNOT,
    Link,
    Section,
    Table,
    duration,
    force_unit,
    plus_minus,
    power_unit,
    ship_speed,
    utc,
)
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.report.document import page_text
from shipdrag_ros.simulation.effects import find
from shipdrag_ros.trend.page import coastdown_curve
from shipdrag_ros.trend.series import CoastdownRow

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
        Section('The run', tables=(('What is known of it', _facts(row)),)),
        *_curve(row),
        Section('What differs', lead=(_verdict(row),), tables=_candidates(row)),
        Section('More', text=(more,)),
    ]
    return page_text(
        f'{ship}: coastdown of {utc(row["time_ns"])}',
        sections,
        sentence=_sentence(row),
        above=Link('The fleet', fleet),
    )


def _mass_kg(row: CoastdownRow) -> float:
    return float(row['displaced_volume_m3'] * row['water_density_kg_m3'])


def _known(row: CoastdownRow) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Return the places of the grid where r is known."""
    r = np.asarray(row['resistance_m_s2'], dtype=float)
    return np.flatnonzero(np.isfinite(r) & (r > 0.0))


def _sentence(row: CoastdownRow) -> str:
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
    force, force_name = force_unit(mass)
    power, power_name = power_unit(mass)
    over, clean = '', row['clean_m_s2']
    if clean is not None and clean[place] is not None and np.isfinite(clean[place]):
        clean_n = mass * float(clean[place])
        over = plus_minus(100.0 * (newtons / clean_n - 1.0), 100.0 * spread / clean_n)
    return (
        f'{speed / M_S_PER_KNOT:.1f}',
        f'{plus_minus(newtons / force, spread / force)} {force_name}',
        f'{plus_minus(newtons * speed / power, spread * speed / power)} {power_name}',
        over,
    )


def _facts(row: CoastdownRow) -> Table:
    heading, end_ns = row['heading_rad'], row['end_ns']
    compass = None if heading is None else (90.0 - np.degrees(heading)) % 360.0
    flags = [_FLAGS.get(flag, flag.replace('_', ' ')) for flag in row['flags'] or ()]
    found = {
        'bag': row['bag'],
        'start': utc(row['time_ns']),
        'length': end_ns and duration((end_ns - row['time_ns']) / 1e9),
        'ended by': row['ended_by'] and row['ended_by'].replace('_', ' '),
        'compass heading': None if compass is None else f'{compass:03.0f}',
        'speed at the stop': row['speed_at_stop_m_s']
        and ship_speed(row['speed_at_stop_m_s'], _mass_kg(row)),
        'draught': row['draught_m'] and f'{row["draught_m"]:.2f} m',
        'displaced volume': f'{row["displaced_volume_m3"]:.0f} m³',
        'noted in the log book': ', '.join(row['facts'] or ()),
        'to be weighed': ', '.join(flags),
        'no estimate, because': row['error'],
        'software': f'shipdrag_ros {row["software_version"]}',
    }
    return Table(('', ''), tuple((name, str(text)) for name, text in found.items() if text))


def _curve(row: CoastdownRow) -> list[Section]:
    known = _known(row)
    if len(known) < 2:
        return []
    places = np.unique(known[np.linspace(0, len(known) - 1, _LINES).round().astype(int)])
    head = ('speed [knots]', 'resistance', 'effective power', 'over the clean hull [%]')
    table = Table(head, tuple(_cells(row, int(place)) for place in places))
    caption = 'Resistance and effective power; ± is two standard deviations, of the run alone'
    return [
        Section(
            'What she needed',
            pictures=(coastdown_curve(row, known, _mass_kg(row)),),
            tables=((caption, table),),
        )
    ]


def _verdict(row: CoastdownRow) -> str:
    if row['verdict'] is None:
        return 'It was not diagnosed.'
    if row['verdict'] in _VERDICTS:
        return _VERDICTS[row['verdict']]
    if row['verdict'] == 'named':
        names = ' and '.join(each['name'].replace('_', ' ') for each in json.loads(row['effects']))
        return f'Missing in the model of the clean hull: {names}.'
    return 'Missing is one of those below; this run alone cannot separate them.'


def _candidates(row: CoastdownRow) -> tuple[tuple[str, Table], ...]:
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
    return (('How probable, and how large', Table(head, tuple(rows))),)


def _size(effect: str, name: str, size: Parameter) -> str:
    """Return the size of an effect in words; of one that this version does not know, as it is."""
    with suppress(SimulationError):
        for quantity in find(effect).parameters:
            if quantity.name == name:
                return f'{words.quantity_text(quantity)} {words.size(quantity, size)}'
    return f'{name} {plus_minus(size.value, 2.0 * size.sd)}'
