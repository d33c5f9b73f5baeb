# SPDX-License-Identifier: Apache-2.0
"""
Write the measurements of logs or tables as a bag for replay. The format is known by the
content of a file. What was understood is printed, and what was not used is counted. No value
is ever repaired. `replay` and `diagnose` read such files directly, where no option is needed.

Options
-------
SOURCE
    {KINDS}; text also packed as .gz. Several are joined; where two hold the same input for the
    same time, the first file is taken
--out BAG
    MCAP file to make; an existing one is not overwritten
--ship FILE
    ship file (YAML) to attach, so that replay needs no --ship
--format
    format of the sources (default: known by their content)

Examples
--------
shipdrag import LOG.nmea.gz -o log.mcap --ship ship.yaml
shipdrag import log.csv -o plane.mcap --time t:ms --map speed_through_water=u:kn --map \
position=x,y:km
shipdrag import log.csv -o globe.mcap --rate 1 --map position=lat,lon:deg
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from shipdrag_ros import cli
from shipdrag_ros.bags.writer import new_bag
from shipdrag_ros.cli.arguments import add, checked
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.ship import Ship
from shipdrag_ros.sources import format, formats
from shipdrag_ros.sources.format import Format, Job, Option
from shipdrag_ros.sources.reading import format_of, read_joined

KINDS = ', '.join(each.kind for each in formats.found())


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    known = formats.found()
    parser.add_argument('sources', nargs='+', type=Path, metavar='SOURCE')
    parser.add_argument('-o', '--out', required=True, type=Path)
    add(parser, '--ship')
    parser.add_argument('--format', choices=[each.name for each in known])
    add(parser, '--json')
    added, shared = set[str](), cli.helps(format.__doc__, {})
    for each in known:
        about = cli.sections(each.about).get('')
        group = parser.add_argument_group(f'{each.kind} ({each.name})', about)
        for option in each.options:
            if option.flag not in added:
                _add_option(group, option, shared | cli.helps(each.about, {}))
                added.add(option.flag)
    parser.set_defaults(misused=parser.error)


def _add_option(group: argparse._ArgumentGroup, option: Option, helps: cli.Helps) -> None:
    about = option.help or helps.get(option.flag, ([], None))[1]
    if not option.metavar:
        group.add_argument(option.flag, action='store_const', const=True, help=about)
        return
    group.add_argument(
        option.flag,
        action='append' if option.many else 'store',
        type=checked(option.read),
        metavar=option.metavar,
        help=about,
    )


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
    named = next((each for each in formats.found() if each.name == options.format), None)
    chosen = [format_of(source, given, named) for source in options.sources]
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
            (each, Job(source, given, progress))
            for source, each in zip(options.sources, chosen, strict=True)
        ]
        try:
            log, results, notes = read_joined(parts)
        except ImportDataError as error:
            if named is None:
                raise
            raise ImportDataError(
                f'{error}; read as {named.kind} for --format: without it the content decides'
            ) from error
        log.copy_to(bag)
    documents = []
    for source, each, result in zip(options.sources, chosen, results, strict=True):
        output.log(f'{source}: {each.kind}')
        output.log(*(f'  {understood}' for understood in result.understood))
        output.say(*result.summary(options.out))
        output.table(result.table())
        output.say(*result.details())
        documents.append({'source': str(source), 'format': each.name, **asdict(result)})
    output.say(*notes)
    whole = documents[0] if len(documents) == 1 else {'files': documents, 'notes': notes}
    output.json({'bag': str(options.out), **whole})
    return 0


def _keys(each: Format) -> set[str]:
    return {option.key for option in each.options}


def _foreign(key: str, chosen: Sequence[Format]) -> str:
    owners = [each for each in formats.found() if key in _keys(each)]
    flag = next(option.flag for each in owners for option in each.options if option.key == key)
    kinds = ' or '.join(each.kind for each in owners)
    here = ' and '.join(dict.fromkeys(each.kind for each in chosen))
    return f'argument {flag}: of {kinds}, and this is {here} (--format says otherwise)'
