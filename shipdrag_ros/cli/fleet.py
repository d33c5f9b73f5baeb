# SPDX-License-Identifier: Apache-2.0
"""Months of a fleet: a store of what its bags gave, the trend of each ship, a poster."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from shipdrag_ros.cli.arguments import add, new_file, whole
from shipdrag_ros.cli.output import Output, stages
from shipdrag_ros.display import Table
from shipdrag_ros.errors import FleetError
from shipdrag_ros.imports import need
from shipdrag_ros.ship import SHIP_FILE, Ship

if TYPE_CHECKING:
    from shipdrag_ros.fleet.update import Report
    from shipdrag_ros.trend import ShipTrend


_SKIPPED = 1
_EVERY_S = 15.0  # a line of progress, where there is no terminal
_SHOWN = 50  # of the bags that were skipped; all are in the JSON and in the store


def add_fleet(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('folders', nargs='+', metavar='DIR_OR_URL')
    parser.add_argument('-o', '--out', required=True, type=Path)
    engine = parser.add_mutually_exclusive_group()
    engine.add_argument('--workers', type=whole(1, 1024))
    engine.add_argument('--scheduler')
    add(parser, '--json')


def run_fleet(options: argparse.Namespace) -> int:
    """
    Replay and diagnose every bag below folders, here or in an object store, and write one row a
    coastdown into a data set of Parquet files. The ship file of a bag is the nearest ship.yaml
    upwards, or the one attached. What is done already is not done again. Bags that cannot be read
    are skipped and listed, and the exit status is then 1.

    Options
    -------
    DIR_OR_URL
        folder, or URL as s3://bucket/folder (the usual AWS variables say where and who): bags
        (MCAP, rosbag2, ROS 1), tables (.csv, .tsv) whose columns `shipdrag import` knows without
        options, and logs that `shipdrag import` knows by their first bytes, whatever their names
    --out STORE
        folder; made if missing
    --workers N
        processes on this machine (default: one a core)
    --scheduler ADDRESS
        a Dask cluster that exists, as tcp://host:8786; its workers have one thread each, this
        version of the program, and see the folders under the same paths

    Examples
    --------
    shipdrag fleet records -o store --workers 1
    shipdrag fleet records -o store --json fleet.json
    """
    from shipdrag_ros.fleet.find import find
    from shipdrag_ros.fleet.store import Store
    from shipdrag_ros.fleet.update import Engine, update

    output = Output(options.json)
    found = find(options.folders, without=options.out)
    if not (found.sources or found.skipped):
        raise FleetError(
            f'no bag lies below {", ".join(map(repr, options.folders))}: no .mcap file, directory '
            'of rosbag2, .csv table or log of a format that `shipdrag import` knows'
        )
    store = Store(options.out)
    output.log(
        f'{len(found.sources)} bag(s) found; {found.left_alone} other file(s) left alone; '
        'starting workers'
    )
    with (
        Engine(
            workers=options.workers, scheduler=options.scheduler, at_most=len(found.sources)
        ) as engine,
        stages(output, every_s=_EVERY_S, at_once=False) as progress,
    ):
        report = update(found, store, engine, progress)
    _show_fleet(output, options.out, report)
    output.json(_document(options.out, report))
    return _SKIPPED if report.skipped else 0


def _show_fleet(output: Output, store: Path, report: Report) -> None:
    coastdowns = sum(done.coastdowns for done in report.bags.values())
    read = [done for done in report.bags.values() if done.error is None]
    output.say(
        f'{store}: {coastdowns} coastdown(s) of {len(read)} bag(s); {report.new} bag(s) replayed '
        f'now, {len(read) - report.new} done before, {len(report.skipped)} skipped'
    )
    ships = _ships(report)
    if ships:
        rows = tuple((name, f'{bags}', f'{many}') for name, bags, many in ships)
        output.table(Table(('ship', 'bags', 'coastdowns'), rows))
    without = sum(done.coastdowns == 0 for done in read)
    if without:
        output.say(f'{without} bag(s) hold no coastdown; the warnings of each in bags/ say why')
    if report.removed:
        output.say(f'{report.removed} bag(s) have changed; their former rows are removed.')
    for twin in report.twins[:_SHOWN]:
        other = ', with another ship or run file beside it, which is not used,'
        output.say(
            f'{twin.bag!r} has the content of {twin.same_as!r}{other * twin.differs} and is '
            'counted once'
        )
    output.say(*report.notes)
    if report.skipped:
        output.heading(f'{len(report.skipped)} skipped')
    output.say(*(f'  {each.bag!r}: {each.reason}' for each in report.skipped[:_SHOWN]))
    if len(report.skipped) > _SHOWN:
        output.say(f'  and {len(report.skipped) - _SHOWN} more, which --json and bags/ list')


def _ships(report: Report) -> list[tuple[str, int, int]]:
    """Return name, number of bags and of coastdowns of each ship."""
    bags: Counter[str] = Counter()
    coastdowns: Counter[str] = Counter()
    for done in report.bags.values():
        if done.ship is not None:
            bags[done.ship] += 1
            coastdowns[done.ship] += done.coastdowns
    return [(name, bags[name], coastdowns[name]) for name in sorted(bags)]


def _document(store: Path, report: Report) -> dict[str, object]:
    return {
        'store': str(store),
        'bags': len(report.bags),
        'new': report.new,
        'coastdowns': sum(done.coastdowns for done in report.bags.values()),
        'ships': [
            {'name': name, 'bags': bags, 'coastdowns': coastdowns}
            for name, bags, coastdowns in _ships(report)
        ],
        'same_content': [twin._asdict() for twin in report.twins],
        'skipped': [{'bag': each.bag, 'reason': each.reason} for each in report.skipped],
        'notes': list(report.notes),
    }


_LISTED = 4
_CLOSED: dict[str, str | bool | int | float | list[str]] = {
    'enable_external_access': 'false',
    'python_enable_replacements': 'false',
}


def add_trend(parser: argparse.ArgumentParser) -> None:
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


def run_trend(options: argparse.Namespace) -> int:
    """
    Added resistance of each ship against time from the store of `shipdrag fleet`: how fast it
    grows, cleanings and dockings that are known and steps that are not, outliers, when cleaning
    pays (with `economics` in the ship file), and which hull comes first.

    Options
    -------
    --sql QUERY
        put a question to the store instead: runs (date, added percent, kN, USD), ships (the
        ranking), coastdowns and bags (docs/trend.md)
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
    _show_trends(output, trends, skipped)
    if options.report is not None:
        from shipdrag_ros.trend.page import fleet_text  # pictures take long to import

        links = None if options.pages is None else _write_pages(output, options)
        text = fleet_text(trends, skipped, links=links)
        options.report.write_text(text, encoding='utf-8')
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


