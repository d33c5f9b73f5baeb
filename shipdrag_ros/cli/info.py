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
from typing import Any

from shipdrag_ros import display
from shipdrag_ros.bags import Run
from shipdrag_ros.cli.arguments import add
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.windowed import add_bags, open_parts
from shipdrag_ros.display import Table
from shipdrag_ros.messages import TOPICS
from shipdrag_ros.samples import FURTHER


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
    runs = open_parts(options.bags, output, remap=options.remap)
    documents = [_document(each) for each in runs]
    for each, about in zip(runs, documents, strict=True):
        _show(output, each, about)
    output.json({'bags': documents})
    return 0


def _document(run: Run) -> dict[str, Any]:
    topics = run.topics_inside()  # a part is read for it, and may be found damaged
    start_ns, end_ns = run.span_ns or (None, None)
    found = {*FURTHER, *(topic.input for topic in topics)}
    return {
        'bag': run.name,
        'files': tuple(map(str, run.paths)),
        'size_bytes': sum(path.stat().st_size for path in run.paths),
        'start_ns': start_ns,
        'end_ns': end_ns,
        'duration_s': run.duration_s,
        'messages': sum(topic.messages for topic in topics),
        'compression': run.compression,
        'indexed': run.indexed,
        'topics': [asdict(topic) for topic in topics],
        'missing_inputs': tuple(name for name in TOPICS if name not in found),
        'attachments': {name: len(text.encode()) for name, text in run.attachments.items()},
        'software': run.software,
        'node': run.node,
        'warnings': run.warnings,
    }


def _show(output: Output, run: Run, about: dict[str, Any]) -> None:
    output.heading(run.name)
    for warning in run.warnings:
        output.say(f'Warning: {warning}')
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
