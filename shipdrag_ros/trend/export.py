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
    'effective_power_kw',
    'speed_loss_at_equal_effective_power',
    'hull_added_resistance',
    'hull_added_resistance_sd',
)
"""One row a coastdown: shares of the clean hull's resistance; `hull_` is the trend there."""


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
                (1.0 + point.value) * clean_n * speed / 1000.0,
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
    table = rows(trends)
    try:
        if path.suffix == '.parquet':
            import pyarrow as pa  # takes long to import
            import pyarrow.parquet as pq

            pq.write_table(pa.Table.from_pylist(table, _schema(pa)), path)
            return
        with path.open('w', newline='', encoding='utf-8') as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            for row in table:
                writer.writerow(
                    {k: spreadsheet_text(v) if isinstance(v, str) else v for k, v in row.items()}
                )
    except OSError as error:
        raise FleetError(f'{str(path)!r} cannot be written: {error.strerror}') from error


def _schema(pa: Any) -> Any:
    kinds = dict.fromkeys(('ship', 'time', 'bag', 'reason'), pa.string()) | {'used': pa.bool_()}
    return pa.schema([(name, kinds.get(name, pa.float64())) for name in COLUMNS])


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value
