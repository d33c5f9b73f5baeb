# SPDX-License-Identifier: Apache-2.0
"""Sentences about an import that every format says alike."""

from __future__ import annotations

from collections.abc import Mapping

from shipdrag_ros.display import Table
from shipdrag_ros.sources.log import Rejected


def backward_and_repeated(backward: int, repeated: int) -> list[str]:
    """
    Say how many samples a replay will reject for their stamps.
    """
    lines = []
    if backward:
        lines.append(
            f'{backward} messages are stamped before an earlier one of their input; a replay '
            'rejects those.'
        )
    if repeated:
        lines.append(
            f'{repeated} messages have the stamp of an earlier one of their input; a replay '
            'rejects those.'
        )
    return lines


def table_of_messages(written: Mapping[str, int], sources: Mapping[str, str]) -> Table:
    """
    Return messages by input, and what each was taken from.
    """
    return Table(
        ('input', 'from', 'messages'),
        tuple((name, sources[name], f'{n}') for name, n in written.items()),
    )


def not_taken_words(not_taken: Mapping[str, Mapping[str, int]]) -> list[str]:
    """
    Say which other sources held an input.
    """
    return [
        f'{name}: not taken from {", ".join(f"{source} {n}" for source, n in counts.items())}'
        for name, counts in not_taken.items()
    ]


def rejected_words(rejected: Mapping[str, Mapping[str, Rejected]]) -> list[str]:
    """
    Say what was rejected, and why.
    """
    return [
        f'{name}: {each.count} rejected, {reason}: {each.first[0]}'
        for name, reasons in rejected.items()
        for reason, each in reasons.items()
    ]
