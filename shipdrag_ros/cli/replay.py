# SPDX-License-Identifier: Apache-2.0
"""`shipdrag replay`: the estimates of a bag, without ROS."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shipdrag_ros.cli import replay_json, replay_text
from shipdrag_ros.cli.arguments import REPORT as REPORT_MODULES
from shipdrag_ros.cli.arguments import add_json, add_remap, add_report, number
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.windowed import HELP, open_windowed, windowed_bag
from shipdrag_ros.display import json_text
from shipdrag_ros.imports import need
from shipdrag_ros.library.replaying import replay_run
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay.hulls import Ranking, rank
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.replay.together import together
from shipdrag_ros.ship import Ship

REPORT, JSON, CURVES = 'report.html', 'result.json', 'curves.csv'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Find the coastdowns in bags and estimate r(v) as the node would have. What the node '
        'itself recorded is compared bit by bit.'
    )
    parser.add_argument(
        'bags',
        nargs='+',
        type=windowed_bag,
        metavar='BAG',
        help='MCAP file or rosbag2 directory; each is a run of its own, parts of one recording '
        f'are joined; {HELP}',
    )
    parser.add_argument(
        '--ship',
        type=Path,
        metavar='FILE',
        help='ship file (YAML) (default: the one attached to the bag)',
    )
    parser.add_argument(
        '--parameters',
        type=Path,
        metavar='FILE',
        help='parameters as `name: value` (YAML) (default: those attached to the bag)',
    )
    parser.add_argument(
        '--window',
        nargs=2,
        type=number(0.0, unit='s'),
        metavar=('START', 'END'),
        help='estimate from this part [s from the start of the bag], without looking for a '
        'coastdown, of each bag without a window of its own; what in it is no coastdown is cut',
    )
    add_remap(parser)
    parser.add_argument(
        '--compare',
        action='store_true',
        help='rank the hulls, one a bag, by the Froude number of the steepest rise of r',
    )
    parser.add_argument(
        '--out',
        type=Path,
        metavar='DIR',
        help=f'write {REPORT}, {JSON} and {CURVES} there; made if missing',
    )
    add_report(parser, of='report')
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Replay the bags and say what they gave.
    """
    output = Output(options.json)
    ship = None if options.ship is None else Ship.load(options.ship)
    parameters = None
    if options.parameters is not None:
        parameters = Parameters.load(options.parameters)
    if options.out is not None:
        need(*REPORT_MODULES)
        options.out.mkdir(parents=True, exist_ok=True)
    window = None if options.window is None else tuple(options.window)
    results = [
        replay_run(each, output, ship=ship, parameters=parameters, window=own)
        for each, own in open_windowed(
            options.bags, remap=dict(options.remap), window=window, output=output
        )
    ]
    ranking = rank(results) if options.compare else None

    for result in results:
        replay_text.show_run(output, result)
    if ranking is not None:
        replay_text.show_ranking(output, ranking)
    else:
        replay_text.show_together(output, together(results), results)
    if options.report is not None:
        from shipdrag_ros.replay.page import write_report  # pictures take long to import

        write_report(options.report, results, ranking=ranking)
        output.log(f'report in {options.report}')
    if options.out is not None:
        write_results(options.out, results, ranking=ranking)
        output.log(f'{REPORT}, {JSON} and {CURVES} in {options.out}')
    output.json(replay_json.document(results, ranking=ranking))
    return 0


def write_results(
    directory: Path, results: Sequence[RunResult], *, ranking: Ranking | None = None
) -> None:
    """
    Write the page, the JSON and the curves into a directory.
    """
    from shipdrag_ros.replay.page import write_report  # pictures take long to import
    from shipdrag_ros.replay.tables import write_curves

    write_report(directory / REPORT, results, ranking=ranking)
    document: dict[str, Any] = replay_json.document(results, ranking=ranking)
    (directory / JSON).write_text(json_text(document), encoding='utf-8')
    write_curves(directory / CURVES, results)
