# SPDX-License-Identifier: Apache-2.0
"""`shipdrag check`: is a bag sound."""

from __future__ import annotations

import argparse
from typing import Any

from shipdrag_ros.bags.salvage import FileCheck, check
from shipdrag_ros.cli.arguments import add_json, bag
from shipdrag_ros.cli.damage import damage_table
from shipdrag_ros.cli.output import Output

NOT_SOUND = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Say whether bags are sound: checksums, lengths, references, index and statistics of '
        'every file, each damage with its offset [bytes]. Exit status: 0 all sound, 1 not. '
        'What is whole in a damaged bag is saved by `shipdrag recover`.'
    )
    parser.add_argument(
        'bags', nargs='+', type=bag, metavar='BAG', help='MCAP file or rosbag2 directory'
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Check the bags.
    """
    output = Output(options.json)
    with output.progress('checking') as progress:
        found = check(options.bags, progress=progress)
    for each in found:
        _show(output, each)
    sound = all(each.sound for each in found)
    output.json({'sound': sound, 'files': [_document(each) for each in found]})
    return 0 if sound else NOT_SOUND


def _show(output: Output, about: FileCheck) -> None:
    verdict = 'sound' if about.sound else f'NOT SOUND, {about.damage_count} damage(s)'
    output.heading(f'{about.path}: {verdict}')
    output.say(f'{about.messages} messages, {about.size_bytes} bytes')
    if not about.sound:
        damage_table(output, about.damage, about.damage_count)


def _document(about: FileCheck) -> dict[str, Any]:
    return {
        'file': str(about.path),
        'sound': about.sound,
        'size_bytes': about.size_bytes,
        'messages': about.messages,
        'damage_count': about.damage_count,
        'damage': [
            {
                'offset': each.offset,
                'record': each.record,
                'kind': each.kind.value,
                'detail': each.detail,
            }
            for each in about.damage
        ],
    }
