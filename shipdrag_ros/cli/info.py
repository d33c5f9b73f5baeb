# SPDX-License-Identifier: Apache-2.0
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

from __future__ import annotations

import argparse
from dataclasses import asdict

from shipdrag_ros import display
from shipdrag_ros.bags import BagInfo, info
from shipdrag_ros.cli.arguments import add
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.windowed import add_bags, open_parts
from shipdrag_ros.display import Table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    add_bags(parser)
    add(parser, '--remap', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Show what is in the bags.
    """
    output = Output(options.json)
    found = [info(each) for each in open_parts(options.bags, output, remap=options.remap)]
    for about in found:
        _show(output, about)
    output.json({'bags': [asdict(about) for about in found]})
    return 0


def _show(output: Output, about: BagInfo) -> None:
    output.heading(about.bag)
    for warning in about.warnings:
        output.say(f'Warning: {warning}')
    begin = '-' if about.start_ns is None else display.utc(about.start_ns)
    attached = ', '.join(f'{name} ({size} bytes)' for name, size in about.attachments.items())
    rows = [
        ('files', ', '.join(about.files)),
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
    topics = tuple(
        (
            each.topic,
            each.type,
            f'{each.messages}',
            '-' if each.rate_hz is None else f'{each.rate_hz:.3f}',
            'refused: type not accepted' if each.refused else each.input or '-',
        )
        for each in about.topics
    )
    output.table(Table(('topic', 'type', 'messages', 'rate [Hz]', 'read as'), topics))
    output.say(f'Inputs that are not there: {", ".join(about.missing_inputs) or "none"}')
