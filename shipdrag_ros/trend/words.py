# SPDX-License-Identifier: Apache-2.0
"""
A trend in words, tables and rows, the same in the terminal, on a page and in a spreadsheet.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from shipdrag_ros.display import M_S_PER_KNOT, Table, day, decimals_of, spreadsheet_text
from shipdrag_ros.errors import FleetError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.trend.ship_trend import ShipTrend, are_priced

_SPREAD = '; ± is two standard deviations'
_CLEAN = {
    'ship file': 'the clean hull of the ship file',
    'first months': 'the mean of the first months',
}


def ranking(trends: Sequence[ShipTrend]) -> Table:
    """
    Return a line a ship, the hull to be cleaned first on top.
    """
    rows = []
    for trend in trends:
        costs, pays = trend.costs, 'cannot be said'
        if trend.cleaning is not None:
            years = trend.cleaning.years
            pays = day(trend.after_last_run(years)) if years else 'now'
        money = {'costs [USD a year]': '-' if costs is None else amount(costs.usd_per_year)}
        power = {'effective power [kW]': _plus_minus(trend.power_kw, 1.0)}
        rows.append(
            {
                'rank': '-' if trend.rank is None else f'{trend.rank}',
                'ship': trend.series.name,
                **(money | power if are_priced(trends) else power | money),  # what ranks first
                'added now [%]': percent(trend.now),
                'speed lost [%]': speed_lost_percent(_added(trend)),
                'fuel [t/day]': '-' if costs is None else amount(costs.fuel_t_per_day),
                'growth [% a year]': percent(trend.growth_per_year),
                'cleaning pays from': pays,
                'runs used': f'{len(trend.series.used)} of {len(trend.series.points)}',
            }
        )
    head = tuple(rows[0]) if rows else ('rank', 'ship')
    return Table(head, tuple(tuple(row.values()) for row in rows))


def ranked_by(trends: Sequence[ShipTrend]) -> str:
    """
    Say what the ranking goes by.
    """
    if are_priced(trends):
        return f'Ranked by what the added resistance costs a year{_SPREAD}.'
    return (
        'Ranked by the effective power that the added resistance takes: not every ship file has '
        f'prices (`economics`){_SPREAD}.'
    )


def amount(figure: Parameter) -> str:
    """
    Return an amount of money or of fuel and two standard deviations, to two digits of these.
    """
    spread = 2.0 * figure.sd
    decimals = decimals_of(spread) if spread > 0.0 else 2
    value, spread = (round(each, decimals) for each in (figure.value, spread))
    return f'{value:,.{max(decimals, 0)}f} ± {spread:,.{max(decimals, 0)}f}'


def lines(trend: ShipTrend) -> list[str]:
    """
    Return what is known of one ship, a sentence each.
    """
    series = trend.series
    found = []
    if trend.now is not None:
        knots = series.reference_speed_m_s / M_S_PER_KNOT
        found.append(
            f'Added resistance in calm deep water {percent(trend.now)} % over '
            f'{_CLEAN[series.clean]}, at {knots:.1f} kn ({series.reference_speed_m_s:.2f} m/s); '
            'growth between cleanings '
            f'{percent(trend.growth_per_year)} % a year{_SPREAD}.'
        )
    if trend.scatter is not None:
        found.append(f'Runs scatter by {100.0 * trend.scatter:.1f} % beyond their own error.')
    if trend.costs is not None:
        found.append(
            f'It costs {amount(trend.costs.usd_per_year)} USD a year as it is now; since the '
            f'first run {amount(trend.costs.usd_so_far)} USD.'
        )
    if trend.cleaning is not None:
        pays = trend.cleaning
        middle, early, late = (
            day(trend.after_last_run(years)) for years in (pays.years, pays.earliest, pays.latest)
        )
        found.append(f'Cleaning pays from {middle} (80 %: {early} to {late}).')
    left = [point for point in trend.points if not point.used]
    if left:
        found.append(f'{len(left)} run(s) are not used or given little weight:')
        found += [f'  {day(point.time_ns)} {point.bag}: {point.reason}' for point in left]
    return found + [f'{note[0].upper()}{note[1:]}.' for note in trend.notes]


def speed_loss(trend: ShipTrend) -> str:
    """
    Return the speed loss at equal effective power, as a clause; '' where not known.
    """
    loss = _speed_lost(_added(trend))
    return '' if loss is None else f', about {loss:.1%} of speed lost at equal effective power'


def _speed_lost(added: float) -> float | None:
    """Return the share of speed lost at equal effective power; None where it cannot be said."""
    # power goes as the cube of the speed; the measure of ISO 19030 would need shaft power
    return 1.0 - (1.0 + added) ** (-1.0 / 3.0) if added > -0.9 else None


def event_table(trend: ShipTrend) -> Table:
    """
    Return the steps of one ship, in the order of time.
    """
    rows = (
        (
            day(event.time_ns),
            event.kind if event.known else 'step that no log book notes',
            '-' if event.known else f'{event.probability:.0%}',
            percent(event.change),
        )
        for event in trend.events
    )
    return Table(('date', 'event', 'probability', 'change [%]'), tuple(rows))


def _added(trend: ShipTrend) -> float:
    return np.nan if trend.now is None else trend.now.value


def speed_lost_percent(added: float) -> str:
    """
    Return the speed lost at equal effective power in percent; '-' where it cannot be said.
    """
    loss = _speed_lost(added)
    return '-' if loss is None else f'{100.0 * loss:.1f}'


def percent(found: Parameter | None) -> str:
    """
    Return a share and two standard deviations in percent; '-' where not known.
    """
    return _plus_minus(found, 100.0)


def _plus_minus(found: Parameter | None, unit: float) -> str:
    if found is None:
        return '-'
    return f'{found.value * unit:.1f} ± {2.0 * found.sd * unit:.1f}'


COLUMNS = (
    *('ship', 'time', 'bag', 'used', 'reason', 'reference_speed_m_s'),
    *('added_resistance', 'added_resistance_sd', 'resistance_kn', 'resistance_kn_sd'),
    *('effective_power_kw', 'effective_power_kw_sd', 'usd_per_year', 'usd_per_year_sd'),
    'speed_loss_at_equal_effective_power',
    *('hull_added_resistance', 'hull_added_resistance_sd'),
)
"""One row a coastdown: shares of the clean hull's resistance; `hull_` is the trend there.

