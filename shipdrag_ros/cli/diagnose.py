# SPDX-License-Identifier: Apache-2.0
"""`shipdrag diagnose`: where model and data disagree, and which effect is missing."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from shipdrag_ros.bags import Run
from shipdrag_ros.cli import diagnose_json
from shipdrag_ros.cli.arguments import add_json, add_remap, add_report, number, unused_file
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.windowed import (
    HELP,
    Span,
    WindowedRun,
    open_windowed,
    refuse_overlaps,
    windowed_bag,
)
from shipdrag_ros.diagnosis import (
    CoastRun,
    Diagnosis,
    SailingRecord,
    Verdict,
    diagnose,
    diagnose_fitted,
    diagnose_sailing,
    with_effects,
)
from shipdrag_ros.diagnosis import tables as diagnosis_cells
from shipdrag_ros.diagnosis import words as diagnosis_words
from shipdrag_ros.diagnosis.result import ToldFact
from shipdrag_ros.diagnosis.score import Score
from shipdrag_ros.diagnosis.together import with_log_track
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation import words as estimate_words
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import (
    ReplayResult,
    accepted_samples,
    clocks_apart,
    coast_windows,
    replay,
    why_no_coastdown,
)
from shipdrag_ros.replay.cuts import cut_lines
from shipdrag_ros.replay.playback import SHIP_FILE
from shipdrag_ros.ship import Fact, RunSheet, Ship, parse_fact, run_sheet
from shipdrag_ros.ship.facts import RATE, overriding, usage


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Hold coastdowns against the baseline of the ship file and name the effect that is '
        'missing: a name only where the data can tell, the smallest set and what would decide '
        'where they cannot, "unknown" with a place where it is none of them. Coastdowns of all '
        'bags are taken together; effects of the earth are stated along the first one. Without '
        'a baseline a form of the resistance is fitted to the runs. In a record without a '
        'coastdown the log is held against the way over ground, for which neither baseline nor '
        'ship file is needed.'
    )
    parser.add_argument(
        'bags', nargs='+', type=windowed_bag, metavar='BAG', help=f'MCAP or rosbag2; {HELP}'
    )
    parser.add_argument(
        '--ship',
        type=Path,
        metavar='FILE',
        help='ship file with a baseline (default: the one attached to the first bag)',
    )
    parser.add_argument(
        '--write',
        type=unused_file('.yaml'),
        metavar='FILE',
        help='write a ship file with the effect added, where one is named; an existing file is '
        'not overwritten',
    )
    add_report(parser, of='diagnosis')
    parser.add_argument(
        '--window',
        nargs=2,
        type=number(0.0, unit='s'),
        metavar=('START', 'END'),
        help='the coastdown [s from the start of each bag without a window of its own], without '
        'looking for one; what in it is no coastdown is cut',
    )
    parser.add_argument(
        '--fact',
        action='append',
        default=[],
        metavar='NAME[=VALUE][,rate=RATE]',
        help='what a log book knows of all runs, again for each: '
        f'{usage()}; evidence that is wrong with probability RATE (default {RATE:g}). What is '
        'known of one run stands in run.yaml beside its bag, or in BAG.run.yaml',
    )
    add_remap(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Diagnose and tell.
    """
    output = Output(options.json)
    given = None if options.ship is None else Ship.load(options.ship)
    window = None if options.window is None else tuple(options.window)
    runs = open_windowed(options.bags, remap=dict(options.remap), window=window)
    refuse_overlaps(runs)
    facts = _facts(options.fact)
    found, ship = _diagnosed(output, runs, given, facts)
    if ship is None and options.write is not None:
        raise DiagnosisError(
            f'no ship file is attached to {runs[0].run.name!r}, and --write needs one; give it '
            'with --ship FILE'
        )
    _show(output, found, ship)
    if options.report is not None:
        from shipdrag_ros.diagnosis.page import write_diagnosis  # pictures take long to import

        write_diagnosis(options.report, found, ship, score=Score.published())
        output.log(f'report in {options.report}')
    if options.write is not None and ship is not None and found.verdict is Verdict.NAMED:
        text = with_effects(ship, found.effects).to_yaml()
        options.write.write_text(text, encoding='utf-8')
        output.log(f'ship file with the effect in {options.write}')
    elif options.write is not None:
        output.log(f'nothing is named, so {options.write} is not written')
    output.json(diagnose_json.document(found))
    return 0


