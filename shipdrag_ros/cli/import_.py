# SPDX-License-Identifier: Apache-2.0
"""`shipdrag import`: a log or a table of measurements as a bag."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from shipdrag_ros.cli.arguments import add_json
from shipdrag_ros.cli.log_format import LogFormat, found
from shipdrag_ros.cli.output import Output
from shipdrag_ros.ship import Ship


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Write the measurements of an NMEA 0183 log, or with --map of a CSV file, as a bag for '
        'replay. What a sentence or a cell holds is never mended: what cannot be read is counted '
        'and told.'
    )
    parser.add_argument(
        'source', type=Path, metavar='SOURCE', help='NMEA 0183 log, also as .gz, or CSV file'
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
    add_json(parser)
    for each in found():
        each.add_arguments(parser.add_argument_group(each.title))
    parser.set_defaults(misused=parser.error)


def run(options: argparse.Namespace) -> int:
    """
    Write the bag and tell what became of the source.
    """
    chosen = _chosen(options)
    output = Output(options.json)
    attachments = {}
    if options.ship is not None:
        attachments['ship.yaml'] = Ship.load(options.ship).to_yaml()
    with output.progress(f'reading {options.source}') as progress:
        result = chosen.write(options, attachments, progress)
    chosen.show(output, options.out, result)
    output.json({'bag': str(options.out), **asdict(result)})
    return 0


def _chosen(options: argparse.Namespace) -> LogFormat:
    """Return the format of the source; what that one does not know is refused."""
    known = found()
    chosen = next((each for each in known if each.is_chosen(options)), known[0])
    lacking = chosen.missing(options)
    if lacking:
        options.misused(lacking)
    for other in known:
        for name in other.given(options) if other is not chosen else ():
            instead = f', not of {chosen.kind} ({chosen.chosen_by})'
            if not chosen.chosen_by:
                instead = f', which requires {other.chosen_by}'
            options.misused(f'argument {name}: of {other.kind}{instead}')
    return chosen