def _show_trends(
    output: Output, trends: Sequence[ShipTrend], skipped: Sequence[tuple[str, str]]
) -> None:
    """Show the fleet, then each ship."""
    from shipdrag_ros.trend import words

    if not trends:
        output.say('The store holds no coastdown: no trend.')
    else:
        output.table(words.ranking(trends), 'Which hull first')
        output.say(words.ranked_by(trends))
    for trend in trends:
        output.heading(trend.series.name)
        output.say(*words.lines(trend))
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
    cells = [tuple(map(_cell, row)) for row in rows]
    if (
        not rows
        or sum(len(max(each, key=len)) + 2 for each in zip(columns, *cells)) <= output.width
    ):
        output.table(Table(columns, tuple(cells)))
    else:  # the columns do not fit beside each other
        for row in cells:
            output.table(Table(('', ''), tuple(zip(columns, row))), '')
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


def add_poster(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add(parser, 'store', '--report', '--json')


def run_poster(options: argparse.Namespace) -> int:
    """
    Stopping without engine, from the store of `shipdrag fleet`: time and way from speed to speed
    with bands of 90 %, of all runs of each ship. One page to print, beside the wheelhouse poster
    of IMO Resolution A.601(15), Appendix 2.

    Options
    -------
    --report FILE.html
        write the page with its pictures to one HTML file

    Examples
    --------
    shipdrag poster store --report poster.html
    shipdrag poster store --json poster.json
    """
    need('pyarrow')
    from shipdrag_ros.fleet.store import read_coastdowns, ship_texts
    from shipdrag_ros.trend.poster import poster, table, write_poster

    output = Output(options.json)
    rows = read_coastdowns(options.store).to_pylist()
    texts = ship_texts(options.store)
    posters = []
    for name in dict.fromkeys(row['ship'] for row in rows):
        text = texts.get(name, {}).get(SHIP_FILE)
        if text is None:
            output.say(f'{name}: no table, as the store keeps no ship file of her for n_r.')
            continue
        ship = Ship.from_yaml(text, subject=f'{name}: {SHIP_FILE}')
        found = poster(ship, [row for row in rows if row['ship'] == name])
        posters.append(found)
        output.heading(name)
        if found.steps:
            output.table(table(found))
        else:
            output.say(f'None of {len(found.runs)} coastdowns has a curve over a step of speed.')
    if not rows:
        output.say('The store holds no coastdown: no table.')
    if options.report is not None:
        write_poster(options.report, posters)
        output.log(f'page in {options.report}')
    output.json(
        {
            'ships': [
                {
                    'name': each.ship.name,
                    'coastdowns': len(each.runs),
                    'steps': [
                        {
                            'from_m_s': step.from_m_s,
                            'to_m_s': step.to_m_s,
                            'runs': step.runs,
                            'time_s': step.time_s._asdict(),
                            'distance_m': step.way_m._asdict(),
                        }
                        for step in each.steps
                    ],
                }
                for each in posters
            ]
        }
    )
    return 0
