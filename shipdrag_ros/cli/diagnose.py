# SPDX-License-Identifier: Apache-2.0
"""`shipdrag diagnose`: where model and data disagree, and which effect is missing."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shipdrag_ros.bags import Run, coast_windows, open_runs, replay
from shipdrag_ros.cli import diagnose_json
from shipdrag_ros.cli.arguments import add_json, bag, new_file, remap
from shipdrag_ros.cli.output import Output
from shipdrag_ros.diagnosis import CoastRun, Diagnosis, Verdict, diagnose, with_effects
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.report import diagnosis_cells, diagnosis_words
from shipdrag_ros.report.diagnosis_page import write_diagnosis
from shipdrag_ros.report.diagnosis_score import Score
from shipdrag_ros.ship import Ship


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Hold coastdowns against the baseline of the ship file and name the effect that is '
        'missing: a name only where the data can tell, the smallest set and what would decide '
        'where they cannot, "unknown" with a place where it is none of them. Coastdowns of all '
        'bags are taken together; effects of the earth are stated along the first one.'
    )
    parser.add_argument('bags', nargs='+', type=bag, metavar='BAG', help='MCAP or rosbag2')
    parser.add_argument(
        '--ship',
        type=Path,
        metavar='FILE',
        help='ship file with a baseline (default: the one attached to the first bag)',
    )
    parser.add_argument(
        '--write',
        type=new_file('.yaml'),
        metavar='FILE',
        help='write a ship file with the effect added, where one is named',
    )
    parser.add_argument(
        '--report',
        type=new_file('.html'),
        metavar='FILE.html',
        help='write the diagnosis with its pictures to one HTML file',
    )
    parser.add_argument(
        '--remap',
        action='append',
        default=[],
        type=remap,
        metavar='FROM:=TO',
        help='hear topic FROM of the bag as input TO; may be given more than once',
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Diagnose and tell.
    """
    output = Output(options.json)
    given = None if options.ship is None else Ship.load(options.ship)
    runs = open_runs(options.bags, remap=dict(options.remap))
    coasts, ship, parameters = coasts_of(output, runs, given)
    found = diagnose(coasts, ship, parameters)
    _show(output, found)
    if options.report is not None:
        write_diagnosis(options.report, found, ship, score=Score.published())
        output.log(f'report in {options.report}')
    if options.write is not None and found.verdict is Verdict.NAMED:
        text = with_effects(ship, found.effects).to_yaml()
        options.write.write_text(text, encoding='utf-8')
        output.log(f'ship file with the effect in {options.write}')
    elif options.write is not None:
        output.log(f'nothing is named, so {options.write} is not written')
    output.json(diagnose_json.document(found))
    return 0


def coasts_of(
    output: Output, runs: Sequence[Run], given: Ship | None
) -> tuple[list[CoastRun], Ship, Parameters]:
    """
    Find the coastdowns of all bags.

    Returns
    -------
    coasts, ship, parameters
        The ship given, or that of the first bag; the parameters of the first.

    Raises
    ------
    DiagnosisError
        If there is none.
    """
    coasts: list[CoastRun] = []
    ship, parameters = given, None
    for each in runs:
        with output.progress(f'replaying {each.name}') as progress:
            result = replay(each, ship=ship, progress=progress)
        ship, parameters = ship or result.ship, parameters or result.parameters
        windows = coast_windows(result)
        for number, (_, window) in enumerate(windows, start=1):
            name = each.name if len(windows) == 1 else f'{each.name}, coastdown {number}'
            coasts.append(CoastRun(name, window))
    if ship is None or parameters is None or not coasts:
        names = ', '.join(repr(each.name) for each in runs)
        raise DiagnosisError(
            f'no coastdown in {names}: give a record in which the engine was stopped after '
            'steady sailing; `shipdrag replay` shows what was found'
        )
    return coasts, ship, parameters


def _show(output: Output, found: Diagnosis) -> None:
    output.say(diagnosis_words.sentence(found))
    if found.where is not None:
        output.say(f'Model and data disagree {diagnosis_words.place(found)}.')
    for note in found.notes:
        output.say(note)
    output.heading('How probable')
    output.table(diagnosis_cells.probabilities(found))
    if found.effects:
        output.heading('How large; sd is one standard deviation')
        output.table(diagnosis_cells.parameters(found.effects))
    output.heading('Gap between model and data')
    output.table(diagnosis_cells.gaps(found))
    advice = diagnosis_words.advice(found)
    if advice:
        output.heading('What would decide')
    for line in advice:
        output.say(f'  {line}')
