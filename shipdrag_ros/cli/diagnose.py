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
from shipdrag_ros.report.cells import Table
from shipdrag_ros.report.diagnosis_words import advice, sentence
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
    _show(output, found, coasts)
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


def _show(output: Output, found: Diagnosis, coasts: Sequence[CoastRun]) -> None:
    output.say(sentence(found))
    if found.verdict is not Verdict.NONE or found.nothing < 1.0:
        rows = [
            (' + '.join(candidate.names) or 'nothing missing', f'{candidate.probability:.3f}')
            for candidate in found.candidates
        ]
        output.heading('Probabilities')
        output.table(Table(('', 'probability'), tuple(rows)))
    for effect in found.effects:
        output.heading(effect.name)
        output.table(
            Table(
                ('', 'value', 'sd'),
                tuple(
                    (name, f'{value.value:.4g}', f'{value.sd:.2g}')
                    for name, value in effect.parameters.items()
                ),
            )
        )
    output.heading(f'Gap between model and data, {len(coasts)} run(s)')
    gaps = {
        'before': found.before,
        'after': found.after,
        'before, each run predicted from the others': found.held_out_before,
        'after, each run predicted from the others': found.held_out_after,
    }
    output.table(
        Table(
            ('', 'speed rms [m/s]', 'position rms [m]', 'chi2 a sample'),
            tuple(
                (
                    name,
                    _number(gap.rms_speed_m_s, '.3f'),
                    _number(gap.rms_position_m, '.1f'),
                    _number(gap.chi2_per_sample, '.2f'),
                )
                for name, gap in gaps.items()
                if gap is not None
            ),
        )
    )
    for line in advice(found):
        output.say(line)


def _number(value: float | None, form: str) -> str:
    return '-' if value is None else format(value, form)
