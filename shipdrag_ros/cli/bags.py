# SPDX-License-Identifier: Apache-2.0
"""Bags: what is in one, is it sound, and what is whole in a damaged one."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from shipdrag_ros import display
from shipdrag_ros.bags import Run
from shipdrag_ros.bags.check import FileCheck, check
from shipdrag_ros.bags.records import Damage
from shipdrag_ros.bags.recover import Recovery, recover
from shipdrag_ros.cli.arguments import add, add_bags, bag, new_file, open_parts
from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Table


def add_info(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add_bags(parser)
    add(parser, '--remap', '--json')


def run_info(options: argparse.Namespace) -> int:
    """
    Show what is in bags: length, topics with their rates, which of them are inputs, what is
    attached, and what is wrong. Of a log that is no bag: what a bag of it holds. Estimates
    nothing.

    Options
    -------
    BAG
        MCAP file, rosbag2 directory, or log; BAG@START:END is this part alone [s from its start]

    Examples
    --------
    shipdrag info run.mcap
    shipdrag info out.mcap back.mcap --json info.json
    """
    output = Output(options.json)
    runs = open_parts(options.bags, output, remap=options.remap)
    documents = [each.about() for each in runs]
    for each, about in zip(runs, documents, strict=True):
        _show_info(output, each, about)
    output.json({'bags': documents})
    return 0


def _show_info(output: Output, run: Run, about: dict[str, Any]) -> None:
    output.heading(run.name)
    output.say(*run.warnings, lead='Warning: ')
    span_ns = run.span_ns
    attached = ', '.join(f'{name} ({size} bytes)' for name, size in about['attachments'].items())
    rows = [
        ('files', ', '.join(about['files'])),
        ('size', f'{about["size_bytes"] * 1e-6:.3f} MB, compression {run.compression}'),
        ('begin', '-' if span_ns is None else display.utc(span_ns[0])),
        ('length', display.duration(run.duration_s)),
        ('messages', f'{about["messages"]}'),
        ('recorded by', f'shipdrag_ros {run.software}' if run.software else 'another tool'),
        ('outputs of', run.node or '-'),
        ('attached', attached or '-'),
        ('index', 'sound' if run.indexed else 'missing or damaged: reading takes longer'),
    ]
    output.table(Table(('', ''), tuple(rows)))
    topics = tuple(
        (
            each['topic'],
            each['type'],
            f'{each["messages"]}',
            '-' if each['rate_hz'] is None else f'{each["rate_hz"]:.3f}',
            'refused: type not accepted' if each['refused'] else each['input'] or '-',
        )
        for each in about['topics']
    )
    output.table(Table(('topic', 'type', 'messages', 'rate [Hz]', 'read as'), topics))
    output.say(f'Inputs that are not there: {", ".join(about["missing_inputs"]) or "none"}')


NOT_SOUND = 1
_SHOWN = 40


def add_check(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('bags', nargs='+', type=bag, metavar='BAG')
    add(parser, '--json')


def run_check(options: argparse.Namespace) -> int:
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
    output = Output(options.json)
    with output.progress('checking') as progress:
        found = check(options.bags, progress=progress)
    for each in found:
        verdict = 'sound' if each.sound else f'NOT SOUND, {each.damage_count} damage(s)'
        output.heading(f'{each.path}: {verdict}')
        output.say(f'{each.messages} messages, {each.size_bytes} bytes')
        if not each.sound:
            _damage_table(output, each.damage, each.damage_count)
    sound = all(each.sound for each in found)
    output.json({'sound': sound, 'files': [_document_check(each) for each in found]})
    return 0 if sound else NOT_SOUND


def _document_check(about: FileCheck) -> dict[str, Any]:
    return {
        'file': str(about.path),
        'sound': about.sound,
        'size_bytes': about.size_bytes,
        'messages': about.messages,
        'damage_count': about.damage_count,
        'damage': [_document_damage(each) | {'detail': each.detail} for each in about.damage],
    }


def _document_damage(each: Damage) -> dict[str, Any]:
    return {'offset': each.offset, 'record': each.record, 'kind': each.kind.value}


def _damage_table(output: Output, damages: Sequence[Damage], count: int) -> None:
    """Print the first damages, and how many more there are."""
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


def add_recover(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('source', type=bag, metavar='SOURCE')
    parser.add_argument('-o', '--out', required=True, type=new_file('.mcap'))
    add(parser, '--json')


def run_recover(options: argparse.Namespace) -> int:
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
    output = Output(options.json)
    with output.progress(f'reading {options.source}') as progress:
        result = recover(options.source, options.out, progress=progress)
    whole = not result.damage
    if whole:  # the salvage does without the index, of which the check speaks
        result = _with_index(result, check([options.source]))
    _show_recover(output, options.source, result, whole=whole)
    output.json(_document_recover(result))
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


def _show_recover(output: Output, source: Path, result: Recovery, *, whole: bool) -> None:
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
        _damage_table(output, result.damage, result.damage_count)


def _document_recover(result: Recovery) -> dict[str, Any]:
    about = asdict(result)
    del about['damage_count']
    about['damage'] = [
        _document_damage(each) | ({'file': each.file} if each.file else {})
        for each in result.damage
    ]
    places = {name: about[name] and str(about[name]) for name in ('output', 'quarantine')}
    return about | places
