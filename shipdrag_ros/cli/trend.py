# SPDX-License-Identifier: Apache-2.0
"""
Added resistance of each ship against time from the store of `shipdrag fleet`: how fast it
grows, cleanings and dockings that are known and steps that are not, outliers, when cleaning
pays (with `economics` in the ship file), and which hull comes first.

Options
-------
--sql QUERY
    put a question to the store instead: runs (date, added percent, kN, USD), ships (the ranking),
    coastdowns and bags (docs/trend.md)
--csv FILE.csv
    write a row a coastdown, for a spreadsheet
--parquet FILE.parquet
    the same as Parquet, for a data frame
--report FILE.html
    write the trend with its pictures to one HTML file
--pages DIR
    with --report: write a page a coastdown there, to which the rows of the report lead

Examples
--------
shipdrag trend store --json trend.json
shipdrag trend store --sql 'select ship, count(*) from coastdowns group by ship'
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from shipdrag_ros.cli.arguments import add, new_file
from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Table
from shipdrag_ros.errors import FleetError
from shipdrag_ros.imports import need

if TYPE_CHECKING:
    from shipdrag_ros.trend import ShipTrend


_LISTED = 4
_CLOSED: dict[str, str | bool | int | float | list[str]] = {
    'enable_external_access': 'false',
    'python_enable_replacements': 'false',
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add(parser, 'store')
    parser.add_argument('--sql')
    parser.add_argument('--csv', type=new_file('.csv'))
    parser.add_argument('--parquet', type=new_file('.parquet'))
    add(parser, '--report')
    parser.add_argument('--pages', type=Path)
    add(parser, '--json')


def run(options: argparse.Namespace) -> int:
    """
    Show the trend of each ship.
    """
    need('pyarrow')
    output = Output(options.json)
    if options.sql is not None:
        if any((options.csv, options.parquet, options.report, options.pages)):
            raise FleetError('--sql: leave out --csv, --parquet, --report and --pages, or --sql')
        _answer(output, options.store, options.sql)
        return 0
    if options.pages is not None and options.report is None:
        raise FleetError('--pages DIR: give --report FILE.html too, whose rows lead there')
    from shipdrag_ros.library.trends import Trends, trends_of

    trends, skipped = trends_of(output, options.store)
    for file in filter(None, (options.csv, options.parquet)):
        from shipdrag_ros.trend.words import write_rows

        write_rows(file, trends)
        output.log(f'rows in {file}')
    _show(output, trends, skipped)
    if options.report is not None:
        from shipdrag_ros.trend.page import write_trends  # pictures take long to import

        links = None if options.pages is None else _write_pages(output, options)
        write_trends(options.report, trends, skipped, links=links)
        output.log(f'report in {options.report}')
    output.json(Trends(tuple(trends), tuple(skipped)).to_dict())
    return 0


def _write_pages(output: Output, options: argparse.Namespace) -> dict[tuple[str, int], str]:
    """Write a page for each coastdown, and return where each is from the report."""
    from shipdrag_ros.fleet.store import read_coastdowns
    from shipdrag_ros.trend.page import coastdown_page, links, page_name

    folder, report = options.pages.absolute(), options.report.absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        rows = read_coastdowns(options.store).to_pylist()
        for row in rows:
            text = coastdown_page(row, fleet=_way(folder, report))
            (folder / page_name(row)).write_text(text, encoding='utf-8')
    except OSError as error:
        raise FleetError(f'--pages {str(options.pages)!r}: {error.strerror}') from error
    output.log(f'{len(rows)} page(s) in {options.pages}')
    return links(rows, f'{_way(report.parent, folder)}/')


def _way(here: Path, there: Path) -> str:
    """Return a relative URL."""
    return quote(os.path.relpath(there, here).replace(os.sep, '/'))


def _show(output: Output, trends: Sequence[ShipTrend], skipped: Sequence[tuple[str, str]]) -> None:
    """Show the fleet, then each ship."""
    from shipdrag_ros.trend import words

    if not trends:
        output.say('The store holds no coastdown: no trend.')
    else:
        output.heading('Which hull first')
        output.table(words.ranking(trends))
        output.say(words.ranked_by(trends))
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
    from shipdrag_ros.library.trends import trends_of
    from shipdrag_ros.trend.words import run_table, ship_table

    trends, _ = trends_of(output, store)
    tables = {
        'runs': run_table(trends),
        'ships': ship_table(trends),
        'coastdowns': read_coastdowns(store),
        'bags': read_bags(store),
    }
    with duckdb.connect(':memory:', config=_CLOSED) as database:
        for name, table in tables.items():
            database.register(name, table)
        try:
            database.execute("SET TimeZone = 'UTC'")
            # as Arrow: a time with a zone needs no further package
            found = database.sql(query)
            answer = None if found is None else found.to_arrow_table()
        except duckdb.Error as error:
            known = '; '.join(
                f'{name} ({", ".join(table.column_names)})' for name, table in tables.items()
            )
            raise FleetError(
                f'the question cannot be answered: {error}; the tables are {known}'
            ) from error
    if answer is None:
        raise FleetError('--sql: that is no question; begin with SELECT')
    columns = tuple(answer.column_names)
    rows = [tuple(row) for row in zip(*(column.to_pylist() for column in answer.columns))]
    output.table(Table(columns, tuple(tuple(_cell(value) for value in row) for row in rows)))
    output.json(
        {'columns': list(columns), 'rows': [[_plain(cell) for cell in row] for row in rows]}
    )


def _cell(value: object) -> str:
    if isinstance(value, list) and len(value) > _LISTED:
        return f'{len(value)} values'  # all are in the JSON
    return '-' if value is None else f'{value:.6g}' if isinstance(value, float) else f'{value}'


def _plain(value: object) -> object:
    """Return what JSON can hold: dates, decimals and the like as text."""
    if isinstance(value, list):
        return [_plain(each) for each in value]
    return value if value is None or isinstance(value, str | int | float) else str(value)
