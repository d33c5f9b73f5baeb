# SPDX-License-Identifier: Apache-2.0
"""Effects: which is missing, the baseline it is missing from, one without a name, their files."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shipdrag_ros.cli.arguments import WindowedBag, add, add_bags, open_windowed, unused_file
from shipdrag_ros.cli.output import Output, stages
from shipdrag_ros.display import Table
from shipdrag_ros.errors import DiagnosisError, EffectFileError, FleetError
from shipdrag_ros.imports import need
from shipdrag_ros.ship import SHIP_FILE, Fact, LearntTerm, Ship, parse_fact
from shipdrag_ros.ship.expression import unit_text
from shipdrag_ros.ship.facts import RATE as RATE
from shipdrag_ros.ship.facts import usage
from shipdrag_ros.ship.term import check_name
from shipdrag_ros.simulation.effects import LIBRARY, terms

if TYPE_CHECKING:
    from shipdrag_ros.diagnosis.learn_baseline import LearntBaseline
    from shipdrag_ros.diagnosis.result import DiagnosisResult


FACTS = usage()


def add_diagnose(parser: argparse.ArgumentParser) -> None:
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


def run_diagnose(options: argparse.Namespace) -> int:
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
        the coastdown [s from the start of each bag without a window of its own], without looking
        for one; what in it is no coastdown is cut
    --report FILE.html
        write the diagnosis with its pictures to one HTML file
    --fact NAME[=VALUE][,rate=RATE]
        what a log book knows of all runs, again for each: {FACTS}; evidence that is wrong with
        probability RATE (default {RATE:g}). What is known of one run stands in run.yaml beside its
        bag, or in BAG.run.yaml
    --earlier FILE
        what `diagnose --json FILE` wrote of earlier runs of the ship, again for each: what was
        found of hull and instruments counts, less the longer ago it was; water and weather do not

    Examples
    --------
    shipdrag diagnose out.mcap back.mcap --report diagnosis.html --write ship_now.yaml
    shipdrag diagnose run.mcap --ship ship.yaml --window 600 1800
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
    _show_diagnosis(output, found, ship)
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


def _show_diagnosis(output: Output, found: DiagnosisResult, ship: Ship | None) -> None:
    from shipdrag_ros.diagnosis import words

    output.say(*words.summary(found, ship))
    if found.question:
        return
    output.table(words.probabilities_table(found), 'How probable')
    sizes = words.sizes_table(found)
    if sizes.rows:
        were = '' if found.effects else ', were it the one'
        output.table(sizes, f'How large{were}; sd is one standard deviation')
    if found.limits:
        output.heading('Effects that are not named: how large they can be; sizes in SI')
        output.table(words.limits_table(found))
    if found.facts:
        output.table(words.facts_table(found), 'Facts that were given')
    output.table(words.gaps_table(found), 'Gap between model and data')
    advice = words.advice(found)
    if advice:
        output.heading('What would decide')
    output.say(*advice, lead='  ')


def add_baseline(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add_bags(parser)
    parser.add_argument('--ship', required=True, type=Path)
    parser.add_argument('-o', '--out', required=True, type=unused_file('.yaml'))
    add(parser, '--remap', '--json')


def run_baseline(options: argparse.Namespace) -> int:
    """
    Learn the baseline of a ship from clean runs: clean hull, calm deep water, no wind. Writes the
    ship file with the baseline that they show, in the form that it has, and how well it is known
    for a further run: what the runs leave open, and by how much they differ from each other. Five
    runs show that well; with one or two the stated relative_sd is kept. Without a baseline in the
    ship file, r(v) of the runs is written as a table.

    Options
    -------
    BAG
        MCAP or rosbag2; {PART}
    --ship FILE
        ship file (YAML); the baseline in it is taken for what was known before
    --out FILE
        ship file to write, with the learnt baseline; an existing one is not overwritten

    Examples
    --------
    shipdrag baseline clean_1.mcap clean_2.mcap --ship ship.yaml -o learnt.yaml
    shipdrag baseline clean_1.mcap --ship ship.yaml -o first.yaml --json baseline.json
    """
    # what follows takes half a second to import
    from shipdrag_ros.diagnosis.learn_baseline import learn_baseline
    from shipdrag_ros.library.diagnosing import coasts_of

    output = Output(options.json)
    runs = open_windowed(options.bags, remap=options.remap, output=output)
    with stages(output) as progress:
        coasts, ship, parameters = coasts_of(output, runs, Ship.load(options.ship), progress)
    found = learn_baseline(coasts, ship, parameters)
    options.out.write_text(found.ship.to_yaml(), encoding='utf-8')
    _show_baseline(output, found)
    output.log(f'ship file with the learnt baseline in {options.out}')
    output.json(baseline_document(found, options.out))
    return 0


def baseline_document(found: LearntBaseline, out: Path) -> dict[str, Any]:
    """
    Return the document of a learnt baseline.
    """
    from shipdrag_ros.diagnosis.learn_baseline import ENOUGH

    enough = len(found.runs) >= ENOUGH
    scatter = found.shared.scatter, found.shared.scatter_low, found.shared.scatter_high
    return {
        'runs': [
            {
                'name': each.name,
                'factor': {'value': 1.0 + each.factor.value, 'sd': each.factor.sd},
                'chi2_per_sample': each.chi2_per_row,
            }
            for each in found.runs
        ],
        'factors': {
            name: {'value': value, 'sd': sd}
            for name, value, sd in zip(
                found.names, found.factors, np.sqrt(np.diag(found.covariance)), strict=True
            )
        },
        'covariance': found.covariance,
        'scatter': dict(zip(('value', 'low', 'high'), scatter if enough else [None] * 3)),
        'relative_sd': {
            'before': None
            if found.stated_sd is None
            else dict(zip(found.names, found.stated_sd, strict=True)),
            'after': dict(zip(found.names, found.relative_sd, strict=True)),
            'correlation': found.correlation,
        },
        'speed_m_s': found.speed_m_s,
        'warnings': found.warnings,
        'output': str(out),
    }


def _show_baseline(output: Output, found: LearntBaseline) -> None:
    from shipdrag_ros.diagnosis.learn_baseline import ENOUGH

    low, high = found.speed_m_s
    output.say(
        f'{found.ship.name or "The ship"}: baseline from {len(found.runs)} run(s) over '
        f'{low:.2f} to {high:.2f} m/s.'
    )
    stated = found.stated_sd
    rows = []
    for i, name in enumerate(found.names):
        before = '-' if stated is None else f'{stated[i]:.1%}'
        sd = float(np.sqrt(found.covariance[i, i]))
        after = f'{found.relative_sd[i]:.1%}'
        rows.append((name, f'{found.factors[i]:.3f}', f'{sd:.3f}', before, after))
    columns = ('', 'factor', 'sd', 'relative_sd before', 'after')
    output.table(Table(columns, tuple(rows)), 'Learnt baseline over the one before')
    if len(found.runs) >= ENOUGH:
        output.say(
            f'Runs scatter by {found.shared.scatter:.1%} of their resistance '
            f'({found.shared.scatter_low:.1%} to {found.shared.scatter_high:.1%}).'
        )
    if len(found.runs) > 1:
        output.heading('Each run beside the others')
        beside = tuple(
            (
                one.name,
                f'{one.factor.value:+.1%}',
                f'{one.factor.sd:.1%}',
                f'{one.chi2_per_row:.2f}',
            )
            for one in found.runs
        )
        output.table(Table(('', 'resistance', 'sd', 'chi2 a sample'), beside))
    output.say(*found.warnings, lead='WARNING: ')


def add_learn(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add_bags(parser, 'BAG_OR_STORE')
    add(parser, '--ship')
    parser.add_argument('-o', '--out', required=True, type=unused_file('.yaml'))
    parser.add_argument('--name')
    add(parser, '--report', '--remap', '--json')


def run_learn(options: argparse.Namespace) -> int:
    """
    Look for one form that explains what several coastdowns of one ship share and the library has
    no name for: a force by speed, time, heading, date or depth, or an error of the log by speed
    or time. It is written as a term with units, which --effects takes, where the evidence of all
    runs is for it, beside something smooth without a formula, and each half of the runs shows it.
    Else nothing is written, and it is said what is known and which run would decide.

    Options
    -------
    BAG_OR_STORE
        bag, or a store of `shipdrag fleet`, of which all bags are taken; {PART}
    --ship FILE
        ship file with a baseline (default: the one attached to the first bag, or kept in the
        store)
    --out FILE
        file of the effect, where one is learnt; an existing one is not overwritten
    --report FILE.html
        write the result with its pictures to one HTML file
    --name NAME
        what the effect is called, small letters, digits and _ (default: that of the file)

    Examples
    --------
    shipdrag learn out.mcap back.mcap -o weed.yaml --name weed_2 --report learnt.html
    shipdrag learn clean_1.mcap clean_2.mcap --ship ship.yaml -o new.yaml --json learnt.json
    """
    # what follows takes half a second to import
    from shipdrag_ros.learning import words
    from shipdrag_ros.library.diagnosis import learn_from

    output = Output(options.json)
    name = options.name or options.out.stem
    check_name(name)
    given = None if options.ship is None else Ship.load(options.ship)
    bags, kept = _bags(options.bags)
    runs = open_windowed(bags, remap=options.remap, output=output)
    if given is None and kept and not any(run.ship for run, _ in runs):
        given = _one(kept)
    with stages(output) as progress:
        found = learn_from(output, runs, given, name, progress)
    output.say(words.sentence(found))
    output.say(*words.lines(found))
    output.table(words.table(found), 'How probable')
    if found.term is not None:
        options.out.write_text(found.term.to_yaml(), encoding='utf-8')
        output.log(f'effect in {options.out}')
    else:
        output.log(f'{options.out} is not written')
    if options.report is not None:
        words.write_report(options.report, found)
        output.log(f'report in {options.report}')
    output.json(words.document(found))
    return 0


def _bags(given: Sequence[WindowedBag]) -> tuple[list[WindowedBag], dict[str, str]]:
    """Return bags, those of each store in its place, and ship files of stores by ship."""
    found: list[WindowedBag] = []
    kept: dict[str, str] = {}
    for each in given:
        if not (each.path / 'coastdowns').is_dir():
            found.append(each)
            continue
        need('pyarrow')
        from shipdrag_ros.fleet.store import read_bags, ship_texts

        rows = [row for row in read_bags(each.path).to_pylist() if row['coastdowns']]
        if not rows:
            raise FleetError(f'{str(each.path)!r} holds no coastdown; give bags with coastdowns')
        found += [
            WindowedBag(_place(each.path, Path(row['root'], row['bag'])), each.window)
            for row in rows
        ]
        texts, ships = ship_texts(each.path), {row['ship'] for row in rows}
        kept |= {ship: texts[ship].get(SHIP_FILE, '') for ship in sorted(ships & texts.keys())}
    return found, kept


def _one(kept: Mapping[str, str]) -> Ship:
    """Return the ship of stores whose bags have none attached."""
    if len(kept) > 1:
        raise FleetError(
            f'the store holds {", ".join(map(repr, kept))}, and an effect is learnt from runs of '
            'one ship; give the bags of one, and --ship FILE'
        )
    [(name, text)] = kept.items()
    return Ship.from_yaml(text, subject=f'ship file of {name!r} in the store')


def _place(store: Path, bag: Path) -> Path:
    """Return where a bag of a store is: the store holds the last part of its folder alone."""
    for folder in (Path.cwd(), store.resolve().parent):
        # a folder that was given as `.` holds the bag without its own name
        for path in (folder / bag, folder.parent / bag):
            if path.exists():
                return path
    raise FleetError(
        f'{str(bag)!r} of the store {str(store)!r} is neither below this folder nor beside the '
        f'store; change to the folder that holds {bag.parts[0]!r}, or give the bags themselves'
    )


def add_effect(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    verbs = parser.add_subparsers(
        title='what to do', metavar='WHAT', dest='what', required=True, help='check or list'
    )
    check = verbs.add_parser('check', help='may a file be used, and if not, why')
    check.add_argument('files', nargs='+', type=Path, metavar='FILE')
    add(check, '--json')
    every = verbs.add_parser('list', help='the effects of the library, and those learnt')
    add(every, '--effects', '--json')


def run_effect(options: argparse.Namespace) -> int:
    """
    A learnt effect is data: a formula with units, which is read and never run. `check` refuses
    wrong units, names that are not known, poles inside the valid range and all that is no
    formula; `list` shows the effects of the library and of the folders given.

    Options
    -------
    FILE
        learnt effect (YAML)

    Examples
    --------
    shipdrag effect check effects/weed.yaml
    shipdrag effect list --effects effects
    """
    output = Output(options.json)
    return _check(options.files, output) if options.what == 'check' else _list(output)


def _check(files: list[Path], output: Output) -> int:
    document = []
    refused: list[str] = []
    for path in files:
        try:
            term = LearntTerm.load(path)
        except EffectFileError as error:
            refused += [f'{path}: {problem}' for problem in error.problems]
            continue
        unit = unit_text(term.units[0])
        output.say(f'{path}: {term.name} can be used: {term.term.expression} [{unit}]')
        document.append({'file': str(path), 'name': term.name, 'channel': term.term.channel})
    output.json({'effects': document, 'refused': refused})
    if refused:
        raise EffectFileError('learnt effects', refused)
    return 0


def _list(output: Output) -> int:
    rows, document = [], []
    for effect in LIBRARY.values():
        where = 'learnt' if terms([effect.name]) else 'library'
        sizes = ', '.join(f'{q.name} [{q.unit or "-"}]' for q in effect.parameters)
        rows.append((effect.name, effect.scope.value, sizes, where))
        names = [q.name for q in effect.parameters]
        document.append(
            {'name': effect.name, 'scope': effect.scope.value, 'parameters': names, 'from': where}
        )
    output.table(Table(('effect', 'scope', 'parameters', 'from'), tuple(rows)))
    output.json({'effects': document})
    return 0