Money is what the added resistance of the run costs, were it there the whole year.
"""


def rows(trends: Sequence[ShipTrend]) -> list[dict[str, Any]]:
    """
    Return a row for each coastdown of each ship, in the order of rank and time.

    Returns
    -------
    list of dict
        Keys are `COLUMNS`; None where a value is not known.
    """
    found = []
    for trend in trends:
        speed, clean_n = trend.series.reference_speed_m_s, trend.series.clean_force_n
        per_unit = np.nan if trend.costs is None else trend.usd_per_unit
        for point in trend.points:
            hull = [np.nan, np.nan]
            if (curve := trend.curve) is not None:
                hull = [
                    float(np.interp(point.time_ns, curve.time_ns, each, np.nan, np.nan))
                    for each in (curve.value, curve.sd)
                ]
            values = (
                trend.series.name,
                datetime.fromtimestamp(point.time_ns / 1e9, UTC).strftime('%Y-%m-%dT%H:%M:%SZ'),
                point.bag,
                point.used,
                point.reason,
                speed,
                point.value,
                point.sd,
                *(each * clean_n / 1000.0 for each in (1.0 + point.value, point.sd)),
                *(each * clean_n * speed / 1000.0 for each in (1.0 + point.value, point.sd)),
                *(each * per_unit for each in (point.value, point.sd)),
                _speed_lost(point.value),
                *hull,
            )
            found.append({name: _known(value) for name, value in zip(COLUMNS, values)})
    return found


def write_rows(path: Path, trends: Sequence[ShipTrend]) -> None:
    """
    Write the rows as CSV, or as Parquet where the name ends with `.parquet`.

    Raises
    ------
    FleetError
        If the file cannot be written.
    """
    try:
        if path.suffix == '.parquet':
            import pyarrow as pa  # takes long to import
            import pyarrow.parquet as pq

            pq.write_table(pa.Table.from_pylist(rows(trends), _schema(pa)), path)
            return
        with path.open('w', newline='', encoding='utf-8') as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(
                {k: spreadsheet_text(v) if isinstance(v, str) else v for k, v in row.items()}
                for row in rows(trends)
            )
    except OSError as error:
        raise FleetError(f'{str(path)!r} cannot be written: {error.strerror}') from error


def run_table(trends: Sequence[ShipTrend]) -> Any:
    """
    Return the rows for questions in SQL: with a date, and shares in percent too.

    Returns
    -------
    pyarrow.Table
        `date` [timestamp in UTC], `added_percent`, `added_percent_sd`, and `COLUMNS`.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    times = [point.time_ns // 1000 for trend in trends for point in trend.points]
    plain = pa.Table.from_pylist(rows(trends), _schema(pa))
    percent = {
        f'added_percent{end}': pc.multiply(plain[f'added_resistance{end}'], 100.0)
        for end in ('', '_sd')
    }
    found = {'ship': plain['ship'], 'date': pa.array(times, pa.timestamp('us')), **percent}
    return pa.table(found | {name: plain[name] for name in COLUMNS if name not in found})


def ship_table(trends: Sequence[ShipTrend]) -> Any:
    """
    Return the ranking for questions in SQL, a row a ship.

    Returns
    -------
    pyarrow.Table
        Figures with their standard deviations; null where not known.
    """
    import pyarrow as pa

    found = []
    for trend in trends:
        costs = trend.costs
        figures = (
            ('added_percent', trend.now, 100.0),
            ('growth_percent_a_year', trend.growth_per_year, 100.0),
            ('effective_power_kw', trend.power_kw, 1.0),
            ('usd_per_year', costs and costs.usd_per_year, 1.0),
            ('fuel_t_per_day', costs and costs.fuel_t_per_day, 1.0),
        )
        row: dict[str, Any] = {'rank': trend.rank, 'ship': trend.series.name}
        for name, figure, unit in figures:
            row[name] = figure and figure.value * unit
            row[f'{name}_sd'] = figure and figure.sd * unit
        pays = trend.cleaning_from_ns
        found.append(row | {'cleaning_pays_from': None if pays is None else pays // 1000})
    kinds = {'rank': pa.int64(), 'ship': pa.string(), 'cleaning_pays_from': pa.timestamp('us')}
    names = [*found[0]] if found else [*kinds]
    schema = pa.schema([(name, kinds.get(name, pa.float64())) for name in names])
    return pa.Table.from_pylist(found, schema)


def _schema(pa: Any) -> Any:
    kinds = dict.fromkeys(('ship', 'time', 'bag', 'reason'), pa.string()) | {'used': pa.bool_()}
    return pa.schema([(name, kinds.get(name, pa.float64())) for name in COLUMNS])


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value