def _facts(given: Sequence[str]) -> tuple[Fact, ...]:
    """Read facts; each may be told once."""
    facts = [parse_fact(text) for text in given]
    names = [fact.name for fact in facts]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DiagnosisError(f'--fact {twice} is given {names.count(twice)} times; give it once')
    return tuple(facts)


def _diagnosed(
    output: Output,
    runs: Sequence[WindowedRun],
    given: Ship | None,
    facts: Sequence[Fact],
) -> tuple[Diagnosis, Ship | None]:
    """Diagnose by what the records hold, and return the ship if one is known."""
    windowed = any(window is not None for _, window in runs)
    if not windowed and given is None and not any(SHIP_FILE in run.attachments for run, _ in runs):
        why = 'without a ship file none is looked for; give one with --ship FILE'
        return _unused(_sailing(runs, f'No coastdown was found: {why}.'), facts), None
    seen = _found(output, runs, given)
    if not seen.coasts:
        why = f'No coastdown was found {"; ".join(seen.without)}.'
        return _unused(_sailing(runs, why), (*seen.ship.facts, *facts)), seen.ship
    if seen.ship.baseline is None:
        found = _unused(diagnose_fitted(seen.coasts, seen.ship), (*seen.ship.facts, *facts))
        found = _with_log_track(found, runs)
    else:
        found = diagnose(seen.coasts, seen.ship, seen.parameters, facts=facts)
    unused = tuple(f'no coastdown was found {each}' for each in seen.without)
    return replace(found, notes=(*found.notes, *unused), estimates=seen.estimates), seen.ship


def _with_log_track(found: Diagnosis, runs: Sequence[WindowedRun]) -> Diagnosis:
    """Hold the logs against the ways over ground besides; a note says why not."""
    try:
        return with_log_track(found, _sailing(runs, ''))
    except DiagnosisError as error:
        why = f'the log was not held against the way over ground: {str(error).strip()}'
        return replace(found, notes=(*found.notes, why))


def _unused(found: Diagnosis, facts: Sequence[Fact]) -> Diagnosis:
    """Say of facts that they were told and not used."""
    return replace(found, facts=tuple(ToldFact(fact, '', None) for fact in overriding(facts)))


def _sailing(runs: Sequence[WindowedRun], no_coastdown: str) -> Diagnosis:
    """Hold the logs against the ways over ground."""
    read = [(run.name, *accepted_samples(run, zeros=True)) for run, _ in runs]
    records = [SailingRecord(name, block) for name, block, _ in read]
    try:
        return diagnose_sailing(records, read[0][2], no_coastdown=no_coastdown)
    except DiagnosisError as error:
        said = f'{no_coastdown} Log and track: {error}' if no_coastdown else str(error)
        raise DiagnosisError(said) from error


