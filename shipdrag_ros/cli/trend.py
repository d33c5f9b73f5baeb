# SPDX-License-Identifier: Apache-2.0
"""`shipdrag trend`: added resistance of a fleet against time, and which hull to clean."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shipdrag_ros.cli import trend_json
from shipdrag_ros.cli.arguments import add_json, add_report
from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Table
from shipdrag_ros.errors import FleetError
from shipdrag_ros.library.trending import trends_of

if TYPE_CHECKING:
    from shipdrag_ros.trend import ShipTrend


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Added resistance of each ship against time from the store of `shipdrag fleet`: how '
        'fast it grows, cleanings and dockings that are known and steps that are not, outliers, '
        'when cleaning pays (with `economics` in the ship file), and which hull comes first.'
    )
    parser.add_argument(
        'store', type=Path, metavar='STORE', help='folder that `shipdrag fleet` has written'
    )
    parser.add_argument(
        '--sql',
        metavar='QUERY',
        help='put a question to the store instead; its tables are coastdowns and bags',
    )
    add_report(parser, of='trend')
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Show the trend of each ship.
    """
    output = Output(options.json)
    if options.sql is not None:
        _answer(output, options.store, options.sql)
        return 0
    trends, skipped = trends_of(output, options.store)
    _show(output, trends, skipped)
    if options.report is not None:
        from shipdrag_ros.trend.page import write_trends  # pictures take long to import

        write_trends(options.report, trends, skipped)
        output.log(f'report in {options.report}')
    output.json(trend_json.document(trends, skipped))
    return 0


def _show(output: Output, trends: Sequence[ShipTrend], skipped: Sequence[tuple[str, str]]) -> None:
    """Show the fleet, then each ship."""
    from shipdrag_ros.trend import words

    if not trends:
        output.say('The store holds no coastdown: no trend.')
    else:
        output.heading('Which hull first')
        output.table(words.ranking(trends))
    for trend in trends:
        output.heading(trend.series.name)
        for line in words.lines(trend):
            output.say(line)
        if trend.events:
            output.table(words.event_table(trend))
    if skipped:
        output.heading(f'{len(skipped)} bag(s) could not be used')
        output.table(Table(('bag', 'reason'), tuple(skipped)))


def _answer(output: Output, store: Path, query: str) -> None:
    """
    Answer a question in SQL.

    The tables are in memory and the database reads no file, whatever the question.
    """
    import duckdb

    from shipdrag_ros.fleet.store import read_bags, read_coastdowns

    with duckdb.connect(':memory:', config={'enable_external_access': 'false'}) as database:
        database.register('coastdowns', read_coastdowns(store))
        database.register('bags', read_bags(store))
        try:
            found = database.execute(query)
            columns = tuple(each[0] for each in found.description or ())
            rows = found.fetchall()
        except duckdb.Error as error:
            raise FleetError(
                f'the question cannot be answered: {error}; the tables are coastdowns and bags'
            ) from error
    output.table(Table(columns, tuple(tuple(_cell(value) for value in row) for row in rows)))
    output.json({'columns': list(columns), 'rows': [list(row) for row in rows]})


def _cell(value: object) -> str:
    return '-' if value is None else f'{value:.6g}' if isinstance(value, float) else f'{value}'
