# SPDX-License-Identifier: Apache-2.0
"""What a recording holds, read by the library of MCAP and not by ours."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from mcap.reader import make_reader
from mcap.summary import Summary


class Row(NamedTuple):
    topic: str
    log_ns: int
    publish_ns: int
    payload: bytes


def rows(bag: Path, *topics: str) -> list[Row]:
    """Return the messages, or those of some topics, in the order of the file."""
    with bag.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        found = reader.iter_messages(topics or None, log_time_order=False)
        return [Row(c.topic, m.log_time, m.publish_time, m.data) for _, c, m in found]


def attachments(bag: Path) -> dict[str, str]:
    with bag.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        return {item.name: item.data.decode() for item in reader.iter_attachments()}


def summary(bag: Path) -> Summary:
    with bag.open('rb') as stream:
        found = make_reader(stream).get_summary()
    assert found is not None
    return found
