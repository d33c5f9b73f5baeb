# SPDX-License-Identifier: Apache-2.0
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
    ship file with a baseline (default: the one attached to the first bag, or kept in the store)
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

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from shipdrag_ros.cli.arguments import add, unused_file
from shipdrag_ros.cli.output import Output, stages
from shipdrag_ros.cli.windowed import WindowedBag, add_bags, open_windowed
from shipdrag_ros.errors import FleetError
from shipdrag_ros.imports import need
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.term import check_name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add_bags(parser, 'BAG_OR_STORE')
    add(parser, '--ship')
    parser.add_argument('-o', '--out', required=True, type=unused_file('.yaml'))
    parser.add_argument('--name')
    add(parser, '--report', '--remap', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Learn, and write what was learnt.
    """
    # what follows takes half a second to import
    from shipdrag_ros.learning import words
    from shipdrag_ros.library.diagnosis import learn_from
    from shipdrag_ros.replay.playback import SHIP_FILE

    output = Output(options.json)
    name = options.name or options.out.stem
    check_name(name)
    given = None if options.ship is None else Ship.load(options.ship)
    bags, kept = _bags(options.bags)
    runs = open_windowed(bags, remap=options.remap, output=output)
    if given is None and kept and not any(SHIP_FILE in run.attachments for run, _ in runs):
        given = _one(kept)
    with stages(output) as progress:
        found = learn_from(output, runs, given, name, progress)
    output.say(words.sentence(found))
    for line in words.lines(found):
        output.say(line)
    output.heading('How probable')
    output.table(words.table(found))
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
        from shipdrag_ros.fleet.find import SHIP_FILE
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
