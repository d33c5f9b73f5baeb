# SPDX-License-Identifier: Apache-2.0
"""
Compare coastdowns with the baseline of the ship file and name the effect that is missing: a
name only where the data decide, the smallest set and what would decide where they cannot,
"unknown" with a place where it is none of them. Coastdowns of all bags are taken together;
effects of the earth are stated along the first one. Without a baseline they are compared with
all hulls of her length and volume. In a record without a coastdown the log is compared with
the way over ground, for which neither baseline nor ship file is needed.

Options
-------
BAG
    MCAP or rosbag2; {PART}
--ship FILE
    ship file with a baseline (default: the one attached to the first bag, or beside it)
--write FILE
    write a ship file with the effect added, where one is named; an existing file is not
    overwritten
--window START END
    the coastdown [s from the start of each bag without a window of its own], without looking for
    one; what in it is no coastdown is cut
--report FILE.html
    write the diagnosis with its pictures to one HTML file
--fact NAME[=VALUE][,rate=RATE]
    what a log book knows of all runs, again for each: {FACTS}; evidence that is wrong with
    probability RATE (default {RATE:g}). What is known of one run stands in run.yaml beside its
    bag, or in BAG.run.yaml
--earlier FILE
    what `diagnose --json FILE` wrote of earlier runs of the ship, again for each: what was found
    of hull and instruments counts, less the longer ago it was; water and weather do not

Examples
--------
shipdrag diagnose out.mcap back.mcap --report diagnosis.html --write ship_now.yaml
shipdrag diagnose run.mcap --ship ship.yaml --window 600 1800
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shipdrag_ros.cli.arguments import add, unused_file
from shipdrag_ros.cli.output import Output, stages
from shipdrag_ros.cli.windowed import add_bags, open_windowed
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.ship import Fact, Ship, parse_fact
from shipdrag_ros.ship.facts import RATE as RATE
from shipdrag_ros.ship.facts import usage

if TYPE_CHECKING:
    from shipdrag_ros.diagnosis.result import DiagnosisResult

FACTS = usage()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add_bags(parser)
    add(parser, '--ship')
    parser.add_argument('--write', type=unused_file('.yaml'))
    add(parser, '--report', '--window', '--stop')
    parser.add_argument('--fact', action='append', default=[])
    parser.add_argument('--earlier', type=Path, action='append', default=[])
    add(parser, '--remap', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Diagnose and show it.
    """
    # what follows takes half a second to import
    from shipdrag_ros.diagnosis import with_effects
    from shipdrag_ros.diagnosis.document import document, read_earlier
    from shipdrag_ros.inference.decision import Verdict
    from shipdrag_ros.library.diagnosing import diagnose_runs

    output = Output(options.json)
    given = None if options.ship is None else Ship.load(options.ship)
    runs = open_windowed(options.bags, remap=options.remap, window=options.window, output=output)
    facts = _facts(options.fact)
    earlier = [read_earlier(path) for path in options.earlier]
    with stages(output) as progress:
        found, ship = diagnose_runs(
            output, runs, given, facts, earlier=earlier, stop=options.stop, progress=progress
        )
    if ship is None and options.write is not None:
        raise DiagnosisError(
            f'no ship file is attached to {runs[0].run.name!r}, and --write needs one; give it '
            'with --ship FILE'
        )
    _show(output, found, ship)
    if options.report is not None:
        from shipdrag_ros.diagnosis.page import write_diagnosis

        write_diagnosis(options.report, found, ship)
        output.log(f'report in {options.report}')
    if options.write is not None and ship is not None and found.verdict is Verdict.NAMED:
        text = with_effects(ship, found.effects).to_yaml()
        options.write.write_text(text, encoding='utf-8')
        output.log(f'ship file with the effect in {options.write}')
    elif options.write is not None:
        output.log(f'nothing is named, so {options.write} is not written')
    output.json(document(found, ship))
    return 0


def _facts(given: Sequence[str]) -> tuple[Fact, ...]:
    """Read facts; each may be stated once."""
    facts = [parse_fact(text) for text in given]
    names = [fact.name for fact in facts]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DiagnosisError(f'--fact {twice} is given {names.count(twice)} times; give it once')
    return tuple(facts)


def _show(output: Output, found: DiagnosisResult, ship: Ship | None) -> None:
    from shipdrag_ros.diagnosis import tables as diagnosis_cells
    from shipdrag_ros.diagnosis import words as diagnosis_words

    for line in found.summary(ship):
        output.say(line)
    if found.question:
        return
    output.heading('How probable')
    output.table(diagnosis_cells.probabilities(found))
    sizes = diagnosis_cells.sizes(found)
    if sizes.rows:
        were = '' if found.effects else ', were it the one'
        output.heading(f'How large{were}; sd is one standard deviation')
        output.table(sizes)
    if found.limits:
        output.heading('Effects that are not named: how large they can be; sizes in SI')
        output.table(diagnosis_cells.limits(found))
    if found.facts:
        output.heading('Facts that were given')
        output.table(diagnosis_cells.facts(found))
    output.heading('Gap between model and data')
    output.table(diagnosis_cells.gaps(found))
    advice = diagnosis_words.advice(found)
    if advice:
        output.heading('What would decide')
    for line in advice:
        output.say(f'  {line}')
