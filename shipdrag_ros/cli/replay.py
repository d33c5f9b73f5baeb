# SPDX-License-Identifier: Apache-2.0
"""
Find the coastdowns in bags and estimate r(v) as the node would have. What the node itself
recorded is compared bit by bit.

Options
-------
BAG
    MCAP file or rosbag2 directory; each is a run of its own, parts of one recording are joined;
    {PART}
--window START END
    estimate from this part [s from the start of the bag], without looking for a coastdown, of
    each bag without a window of its own; what in it is no coastdown is cut
--compare
    rank the hulls, one a bag, by the Froude number of the steepest rise of r
--report FILE.html
    write the report with its pictures to one HTML file
--out DIR
    write {REPORT}, {JSON} and {CURVES} there; made if missing

Examples
--------
shipdrag replay run.mcap --report report.html
shipdrag replay run.mcap --ship ship.yaml --window 600 1800 --json result.json
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shipdrag_ros.bags import WindowedRun
from shipdrag_ros.cli.arguments import REPORT as REPORT_MODULES
from shipdrag_ros.cli.arguments import add, add_bags, open_windowed
from shipdrag_ros.cli.output import Output
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.display import json_text
from shipdrag_ros.estimation import words as estimate_words
from shipdrag_ros.estimation.force import Force
from shipdrag_ros.imports import need
from shipdrag_ros.library.replaying import replay_run
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import tables, words
from shipdrag_ros.replay.run_result import Ranking, RunResult, Together, rank, together
from shipdrag_ros.replay.tables import document
from shipdrag_ros.ship import Ship

REPORT, JSON, CURVES = 'report.html', 'result.json', 'curves.csv'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add_bags(parser)
    add(parser, '--ship', '--parameters', '--window', '--stop', '--remap')
    parser.add_argument('--compare', action='store_true')
    parser.add_argument('--out', type=Path)
    add(parser, '--report', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Replay the bags and say what they gave.
    """
    output = Output(options.json)
    if options.out is not None:
        need(*REPORT_MODULES)
    results = replayed(options, output, options.window, out=options.out)
    ranking = rank(results) if options.compare else None

    for result in results:
        show_run(output, result)
    if ranking is not None:
        output.heading('Hulls compared: the higher Fr_max, the later a hull makes wave')
        output.table(tables.ranking_table(ranking))
        output.say(*ranking.notes, lead='- ')
    else:
        show_together(output, together(results), results)
    if options.report is not None:
        from shipdrag_ros.replay.page import write_report  # pictures take long to import

        write_report(options.report, results, ranking=ranking)
        output.log(f'report in {options.report}')
    if options.out is not None:
        write_results(options.out, results, ranking=ranking)
        output.log(f'{REPORT}, {JSON} and {CURVES} in {options.out}')
    output.json(document(results, ranking=ranking))
    return 0


def replayed(
    options: argparse.Namespace,
    output: Output,
    window: Sequence[float] | None = None,
    *,
    parts: bool = False,
    out: Path | None = None,
) -> list[RunResult]:
    """
    Replay the bags with the ship, the parameters and the stop that were given.

    Parameters
    ----------
    options
        Of the verb.
    output
        Called with what is found on the way.
    window
        Of the bags without a window of their own.
    parts
        Whether a window is a part of the bag in which coastdowns are looked for.
    out
        A folder that is made as soon as all that was given is read.
    """
    ship = None if options.ship is None else Ship.load(options.ship)
    parameters = None if options.parameters is None else Parameters.load(options.parameters)
    runs = open_windowed(options.bags, remap=options.remap, window=window, output=output)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    if parts:
        runs = [WindowedRun(run.part(*own) if own else run, None) for run, own in runs]
    return [
        replay_run(each, output, ship=ship, parameters=parameters, window=own, stop=options.stop)
        for each, own in runs
    ]


def write_results(
    directory: Path, results: Sequence[RunResult], *, ranking: Ranking | None = None
) -> None:
    """
    Write the page, the JSON and the curves into a directory.
    """
    from shipdrag_ros.replay.page import write_report  # pictures take long to import

    write_report(directory / REPORT, results, ranking=ranking)
    text = json_text(document(results, ranking=ranking))
    (directory / JSON).write_text(text, encoding='utf-8')
    tables.write_curves(directory / CURVES, results)


def show_run(output: Output, run: RunResult) -> None:
    """
    Print what one bag gave.
    """
    output.heading(run.bag)
    output.say(run.ship.summary())
    output.say(*run.warnings, lead='Warning: ')
    if not run.coastdowns:
        output.say(*run.summary())
    for place, coastdown in enumerate(run.coastdowns, start=1):
        output.heading(f'Coastdown {place}')
        _show_coastdown(output, coastdown, run)
    if run.dismissed:
        output.table(tables.not_coastdowns_table(run.dismissed), 'What is no coastdown')
    output.table(tables.inputs_table(run.inputs), 'Messages')
    output.say(words.recorded_sentence(run.recorded))


def _show_coastdown(output: Output, coastdown: EndedCoastdown, run: RunResult) -> None:
    """Print one coastdown: knots and kN first, m/s and m/s² below."""
    output.say(*words.cut_lines(coastdown, run.run.span_ns))
    lines = words.summary(coastdown, run.ship)
    output.say(*lines[:-1])
    estimate = coastdown.estimate
    curve = None if estimate is None else estimate.valid_curve
    if curve is not None and len(curve):
        output.table(estimate_words.force_table(curve, run.ship))
        output.say('')
    output.say(lines[-1])
    if curve is not None and len(curve):
        truth = None if run.truth is None else run.truth.at
        output.table(estimate_words.curve_table(curve, truth=truth))
        output.say('')
    output.table(tables.facts(coastdown))
    if estimate is not None:
        output.say(*estimate_words.notes(estimate), lead='- ')


def show_together(output: Output, found: Together, runs: Sequence[RunResult]) -> None:
    """
    Print all coastdowns, a line each, and their one r(v), or why there is none.
    """
    if sum(len(run.coastdowns) for run in runs) > 1:
        output.table(tables.coastdowns_table(runs), 'All coastdowns')
    if found.combined is None:
        if found.why_not:
            output.say(f'Not combined: {found.why_not}.')
        return
    ship = runs[0].ship
    force = Force.of(found.combined, ship)
    output.heading(f'{found.combined.runs} coastdowns together')
    output.say(force.at(force.near(tables.common_speed_m_s(runs))))
    output.table(estimate_words.force_table(found.combined, ship))
    output.say('')
    output.table(estimate_words.combined_table(found.combined))
    output.say(*words.combined_notes(found.combined), lead='- ')
