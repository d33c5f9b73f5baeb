# SPDX-License-Identifier: Apache-2.0
"""`shipdrag import`: logs or tables of measurements as a bag."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from shipdrag_ros.cli.arguments import add_json
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.ship import Ship
from shipdrag_ros.sources import formats
from shipdrag_ros.sources.format import Format, Option, best_of, head_of
from shipdrag_ros.sources.log import new_bag
from shipdrag_ros.sources.reading import job_of
from shipdrag_ros.sources.run import read_joined


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    known = formats.found()
    parser.description = (
        'Write the measurements of logs or tables as a bag for replay. The format is known by the '
        'content of a file. What was understood is printed, and what was not used is counted. No '
        'value is ever repaired. `replay` and `diagnose` read such files directly, where no '
        'option is needed.'
    )
    parser.add_argument(
        'sources',
        nargs='+',
        type=Path,
        metavar='SOURCE',
        help=f'{", ".join(each.kind for each in known)}; text also packed as .gz. Several are '
        'joined; where two hold the same input for the same time, the first file is taken',
    )
    parser.add_argument(
        '-o',
        '--out',
        required=True,
        type=Path,
        metavar='BAG',
        help='MCAP file to make; an existing one is not overwritten',
    )
    parser.add_argument(
        '--ship',
        type=Path,
        metavar='FILE',
        help='ship file (YAML) to attach, so that replay needs no --ship',
    )
    parser.add_argument(
        '--format',
        choices=[each.name for each in known],
        help='format of the sources (default: known by their content)',
    )
    add_json(parser)
    added: set[str] = set()
    for each in known:
        group = parser.add_argument_group(f'{each.kind} ({each.name})', each.about)
        for option in each.options:
            if option.flag not in added:
                _add_option(group, option)
                added.add(option.flag)
    parser.set_defaults(misused=parser.error)


def _add_option(group: argparse._ArgumentGroup, option: Option) -> None:
    if not option.metavar:
        group.add_argument(option.flag, action='store_const', const=True, help=option.help)
        return
    group.add_argument(
        option.flag,
        action='append' if option.many else 'store',
        type=_reader(option),
        metavar=option.metavar,
        help=option.help,
    )


def _reader(option: Option) -> Callable[[str], Any]:
    """Return what argparse calls; a mistake in a value is one in the use of the command."""

    def read(text: str) -> Any:
        try:
            return option.read(text)
        except (ValueError, ImportDataError) as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return read


def run(options: argparse.Namespace) -> int:
    """
    Write the bag and say what became of the sources.
    """
    output = Output(options.json)
    given = {
        option.key: value
        for each in formats.found()
        for option in each.options
        if (value := getattr(options, option.key)) is not None
    }
    chosen = [_chosen(options, source, given) for source in options.sources]
    for key in given:
        if not any(key in _keys(each) for each in chosen):
            options.misused(_foreign(key, chosen))
    if 'time' in given and 'rate' in given:
        options.misused('argument --rate: not allowed with argument --time')
    attachments = {}
    if options.ship is not None:
        attachments['ship.yaml'] = Ship.load(options.ship).to_yaml()
    with (
        new_bag(options.out, attachments) as bag,
        output.progress(f'reading {options.sources[0]}') as progress,
    ):
        parts = [
            (each, replace(job_of(each, source, given), progress=progress))
            for source, each in zip(options.sources, chosen, strict=True)
        ]
        found = read_joined(parts)
        found.log.copy_to(bag)
    for source, each, result in zip(options.sources, chosen, found.results, strict=True):
        output.log(f'{source}: {each.kind}')
        for understood in result.understood:
            output.log(f'  {understood}')
        for line in result.summary(options.out):
            output.say(line)
        output.table(result.table())
        for line in result.details():
            output.say(line)
    for line in found.notes:
        output.say(line)
    documents = [
        {'source': str(source), 'format': each.name, **asdict(result)}
        for source, each, result in zip(options.sources, chosen, found.results, strict=True)
    ]
    whole = documents[0] if len(documents) == 1 else {'files': documents, 'notes': found.notes}
    output.json({'bag': str(options.out), **whole})
    return 0


def _keys(each: Format) -> set[str]:
    return {option.key for option in each.options}


def _chosen(options: argparse.Namespace, source: Path, given: dict[str, Any]) -> Format:
    known = formats.found()
    named = next((each for each in known if each.name == options.format), None)
    if named is not None:
        return named
    asked = next((each for each in known if each.chosen_by in given), None)
    return asked or best_of(known, head_of(source))


def _foreign(key: str, chosen: Sequence[Format]) -> str:
    owners = [each for each in formats.found() if key in _keys(each)]
    flag = next(option.flag for each in owners for option in each.options if option.key == key)
    kinds = ' or '.join(each.kind for each in owners)
    here = ' and '.join(dict.fromkeys(each.kind for each in chosen))
    return f'argument {flag}: of {kinds}, and this is {here} (--format says otherwise)'