def coasts_of(
    output: Output, runs: Sequence[WindowedRun], given: Ship | None
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
    seen = _found(output, runs, given)
    if not seen.coasts:
        raise DiagnosisError(
            f'no coastdown was found {"; ".join(seen.without)}. Give a record in which the engine '
            'was stopped after steady sailing'
        )
    for each in seen.without:
        output.log(f'no coastdown was found {each}')
    return seen.coasts, seen.ship, seen.parameters


@dataclass(frozen=True)
class _Coastdowns:
    """The coastdowns of all bags, their estimates, and of each bag without one why."""

    coasts: list[CoastRun]
    ship: Ship
    parameters: Parameters
    without: tuple[str, ...]
    estimates: tuple[Estimate, ...]


def _found(
    output: Output,
    runs: Sequence[WindowedRun],
    given: Ship | None,
) -> _Coastdowns:
    """Find the coastdowns, if there are any; ship and parameters as in `coasts_of`."""
    coasts: list[CoastRun] = []
    without: list[str] = []
    estimates: list[Estimate] = []
    ship, parameters = given, None
    for each, window in runs:
        with output.progress(f'replaying {each.name}') as progress:
            result = replay(each, ship=ship, window=window, progress=progress)
        ship, parameters = ship or result.ship, parameters or result.parameters
        sheet, of_run = _sheet(output, each, ship)
        for name in clocks_apart(result):
            output.log(
                f'{each.name}: the clock of {name} is too slow or too fast, and on board it is '
                'rejected; it is diagnosed all the same'
            )
        _tell_cuts(output, result, window)
        windows = coast_windows(result)
        estimates += [part.estimate for part, _ in windows if part.estimate is not None]
        if not windows:
            without.append(f'in {each.name!r}: {why_no_coastdown(result)}')
        for place, (_, found) in enumerate(windows, start=1):
            name = each.name if len(windows) == 1 else f'{each.name}, coastdown {place}'
            coasts.append(CoastRun(name, found, sheet.facts, of_run))
    assert ship is not None
    assert parameters is not None
    return _Coastdowns(coasts, ship, parameters, tuple(without), tuple(estimates))


def _sheet(output: Output, run: Run, ship: Ship) -> tuple[RunSheet, Ship | None]:
    """Return what is known of a run alone, and the ship where she was another in it."""
    path = run_sheet.find(run.paths)
    if path is None:
        return RunSheet(), None
    sheet = RunSheet.load(path)
    output.log(f'{run.name}: {path} holds for this run')
    of_run = sheet.of(ship, subject=str(path))
    return sheet, None if of_run == ship else of_run


def _tell_cuts(output: Output, result: ReplayResult, window: Span | None) -> None:
    """Say what of the coastdowns was cut; a window of which nothing is left is an error."""
    name = result.run.name
    for coastdown in result.coastdowns:
        if window is not None and coastdown.withdrawn:
            raise DiagnosisError(
                f'{name!r}: no coastdown from {window[0]:g} to {window[1]:g} s: '
                f'{coastdown.failure}; give another window'
            )
        for line in cut_lines(coastdown, result.run.span_ns):
            output.log(f'{name}: {line}')


def _show(output: Output, found: Diagnosis, ship: Ship | None) -> None:
    if found.no_coastdown:
        output.say(found.no_coastdown)
    output.say(diagnosis_words.sentence(found))
    if found.runs_differ:
        output.say(diagnosis_words.differing(found))
    if ship is not None:
        for line in estimate_words.in_service(found.estimates, ship):
            output.say(line)
    output.say(diagnosis_words.examined(found))
    if found.where is not None:
        output.say(f'Model and data disagree {diagnosis_words.place(found)}.')
    for line in (*diagnosis_words.facts(found), *found.notes):
        output.say(line)
    output.heading('How probable')
    output.table(diagnosis_cells.probabilities(found))
    if found.effects:
        output.heading('How large; sd is one standard deviation')
        output.table(diagnosis_cells.parameters(found.effects))
    elif diagnosis_cells.sizes(found).rows:
        output.heading('How large, were it the one; sd is one standard deviation')
        output.table(diagnosis_cells.sizes(found))
    if found.facts:
        output.heading('Facts that were told')
        output.table(diagnosis_cells.facts(found))
    output.heading('Gap between model and data')
    output.table(diagnosis_cells.gaps(found))
    advice = diagnosis_words.advice(found)
    if advice:
        output.heading('What would decide')
    for line in advice:
        output.say(f'  {line}')
