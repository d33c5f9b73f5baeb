# SPDX-License-Identifier: Apache-2.0
"""
Say whether bags are sound: checksums, lengths, references, index and statistics of every
file, each damage with its offset [bytes]. Exit status: 0 all sound, 1 not. What is whole in a
damaged bag is saved by `shipdrag recover`.

Options
-------
BAG
    MCAP file or rosbag2 directory

Examples
--------
shipdrag check run.mcap
shipdrag check out.mcap back.mcap --json check.json
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from shipdrag_ros.bags.check import FileCheck, check
from shipdrag_ros.bags.records import Damage
from shipdrag_ros.cli.arguments import add, bag
from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Table

NOT_SOUND = 1
_SHOWN = 40


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('bags', nargs='+', type=bag, metavar='BAG')
    add(parser, '--json')


def run(options: argparse.Namespace) -> int:
    """
    Check the bags.
    """
    output = Output(options.json)
    with output.progress('checking') as progress:
        found = check(options.bags, progress=progress)
    for each in found:
        verdict = 'sound' if each.sound else f'NOT SOUND, {each.damage_count} damage(s)'
        output.heading(f'{each.path}: {verdict}')
        output.say(f'{each.messages} messages, {each.size_bytes} bytes')
        if not each.sound:
            damage_table(output, each.damage, each.damage_count)
    sound = all(each.sound for each in found)
    output.json({'sound': sound, 'files': [_document(each) for each in found]})
    return 0 if sound else NOT_SOUND


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


def damage_table(output: Output, damages: Sequence[Damage], count: int) -> None:
    """
    Print the first damages, and how many more there are.
    """
    output.table(
        Table(
            ('offset', 'record', 'kind', 'what'),
            tuple(
                (
                    f'{each.offset}',
                    each.record,
                    each.kind.value,
                    ': '.join(filter(None, (each.file, each.detail))) or '-',
                )
                for each in damages[:_SHOWN]
            ),
        )
    )
    if count > _SHOWN:
        output.say(f'and {count - min(_SHOWN, len(damages))} more; --json lists them')
