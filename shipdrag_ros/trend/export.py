# SPDX-License-Identifier: Apache-2.0
"""The points of a trend as rows, for a spreadsheet or a data frame."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from shipdrag_ros.display import spreadsheet_text
from shipdrag_ros.errors import FleetError
from shipdrag_ros.trend.ship_trend import ShipTrend
from shipdrag_ros.trend.words import speed_lost

COLUMNS = (
    'ship',
    'time',
    'bag',
    'used',
    'reason',
    'reference_speed_m_s',
    'added_resistance',
    'added_resistance_sd',
    'resistance_kn',
    'resistance_kn_sd',
    'effective_power_kw',
    'effective_power_kw_sd',
    'usd_per_year',
    'usd_per_year_sd',
    'speed_loss_at_equal_effective_power',
    'hull_added_resistance',
    'hull_added_resistance_sd',
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
            hull: list[float | None] = [None, None]
            if trend.curve is not None:
                curve = trend.curve
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
                speed_lost(point.value),
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
            for row in rows(trends):
                writer.writerow(
                    {k: spreadsheet_text(v) if isinstance(v, str) else v for k, v in row.items()}
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

    times = [point.time_ns // 1000 for trend in trends for point in trend.points]
    plain = pa.Table.from_pylist(rows(trends), _schema(pa))
    percent = {
        f'added_percent{end}': pa.array(
            [value and 100.0 * value for value in plain[f'added_resistance{end}'].to_pylist()],
            pa.float64(),
        )
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
