# SPDX-License-Identifier: Apache-2.0
"""`shipdrag info`: what is in a bag."""

from __future__ import annotations

import argparse
from typing import Any

from shipdrag_ros import display
from shipdrag_ros.bags import BagInfo, info
from shipdrag_ros.cli.arguments import add_json, add_remap, bag
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.windowed import open_sources
from shipdrag_ros.display import Table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Show what is in bags: length, topics with their rates, which of them are inputs, what '
        'is attached, and what is wrong. Of a log that is no bag: what a bag of it holds. '
        'Estimates nothing.'
    )
    parser.add_argument(
        'bags', nargs='+', type=bag, metavar='BAG', help='MCAP file, rosbag2 directory, or log'
    )
    add_remap(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Show what is in the bags.
    """
    output = Output(options.json)
    found = [info(each) for each in open_sources(options.bags, output, remap=dict(options.remap))]
    for about in found:
        _show(output, about)
    output.json({'bags': [_document(about) for about in found]})
    return 0


def _show(output: Output, about: BagInfo) -> None:
    output.heading(about.name)
    for warning in about.warnings:
        output.say(f'Warning: {warning}')
    begin = '-' if about.start_ns is None else display.utc(about.start_ns)
    attached = ', '.join(f'{name} ({size} bytes)' for name, size in about.attachments.items())
    rows = [
        ('files', ', '.join(str(path) for path in about.paths)),
        ('size', f'{about.size_bytes * 1e-6:.3f} MB, compression {about.compression}'),
        ('begin', begin),
        ('length', display.duration(about.duration_s)),
        ('messages', f'{about.messages}'),
        ('recorded by', f'shipdrag_ros {about.software}' if about.software else 'another tool'),
        ('outputs of', about.node or '-'),
        ('attached', attached or '-'),
        ('index', 'sound' if about.indexed else 'missing or damaged: reading takes longer'),
    ]
    output.table(Table(('', ''), tuple(rows)))
    output.table(
        Table(
            ('topic', 'type', 'messages', 'rate [Hz]', 'read as'),
            tuple(
                (
                    each.topic.topic,
                    each.topic.type,
                    f'{each.topic.messages}',
                    '-' if each.rate_hz is None else f'{each.rate_hz:.3f}',
                    'refused: type not accepted'
                    if each.topic.refused
                    else each.topic.input or '-',
                )
                for each in about.topics
            ),
        )
    )
    output.say(f'Inputs that are not there: {", ".join(about.missing) or "none"}')


def _document(about: BagInfo) -> dict[str, Any]:
    return {
        'bag': about.name,
        'files': [str(path) for path in about.paths],
        'size_bytes': about.size_bytes,
        'start_ns': about.start_ns,
        'end_ns': about.end_ns,
        'duration_s': about.duration_s,
        'messages': about.messages,
        'compression': about.compression,
        'indexed': about.indexed,
        'topics': [
            {
                'topic': each.topic.topic,
                'type': each.topic.type,
                'messages': each.topic.messages,
                'rate_hz': each.rate_hz,
                'input': each.topic.input,
                'refused': each.topic.refused,
            }
            for each in about.topics
        ],
        'missing_inputs': about.missing,
        'attachments': about.attachments,
        'software': about.software,
        'node': about.node,
        'warnings': about.warnings,
    }
