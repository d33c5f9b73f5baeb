# SPDX-License-Identifier: Apache-2.0
"""
Save every whole message of a damaged bag into a sound one, and say what was lost. Messages of
chunks that are cut off or have a wrong checksum, and of unknown topics, go into a bag of
their own beside it, NAME.quarantine.mcap. The source is not touched.

Options
-------
SOURCE
    MCAP file, or rosbag2 directory, whose files are joined
--out BAG
    MCAP file to make; an existing one is not overwritten

Examples
--------
shipdrag recover damaged.mcap -o saved.mcap
shipdrag recover damaged.mcap -o again.mcap --json recover.json
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from shipdrag_ros.bags.check import FileCheck, check
from shipdrag_ros.bags.recover import Recovery, recover
from shipdrag_ros.cli.arguments import add, bag, new_file
from shipdrag_ros.cli.check import damage_table
from shipdrag_ros.cli.output import Output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('source', type=bag, metavar='SOURCE')
    parser.add_argument('-o', '--out', required=True, type=new_file('.mcap'))
    add(parser, '--json')


def run(options: argparse.Namespace) -> int:
    """
    Save what is whole.
    """
    output = Output(options.json)
    with output.progress(f'reading {options.source}') as progress:
        result = recover(options.source, options.out, progress=progress)
    whole = not result.damage
    if whole:  # the salvage does without the index, of which the check speaks
        result = _with_index(result, check([options.source]))
    _show(output, options.source, result, whole=whole)
    output.json(_document(result))
    return 0


def _with_index(result: Recovery, found: Sequence[FileCheck]) -> Recovery:
    damage = [
        replace(each, file=file.path.name if len(found) > 1 else '')
        for file in found
        for each in file.damage
    ]
    return replace(
        result, damage=tuple(damage), damage_count=sum(file.damage_count for file in found)
    )


def _show(output: Output, source: Path, result: Recovery, *, whole: bool) -> None:
    output.say(f'{result.output}: {result.messages_recovered} messages of {source}')
    if result.quarantine is not None:
        output.say(
            f'{result.quarantine}: {result.messages_crc_suspect} messages that cannot be vouched '
            'for, cut off or with a wrong checksum'
        )
    output.say(f'{result.bytes_lost} of {result.bytes_read} bytes gave nothing.')
    if whole:
        output.say('All data are whole.')
    if whole and result.damage:
        output.say(
            f'The index of {source} is damaged, which is not needed; {result.output} has one of '
            'its own.'
        )
    if result.damage:
        output.heading(f'{result.damage_count} damage(s)')
        damage_table(output, result.damage, result.damage_count)


def _document(result: Recovery) -> dict[str, Any]:
    return {
        'messages_recovered': result.messages_recovered,
        'messages_crc_suspect': result.messages_crc_suspect,
        'bytes_read': result.bytes_read,
        'bytes_lost': result.bytes_lost,
        'damage': [
            {'offset': each.offset, 'record': each.record, 'kind': each.kind.value}
            | ({'file': each.file} if each.file else {})
            for each in result.damage
        ],
        'output': str(result.output),
        'quarantine': None if result.quarantine is None else str(result.quarantine),
    }
